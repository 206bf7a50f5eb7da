//! Devices with one buffer for each area of process data, as for mailboxes: a SyncManager that is written is full until
//! the device has read it, and one that is read is empty until the device has written it (protocol 3.11).
//!
//! In: descriptions, what a scan found. Out: descriptions with one buffer, and declarations that write the SyncManagers
//! as the SII has them. A MainDevice gives process data three buffers unless the application declares other ones.

use std::time::Duration;

use ringcat::{Declaration, DeclaredSyncManager, SubDeviceConfig, SubDeviceInfo, SyncManagerRole};
use ringcat_sim::description::DeviceDescription;
use ringcat_wire::register::{SyncManager, SyncManagerControl, SyncManagerMode};
use ringcat_wire::sii::{SiiSyncManager, SyncManagerKind};

/// Bits of the mode in a control byte, and their value for one buffer.
const MODE: u8 = 0b11;
const ONE_BUFFER: u8 = 0b10;

/// Set in the revision of a device with one buffer: another EEPROM is another revision. A MainDevice reads what
/// SubDevices of one revision share only once.
const REVISION: u32 = 0x0B00_0000;

/// The same device with one buffer for each area, as a revision of its own.
pub fn one_buffer(mut description: DeviceDescription) -> DeviceDescription {
    let of_process_data = |kind| matches!(kind, SyncManagerKind::Outputs | SyncManagerKind::Inputs);
    for entry in description.sync_managers.iter_mut().filter(|entry| of_process_data(entry.kind)) {
        entry.control = entry.control & !MODE | ONE_BUFFER;
    }
    description.identity.revision |= REVISION;
    description
}

/// As [`ringcat::automatic`]; SubDevices with one buffer keep it.
pub fn automatic(subdevices: &[SubDeviceInfo], period: Duration) -> Declaration {
    let mut declaration = Declaration::new(period);
    for info in subdevices {
        let config = SubDeviceConfig::from_info(info);
        let has_one = info.sync_managers.iter().any(|sm| role(sm).is_some_and(is_process_data) && has_one_buffer(sm));
        declaration.add(if has_one { config.declared(as_in_sii(info)) } else { config });
    }
    declaration
}

fn has_one_buffer(sm: &SiiSyncManager) -> bool {
    SyncManagerControl::from_bits(sm.control).mode == SyncManagerMode::Mailbox
}

fn is_process_data(role: SyncManagerRole) -> bool {
    role.direction().is_some()
}

fn role(sm: &SiiSyncManager) -> Option<SyncManagerRole> {
    match sm.kind {
        SyncManagerKind::MailboxOut => Some(SyncManagerRole::MailboxOut),
        SyncManagerKind::MailboxIn => Some(SyncManagerRole::MailboxIn),
        SyncManagerKind::Outputs => Some(SyncManagerRole::Outputs),
        SyncManagerKind::Inputs => Some(SyncManagerRole::Inputs),
        SyncManagerKind::Unused | SyncManagerKind::Other(_) => None,
    }
}

fn as_in_sii(info: &SubDeviceInfo) -> Vec<DeclaredSyncManager> {
    let numbered = (0u8..).zip(&info.sync_managers);
    numbered
        .filter_map(|(index, sm)| {
            let control = SyncManagerControl::from_bits(sm.control);
            let mut register = SyncManager { start: sm.start, length: sm.length, control, ..SyncManager::default() };
            register.activate.enable = sm.length > 0;
            Some(DeclaredSyncManager::new(index, role(sm)?, register))
        })
        .collect()
}
