//! Places of SubDevices: groups, positions, and each alias, identification and data word once.

use std::collections::{BTreeMap, BTreeSet};

use super::error::{Checked, fault};
use super::model::NetworkFile;
use super::write::next_position;
use crate::declared_twice::declared_twice;

/// Members of a group follow each other; its head is found by alias or identification.
pub(super) fn groups(file: &NetworkFile) -> Checked {
    let mut ended: BTreeSet<&str> = BTreeSet::new();
    let mut open: Option<&str> = None;
    for (index, subdevice) in file.subdevice.iter().enumerate() {
        let at = |key: &str| ["subdevice".into(), index.into(), key.into()];
        let group = subdevice.group.as_deref();
        let has_place = subdevice.position.is_some() || subdevice.alias.is_some() || subdevice.identification.is_some();
        if group == open {
            if group.is_some() && has_place {
                return fault(at("group"), "a further member of a group follows its head: expected no place");
            }
            continue;
        }
        ended.extend(open);
        open = group;
        let Some(group) = group else { continue };
        if group.is_empty() {
            return fault(at("group"), "expected a name, got an empty text");
        }
        if ended.contains(group) {
            return fault(at("group"), format!("the members of group \"{group}\" must follow each other"));
        }
        let by_mark = subdevice.alias.is_some_and(|alias| alias != 0) || subdevice.identification.is_some();
        if !by_mark || subdevice.offset.unwrap_or(0) != 0 {
            let message = format!("the head of group \"{group}\" needs an alias or an identification, without offset");
            return fault(at("group"), message);
        }
    }
    Ok(())
}

/// No two SubDevices that are found by position have the same position.
pub(super) fn positions(file: &NetworkFile) -> Checked {
    let (mut known, mut next) = (BTreeMap::new(), 0);
    for (index, subdevice) in file.subdevice.iter().enumerate() {
        let is_marked = subdevice.alias.is_some() || subdevice.identification.is_some();
        if subdevice.group.is_none() && !is_marked {
            let own = subdevice.position.unwrap_or(next);
            if let Some(first) = known.insert(own, index) {
                let message = format!("{own} is also the position of subdevice[{first}]");
                return fault(["subdevice".into(), index.into(), "position".into()], message);
            }
        }
        next = next_position(next, subdevice);
    }
    Ok(())
}

/// No two SubDevices have one alias, identification or data word with one offset, unless they exclude each other.
pub(super) fn marks(file: &NetworkFile) -> Checked {
    let configs = file.declared();
    let Some((first, second)) = declared_twice(&configs, file.declared_required()) else { return Ok(()) };
    let subdevice = &file.subdevice[second];
    let key = match (subdevice.alias, subdevice.identification) {
        (Some(_), _) => "alias",
        (_, Some(_)) => "identification",
        _ => "group",
    };
    let message = format!("{} is also the place of subdevice[{first}]", configs[second].address);
    fault(["subdevice".into(), second.into(), key.into()], message)
}
