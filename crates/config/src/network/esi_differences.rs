//! Where a SubDevice as the bus shows it (its EEPROM, or its dictionary in PREOP) and its description disagree. The
//! device has priority: a file does not change its contents (docs/sources.md).

use std::collections::BTreeMap;

use ringcat_engine::info::SubDeviceInfo;

use super::model::{Buffer, Entry, Pdo, SubDevice};
use crate::esi::{self, Device, PlacedModule, SyncManagerRole};

impl SubDevice {
    /// The differences to a description, each once: its revision, mailboxes, SyncManagers and operation modes of the
    /// clock, entries of PDOs, PDOs that only one of them assigns. `info` is what the scan found, `modules` are those
    /// in the slots. A SubDevice with slots may have PDOs of unknown modules.
    pub fn differences_to_esi(
        &self,
        device: &Device,
        info: &SubDeviceInfo,
        modules: &[PlacedModule<'_>],
    ) -> Vec<String> {
        let mut differences = Vec::new();
        if let Some(revision) = self.revision.filter(|revision| *revision != device.revision) {
            let described = device.revision;
            differences.push(format!("revision {revision:#010x}, the description is of {described:#010x}"));
        }
        if let Some(mailbox) = &self.mailbox {
            for (name, buffer, role) in [
                ("written", mailbox.write, SyncManagerRole::MailboxOut),
                ("read", mailbox.read, SyncManagerRole::MailboxIn),
            ] {
                differences.extend(of_mailbox(name, buffer, device, role));
            }
        }
        differences.extend(of_sync_managers(info, device));
        differences.extend(of_modes(info, device));
        self.of_pdos(device, modules, &mut differences);
        differences
    }

    fn of_pdos(&self, device: &Device, modules: &[PlacedModule<'_>], differences: &mut Vec<String>) {
        let described = described_pdos(device, modules);
        let mut own = BTreeMap::new();
        for (sm, pdo) in self.sync_manager.iter().flat_map(|sm| sm.pdo.iter().map(move |pdo| (sm.number, pdo))) {
            own.insert(pdo.index, sm);
            match described.get(&pdo.index) {
                Some(described) => differences.extend(of_pdo(pdo, sm, described)),
                None if device.slots.is_some() => {}
                None => differences.push(format!("PDO {:#06x} of SM {sm} is not in the description", pdo.index)),
            }
        }
        // Without process data at all its EEPROM contradicts itself.
        for (index, described) in described.iter().filter(|_| !self.sync_manager.is_empty()) {
            if let Some(number) = described.pdo.sync_manager.filter(|_| !described.pdo.is_virtual)
                && !own.contains_key(index)
            {
                differences.push(format!("PDO {index:#06x} is not assigned, in the description it is, to SM {number}"));
            }
        }
    }
}

/// A PDO that both have: its first entry that differs, its SyncManager. The modules of a SubDevice are found by their
/// entries, and may leave the SyncManager open.
fn of_pdo(pdo: &Pdo, sm: u8, described: &Described<'_>) -> Vec<String> {
    if described.is_of_module {
        return Vec::new();
    }
    let index = pdo.index;
    let entries = pdo.entries.as_ref().and_then(|entries| of_entries(entries, &described.pdo.entries));
    let of_entries = entries.map(|difference| format!("PDO {index:#06x}: {difference}"));
    let assigned = match described.pdo.sync_manager {
        Some(number) if number == sm => None,
        Some(number) => Some(format!("PDO {index:#06x} is assigned to SM {sm}, in the description to SM {number}")),
        None => Some(format!("PDO {index:#06x} is assigned to SM {sm}, in the description it is not")),
    };
    of_entries.into_iter().chain(assigned).collect()
}

/// A PDO of a description.
struct Described<'a> {
    pdo: &'a esi::Pdo,
    /// It is of a module: the objects of its entries shift with the slot.
    is_of_module: bool,
}

/// The PDOs of the device and of its modules by their index in the device.
fn described_pdos<'a>(device: &'a Device, modules: &[PlacedModule<'a>]) -> BTreeMap<u16, Described<'a>> {
    let own = device.rx_pdos.iter().chain(&device.tx_pdos);
    let mut described: BTreeMap<u16, Described<'a>> =
        own.map(|pdo| (pdo.index.index, Described { pdo, is_of_module: false })).collect();
    for one in modules {
        for pdo in one.module.rx_pdos.iter().chain(&one.module.tx_pdos) {
            let of_module = Described { pdo, is_of_module: true };
            described.extend(one.index(pdo.index).map(|index| (index, of_module)));
        }
    }
    described
}

/// SyncManagers of process data: address, control byte, length.
fn of_sync_managers(info: &SubDeviceInfo, device: &Device) -> Vec<String> {
    let mut differences = Vec::new();
    let mut add = |text: String| differences.push(text);
    for (number, described) in device.sync_managers.iter().enumerate() {
        let is_of_process_data = matches!(described.role, SyncManagerRole::Outputs | SyncManagerRole::Inputs);
        if !is_of_process_data || info.sync_managers.is_empty() {
            continue;
        }
        let Some(own) = info.sync_managers.get(number) else {
            add(format!("SM {number} is only in the description"));
            continue;
        };
        if let Some(start) = described.start.filter(|start| *start != own.start) {
            add(format!("SM {number} at {:#06x}, in the description at {start:#06x}", own.start));
        }
        if let Some(control) = described.control.filter(|control| *control != own.control) {
            add(format!("control byte {:#04x} of SM {number}, in the description {control:#04x}", own.control));
        }
        if let Some(length) = described.default_size.filter(|length| *length != own.length) {
            add(format!("{} bytes of SM {number} by default, in the description {length}", own.length));
        }
    }
    let count = device.sync_managers.len();
    if count > 0 && info.sync_managers.len() > count {
        add(format!("{} SyncManagers, in the description {count}", info.sync_managers.len()));
    }
    differences
}

/// Operation modes of the clock, where the SII has them.
fn of_modes(info: &SubDeviceInfo, device: &Device) -> Vec<String> {
    let described = device.clock.as_ref().map(|clock| &clock.modes[..]).unwrap_or_default();
    if info.dc_modes.is_empty() {
        return Vec::new();
    }
    if info.dc_modes.len() != described.len() {
        let (own, count) = (info.dc_modes.len(), described.len());
        return vec![format!("{own} operation modes of the clock, in the description {count}")];
    }
    let pairs = (1..).zip(info.dc_modes.iter().zip(described));
    let differs = pairs.filter(|(_, (own, described))| own.assign_activate != described.assign_activate);
    let text = |(number, (own, described)): (i32, (&ringcat_wire::sii::DcMode, &esi::OpMode))| {
        let (own, said) = (own.assign_activate, described.assign_activate);
        format!("AssignActivate {own:#06x} of operation mode {number}, in the description {said:#06x}")
    };
    differs.map(text).collect()
}

fn of_mailbox(name: &str, buffer: Buffer, device: &Device, role: SyncManagerRole) -> Option<String> {
    let described = device.sync_managers.iter().find(|it| it.role == role)?;
    let (start, length) = (described.start?, described.default_size?);
    let differs = (buffer.start, buffer.length) != (start, length);
    differs.then(|| {
        let Buffer { start: own, length: bytes } = buffer;
        format!("{bytes} bytes of {name} mailbox at {own:#06x}, in the description {length} at {start:#06x}")
    })
}

/// The first entry that differs.
fn of_entries(entries: &[Entry], described: &[esi::PdoEntry]) -> Option<String> {
    // Entries that are longer than 255 bits are split in a declaration.
    if described.iter().any(|it| it.bit_length > u8::MAX.into()) {
        return None;
    }
    let own = entries.iter().map(|it| (it.index, it.sub, u16::from(it.bits)));
    let own: Vec<_> = own.collect();
    let theirs: Vec<_> = described.iter().map(|it| (it.index.index, it.sub_index, it.bit_length)).collect();
    let length = own.len().max(theirs.len());
    let first = (0..length).find(|at| own.get(*at) != theirs.get(*at))?;
    let shown = |entry: Option<&(u16, u8, u16)>| match entry {
        Some((0, _, bits)) => format!("a gap of {bits} bits"),
        Some((index, sub, bits)) => format!("{index:#06x}:{sub:02x} with {bits} bits"),
        None => "none".to_owned(),
    };
    let (number, got, said) = (first + 1, shown(own.get(first)), shown(theirs.get(first)));
    Some(format!("entry {number} is {got}, in the description {said}"))
}
