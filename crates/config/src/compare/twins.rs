//! Several SubDevices with the alias, identification or data word of a declaration: the activation uses none of them.

use std::collections::BTreeMap;

use ringcat_engine::config::ConfigError;
use ringcat_engine::declared::SubDeviceId;
use ringcat_engine::info::SubDeviceInfo;

use super::difference::{Difference, DifferenceKind};
use super::marks::Marks;
use crate::configuration::Configuration;

/// One difference for each identifier that several SubDevices have, with the first declaration that uses it. `marks`
/// decides which differences prevent OP.
pub(super) fn differences(
    configuration: &Configuration,
    found: &[SubDeviceInfo],
    names: &[String],
    marks: &Marks,
) -> Vec<Difference> {
    let configs = &configuration.declaration.subdevices;
    let mut differences: Vec<Difference> = Vec::new();
    let mut known: BTreeMap<String, usize> = BTreeMap::new();
    for (config, error) in marks.errors() {
        let ConfigError::Ambiguous { first, .. } = error else { continue };
        let text = error.to_string();
        match known.get(&text) {
            Some(number) => differences[*number].prevents_op |= marks.fails(config),
            None => {
                // Members of an ambiguous group are counted by positions, and shift those behind them.
                let head = found.iter().position(|info| info.position == *first);
                let shifts = configs[config].group.is_some() && head.is_some_and(|head| marks.shifts(head));
                let prevents_op = marks.fails(config) || shifts;
                let (subdevice, position) = (Some(SubDeviceId(config)), Some(*first));
                let (kind, words) = (DifferenceKind::Ambiguous, format!("\"{}\": {text}", names[config]));
                known.insert(text, differences.len());
                differences.push(Difference { subdevice, position, kind, prevents_op, text: words });
            }
        }
    }
    differences
}
