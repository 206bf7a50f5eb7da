//! The modules in the slots of a device on the bus (protocol ES-64, ES-69): by the idents that the device has detected
//! (0xF050), else by the PDOs that it describes.

use std::collections::{HashMap, HashSet};

use ringcat_engine::info::{PdoEntryInfo, PdoInfo};

use super::model::{Device, Esi, Module, Pdo, PdoEntry, Slot, Slots};
use super::modules::{PlacedModule, definitions, fits};

/// Entries of the PDOs of a device by their index.
type Found<'a> = HashMap<u16, &'a [PdoEntryInfo]>;

/// The modules that a device on the bus has. `idents` are those of object 0xF050 by slot, empty where it was not read;
/// `pdos` are the PDOs that the device describes. Where the modules of the idents do not have these PDOs and others
/// have, the PDOs decide. What no module of the description explains is left out.
pub fn detected_modules<'a>(
    esi: &'a Esi,
    device: &'a Device,
    idents: &[u32],
    pdos: &[PdoInfo],
) -> Vec<PlacedModule<'a>> {
    let Some(slots) = &device.slots else { return Vec::new() };
    let found: Found<'_> = pdos.iter().map(|pdo| (pdo.index, &pdo.entries[..])).collect();
    let explained = |placed: &[PlacedModule<'_>]| -> usize {
        placed.iter().filter_map(|one| pdos_there(one, &found)).map(|there| there.len()).sum()
    };
    let (by_ident, by_pdos) = (by_ident(esi, slots, idents), by_pdos(esi, slots, &found));
    if !by_ident.is_empty() && explained(&by_ident) >= explained(&by_pdos) { by_ident } else { by_pdos }
}

fn by_ident<'a>(esi: &'a Esi, slots: &'a Slots, idents: &[u32]) -> Vec<PlacedModule<'a>> {
    let place = |(number, (slot, ident)): (u16, (&'a Slot, &u32))| {
        let module = esi.modules.iter().find(|module| module.ident == *ident && fits(esi, slot, module))?;
        Some(PlacedModule::new(slots, number, slot, module))
    };
    let filled = definitions(slots).map(|(slot, _)| slot).zip(idents);
    (0..).zip(filled).filter(|(_, (_, ident))| **ident != 0).filter_map(place).collect()
}

/// In each slot the module with the most PDOs that are there, if it is the only one. A PDO belongs to one slot.
fn by_pdos<'a>(esi: &'a Esi, slots: &'a Slots, found: &Found<'_>) -> Vec<PlacedModule<'a>> {
    let mut owned: HashSet<u16> = HashSet::new();
    let mut placed = Vec::new();
    for (number, (slot, _)) in (0..).zip(definitions(slots)) {
        let mut best: Option<(PlacedModule<'a>, Vec<u16>)> = None;
        let mut is_only = true;
        for module in esi.modules.iter().filter(|module| fits(esi, slot, module)) {
            let one = PlacedModule::new(slots, number, slot, module);
            let Some(there) = pdos_there(&one, found).filter(|there| !there.is_empty()) else { continue };
            let before = best.as_ref().map_or(0, |(_, there)| there.len());
            if there.len() > before {
                (best, is_only) = (Some((one, there)), true);
            } else if there.len() == before {
                is_only = false;
            }
        }
        if let Some((one, there)) = best.filter(|(_, there)| is_only && !there.iter().any(|pdo| owned.contains(pdo))) {
            owned.extend(there);
            placed.push(one);
        }
    }
    placed
}

/// The PDOs of a module that the device has in this slot; `None` where one of them has other entries.
fn pdos_there(one: &PlacedModule<'_>, found: &Found<'_>) -> Option<Vec<u16>> {
    let Module { rx_pdos, tx_pdos, .. } = one.module;
    let mut there = Vec::new();
    for pdo in rx_pdos.iter().chain(tx_pdos) {
        let index = one.index(pdo.index)?;
        if let Some(entries) = found.get(&index) {
            if !has_entries(one, pdo, entries) {
                return None;
            }
            there.push(index);
        }
    }
    Some(there)
}

fn has_entries(one: &PlacedModule<'_>, pdo: &Pdo, found: &[PdoEntryInfo]) -> bool {
    let is_same = |(described, entry): (&PdoEntry, &PdoEntryInfo)| {
        one.index(described.index) == Some(entry.index)
            && described.bit_length == u16::from(entry.bit_length)
            && (entry.index == 0 || described.sub_index == entry.sub_index)
    };
    // An entry that is longer is several entries of a device.
    let is_long = pdo.entries.iter().any(|entry| entry.bit_length > u8::MAX.into());
    is_long || pdo.entries.len() == found.len() && pdo.entries.iter().zip(found).all(is_same)
}
