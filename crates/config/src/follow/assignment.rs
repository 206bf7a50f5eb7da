//! PDO assignment and mapping of a file without commands for SyncManagers: the objects written by its CoE commands
//! define the length of process data (protocol 6.3: 0x1C10 + n, 0x1600 to 0x17FF, 0x1A00 to 0x1BFF).

use std::collections::BTreeMap;

use ringcat_engine::config::{PdoAssignment, PdoEntry, PdoMapping};
use ringcat_engine::info::Direction;
use ringcat_wire::mailbox::coe::pdo_objects::{ASSIGNMENT_BASE, RX_MAPPINGS, TX_MAPPINGS};

use crate::eni::{CoeCommand, Pdo, SubDevice, Transition};

/// SyncManagers with an assignment: 0 and 1 are mailboxes.
const ASSIGNED: std::ops::RangeInclusive<u16> = 0x1C12..=0x1C1F;

/// Maximum number of bits and entries of a PDO: data bytes of a datagram, subindices of an object.
const PDO_BITS: u64 = 1486 * 8;
const PDO_ENTRIES: usize = 255;

/// An object after all commands; subindex 0 is the number of entries.
#[derive(Debug, Default)]
struct Object {
    values: BTreeMap<u8, u32>,
}

impl Object {
    fn write(&mut self, command: &CoeCommand, width: usize) {
        let value = |bytes: &[u8]| bytes.iter().rev().fold(0, |value, byte| value << 8 | u32::from(*byte));
        if !command.complete_access {
            let data = command.data.get(..command.data.len().min(4)).unwrap_or_default();
            self.values.insert(command.sub_index, value(data));
            return;
        }
        // With complete access, subindex 0 has 16 bits; it is missing if the command starts at subindex 1.
        let (count, rest) = match command.sub_index {
            0 => command.data.split_at(command.data.len().min(2)),
            _ => (&[][..], &command.data[..]),
        };
        if let Some(count) = count.first() {
            self.values.insert(0, u32::from(*count));
        }
        for (sub_index, bytes) in (1..=u8::MAX).zip(rest.chunks_exact(width)) {
            self.values.insert(sub_index, value(bytes));
        }
    }

    /// The valid entries; `None` if an entry was never written.
    fn list(&self) -> Option<Vec<u32>> {
        let count = u8::try_from(*self.values.get(&0)?).ok()?;
        (1..=count).map(|sub_index| self.values.get(&sub_index).copied()).collect()
    }
}

/// The assignments written by the commands on the way to SAFEOP; `None` if there are none.
pub(super) fn of_commands(subdevice: &SubDevice, is_reversed: bool) -> Option<Vec<PdoAssignment>> {
    let commands = &subdevice.mailbox.as_ref()?.coe;
    let mut objects: BTreeMap<u16, Object> = BTreeMap::new();
    for transition in [Transition::Ip, Transition::Ps] {
        let sent = commands.iter().filter(|command| {
            let downloads = (command.ccs == 1) != is_reversed;
            downloads && !command.disabled && command.transitions.contains(&transition)
        });
        for command in sent {
            let width = match command.index {
                index if ASSIGNED.contains(&index) => 2,
                index if RX_MAPPINGS.contains(&index) || TX_MAPPINGS.contains(&index) => 4,
                _ => continue,
            };
            objects.entry(command.index).or_default().write(command, width);
        }
    }
    let assignments: Vec<PdoAssignment> = objects
        .iter()
        .filter(|(index, _)| ASSIGNED.contains(index))
        .filter_map(|(index, object)| {
            let pdos: Vec<u16> = object.list()?.into_iter().map(|pdo| pdo as u16).collect();
            let direction = direction(*index, &pdos)?;
            let pdos = pdos.into_iter().map(|pdo| mapping(pdo, &objects, subdevice)).collect();
            Some(PdoAssignment::new((index - ASSIGNMENT_BASE) as u8, direction, pdos))
        })
        .collect();
    (!assignments.is_empty()).then_some(assignments)
}

/// The direction by the PDO numbers; without PDOs, by the usual direction of SyncManagers 2 and 3.
fn direction(index: u16, pdos: &[u16]) -> Option<Direction> {
    match pdos.first() {
        Some(pdo) if RX_MAPPINGS.contains(pdo) => Some(Direction::Outputs),
        Some(pdo) if TX_MAPPINGS.contains(pdo) => Some(Direction::Inputs),
        Some(_) | None if index == ASSIGNMENT_BASE + 2 => Some(Direction::Outputs),
        Some(_) | None if index == ASSIGNMENT_BASE + 3 => Some(Direction::Inputs),
        Some(_) | None => None,
    }
}

/// The entries written by commands, otherwise the entries in the file, otherwise those of the SII.
fn mapping(index: u16, objects: &BTreeMap<u16, Object>, subdevice: &SubDevice) -> PdoMapping {
    let written = objects.get(&index).and_then(Object::list);
    if let Some(values) = written {
        let entry = |value: u32| PdoEntry::new((value >> 16) as u16, (value >> 8) as u8, value as u8);
        return PdoMapping::of(index, values.into_iter().map(entry).collect::<Vec<_>>());
    }
    let described = subdevice.process_data.iter().flat_map(|data| &data.pdos).find(|pdo| pdo.index == index);
    let bits = |pdo: &Pdo| pdo.entries.iter().map(|entry| u64::from(entry.bit_length)).sum::<u64>();
    match described.filter(|pdo| (1..=PDO_BITS).contains(&bits(pdo)) && pdo.entries.len() <= PDO_ENTRIES) {
        Some(pdo) => {
            let entries = pdo.entries.iter().flat_map(super::sync_managers::entries);
            PdoMapping::of(index, entries.collect::<Vec<_>>())
        }
        None => PdoMapping::from_sii(index),
    }
}
