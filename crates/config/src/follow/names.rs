//! Names that several SubDevices or several variables of a file have: each gives a notice, because a program that looks
//! for the name gets only the first one.

use std::collections::HashMap;

use super::notices::Notices;
use crate::eni::{Eni, Place, quoted};

/// Names shown in a notice.
const NAMES: usize = 3;

/// Adds notices for the names that are not unique.
pub(super) fn note_duplicates(eni: &Eni, notices: &mut Notices) {
    let subdevices = eni.subdevices.iter().map(|subdevice| (subdevice.name.as_str(), subdevice.place));
    note("SubDevices", subdevices, notices);
    let variables = eni.image.inputs.variables.iter().chain(&eni.image.outputs.variables);
    note("variables", variables.map(|variable| (variable.name.as_str(), variable.place)), notices);
}

fn note<'a>(what: &str, names: impl Iterator<Item = (&'a str, Place)>, notices: &mut Notices) {
    let mut times: HashMap<&str, usize> = HashMap::new();
    let mut several: Vec<(&str, Place)> = Vec::new();
    for (name, place) in names.filter(|(name, _)| !name.is_empty()) {
        let times = times.entry(name).or_default();
        *times += 1;
        if *times == 2 {
            several.push((name, place));
        }
    }
    let Some((_, place)) = several.first() else { return };
    let shown: Vec<String> = several.iter().take(NAMES).map(|(name, _)| quoted(name)).collect();
    let more = if several.len() > NAMES { ", ..." } else { "" };
    let count = match several.len() {
        1 => "a name".to_owned(),
        count => format!("{count} names"),
    };
    let subject = format!("{count} of several {what} ({}{more})", shown.join(", "));
    notices.add(Some(*place), None, subject, "found by its name is the first one in the file");
}
