//! What an activation refuses besides places, identities and process data of single SubDevices: clocks, rings, domains,
//! LRW. The checks are those of the engine.

use ringcat_engine::config::ReferenceClock;
use ringcat_engine::declared::SubDeviceId;
use ringcat_engine::link::LinkSet;
use ringcat_engine::main_device::{ActivateError, obstacles, replaced_reference};
use ringcat_wire::address::Position;

use super::difference::{Difference, DifferenceKind, FoundNetwork};
use crate::configuration::{Configuration, DeclaredRings};

/// The differences. `position_of` is the position at which a SubDevice of the file was found.
pub(super) fn differences(
    configuration: &Configuration,
    network: &FoundNetwork<'_>,
    names: &[String],
    position_of: impl Fn(SubDeviceId) -> Option<Position>,
) -> Vec<Difference> {
    let DeclaredRings { is_ring, junctions, connections } = &configuration.rings;
    let links = if network.has_redundant { LinkSet::Ring } else { LinkSet::Single };
    let mut declaration = configuration.declaration.clone();
    if network.has_redundant {
        // An LRW of the file over several SubDevices is split on request.
        declaration.explicit_lrw.clear();
    }
    let mut differences = Vec::new();
    let mut add = |subdevice: Option<SubDeviceId>, kind, prevents_op, text: String| {
        let position = subdevice.and_then(&position_of);
        let name = subdevice.and_then(|subdevice| names.get(subdevice.0));
        let text = match (name, position) {
            (Some(name), Some(position)) => format!("position {position} \"{name}\": {text}"),
            (Some(name), None) => format!("\"{name}\": {text}"),
            (None, _) => text,
        };
        differences.push(Difference { subdevice, position, kind, prevents_op, text });
    };
    if *is_ring && !network.has_redundant {
        let text = "the file declares a ring (redundancy.ring), but the network is a line: there is no redundant link";
        add(None, DifferenceKind::Ring, true, text.to_owned());
    }
    let found = obstacles(&declaration, (*junctions, connections), network.subdevices, links);
    let is_without_clock = found.iter().any(|error| matches!(error, ActivateError::NoClock { .. }));
    for error in found {
        let text = error.to_string();
        let own = error.subdevice().and_then(|subdevice| text.strip_prefix(&format!("SubDevice {subdevice}: ")));
        add(error.subdevice().filter(|_| own.is_some()), kind(&error), true, own.unwrap_or(&text).to_owned());
    }
    if declaration.explicit_lrw.len() < configuration.declaration.explicit_lrw.len() {
        let all = obstacles(&configuration.declaration, (*junctions, connections), network.subdevices, links);
        if let Some(error) = all.iter().find(|error| matches!(error, ActivateError::NamedLrwOnTwoLinks(_))) {
            add(None, DifferenceKind::Ring, false, format!("{error} (option --split-lrw)"));
        }
    }
    if let Some(error) = network.not_closed {
        add(None, DifferenceKind::Ring, true, error.to_string());
    }
    if let Some((subdevice, instead)) = replaced_reference(&declaration, network.subdevices) {
        let other = match instead {
            Some(position) => format!("the clock at position {position} is the reference"),
            None => "no SubDevice has one".to_owned(),
        };
        let text = format!("it is the reference clock of the file, but has no distributed clock: {other}");
        add(Some(subdevice), DifferenceKind::Clocks, false, text);
    }
    let has_clock = network.subdevices.iter().any(|info| info.controller.features.dc);
    let clocks = declaration.clocks.as_ref().map(|clocks| clocks.reference);
    if clocks.is_some_and(|it| !matches!(it, ReferenceClock::Declared(_))) && !has_clock && !is_without_clock {
        let text = "the file declares distributed clocks (clocks), but no SubDevice has one";
        add(None, DifferenceKind::Clocks, false, text.to_owned());
    }
    differences
}

const fn kind(error: &ActivateError) -> DifferenceKind {
    match error {
        ActivateError::Junction(_) => DifferenceKind::Ring,
        ActivateError::NoClock { .. } | ActivateError::SyncCycle { .. } => DifferenceKind::Clocks,
        _ => DifferenceKind::ProcessData,
    }
}
