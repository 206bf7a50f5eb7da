//! The PDOs that a SubDevice assigns to its SyncManagers by its SII, compared with those that a file assigns.
//!
//! The MainDevice writes the assignment where it can (protocol 5.2). A network file without PDOs leaves the assignment
//! to the SubDevice: then no PDO is a difference. Process data that an ENI does not have is not set up.

use std::collections::BTreeMap;

use ringcat_engine::config::{PdoMapping, StartupAction, SubDeviceConfig};
use ringcat_engine::info::SubDeviceInfo;
use ringcat_engine::plan;

use super::process_data;
use super::samples;
use super::written;

/// Objects with the modules that are configured and detected (ETG.5001.1).
const MODULES: [u16; 2] = [0xF030, 0xF050];
/// Most PDOs that a message lists; further ones are counted.
const LISTED: usize = 8;

/// Whether start-up commands name the modules in the slots of a SubDevice: its SII cannot list their PDOs.
pub(super) fn names_modules(declared: &SubDeviceConfig) -> bool {
    declared.startup.iter().any(|command| match &command.action {
        StartupAction::Sdo(download) => MODULES.contains(&download.index),
        StartupAction::Upload(upload) => MODULES.contains(&upload.index),
        _ => false,
    })
}

/// The SyncManagers with another assignment, each with a text. None if the file cannot be planned: that is a difference
/// of its own.
pub(super) fn differences(declared: &SubDeviceConfig, info: &SubDeviceInfo) -> Vec<(u8, String)> {
    let wanted = wanted(declared);
    let is_silent = wanted.is_empty() && declared.declared.is_none();
    if info.pdos.is_empty() || is_silent {
        return Vec::new();
    }
    let (Ok(own), Ok(_)) = (plan(&SubDeviceConfig::from_info(info), info), plan(declared, info)) else {
        return Vec::new();
    };
    let writes_pdos = written::writes_pdos(declared);
    let mut differences = Vec::new();
    for area in &own.process_data {
        let mut got: Vec<u16> = area.pdos.iter().map(|pdo| pdo.index).collect();
        // With a length and without PDOs, the SII says nothing about them.
        if got.is_empty() && area.length > 0 {
            continue;
        }
        let number = area.sync_manager;
        let mut chosen = process_data::pdos(declared).filter(|(sync_manager, _)| *sync_manager == number);
        let is_chosen = |(_, pdo): (u8, &PdoMapping)| {
            samples::is_listed(pdo, number, info) || samples::is_sample(pdo, number, info)
        };
        let expected = match wanted.get(&number) {
            Some(Some(pdos)) if !pdos.is_empty() && samples::are_chosen(number, info) && chosen.all(is_chosen) => {
                continue;
            }
            Some(Some(pdos)) => &pdos[..],
            Some(None) => continue,
            None if writes_pdos => continue,
            None => &[],
        };
        got.retain(|index| expected.contains(index) || !process_data::is_virtual(*index, info));
        differences.extend(text(expected, &got, info).map(|text| (number, format!("SM {number}: {text}"))));
    }
    differences
}

/// The PDOs of each SyncManager of the file; `None` if the file has only its length.
fn wanted(declared: &SubDeviceConfig) -> BTreeMap<u8, Option<Vec<u16>>> {
    let mut wanted = BTreeMap::new();
    if let Some(declared) = &declared.declared {
        for it in declared {
            let Some(area) = it.area() else { continue };
            let is_known = area.length == 0 || !it.pdos.is_empty();
            wanted.insert(it.index, is_known.then(|| it.pdos.iter().map(|pdo| pdo.index).collect()));
        }
        return wanted;
    }
    for it in declared.pdos.iter().flatten() {
        wanted.insert(it.sync_manager, Some(it.pdos.iter().map(|pdo| pdo.index).collect()));
    }
    wanted
}

/// How two assignments differ, with the PDOs that the SubDevice does not describe.
fn text(expected: &[u16], got: &[u16], info: &SubDeviceInfo) -> Option<String> {
    let without = |these: &[u16], others: &[u16]| -> Vec<u16> {
        these.iter().copied().filter(|index| !others.contains(index)).collect()
    };
    let (missing, more) = (without(expected, got), without(got, expected));
    let text = match (&missing[..], &more[..]) {
        ([], []) => {
            let at = (0..got.len().max(expected.len())).find(|at| expected.get(*at) != got.get(*at))?;
            let word = |pdos: &[u16]| pdos.get(at).map_or_else(|| "none".to_owned(), |index| list(&[*index]));
            format!("expected {} at place {} of the assignment, got {}", word(expected), at + 1, word(got))
        }
        ([], more) => format!("{} assigned, but not in the file", with_verb(more)),
        (missing, []) => format!("{} in the file, but not assigned", with_verb(missing)),
        (missing, more) => format!("expected {}, got {}", list(missing), list(more)),
    };
    let unknown: Vec<u16> = missing.into_iter().filter(|index| info.pdo(*index).is_none()).collect();
    Some(if unknown.is_empty() { text } else { format!("{text}; the SubDevice does not describe {}", list(&unknown)) })
}

fn with_verb(pdos: &[u16]) -> String {
    format!("{} {}", list(pdos), if pdos.len() == 1 { "is" } else { "are" })
}

fn list(pdos: &[u16]) -> String {
    let listed: Vec<String> = pdos.iter().take(LISTED).map(|index| format!("PDO {index:#06x}")).collect();
    match pdos.len().saturating_sub(LISTED) {
        0 => listed.join(", "),
        more => format!("{} and {more} more", listed.join(", ")),
    }
}
