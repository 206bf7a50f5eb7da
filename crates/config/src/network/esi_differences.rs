//! Where a SubDevice as the bus shows it (its EEPROM, or its dictionary in PREOP) and its description disagree. The
//! device has priority: a file does not change its contents (docs/sources.md).

use super::model::{Buffer, Entry, SubDevice};
use crate::esi::{self, Device, SyncManagerRole};

/// Entries of a description that are longer are split in a network file.
const ENTRY_BITS: u16 = 248;

impl SubDevice {
    /// The differences to a description, each once: its revision, mailboxes, entries of PDOs that both have. PDOs that
    /// only one of them has are none: modules and choices decide which there are.
    pub fn differences_to_esi(&self, device: &Device) -> Vec<String> {
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
        for pdo in self.sync_manager.iter().flat_map(|sm| &sm.pdo) {
            let described = device.rx_pdos.iter().chain(&device.tx_pdos).find(|it| it.index.index == pdo.index);
            if let (Some(entries), Some(described)) = (&pdo.entries, described)
                && let Some(difference) = of_entries(entries, &described.entries)
            {
                differences.push(format!("PDO {:#06x}: {difference}", pdo.index));
            }
        }
        differences
    }
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
    if described.iter().any(|it| it.bit_length > ENTRY_BITS) {
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
