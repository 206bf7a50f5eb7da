//! Pieces that the devices of the catalogue share.

use core::time::Duration;

use ringcat_wire::register::PortKind;
use ringcat_wire::sii::{CoeDetails, MailboxLayout, MailboxProtocols, PdoDirection, SyncManagerKind};

use crate::application::dictionary::{Access, Entry, Object, ObjectRole};
use crate::description::{MailboxDescription, PdoDescription, PdoEntryDescription, SyncManagerDescription, data_type};

/// SyncManager enable byte: to be activated.
pub const ENABLE: u8 = 0x01;
/// Flags of a PDO whose content is fixed and which must be there.
pub const FIXED_MANDATORY: u16 = 0x0011;
/// Flags of a PDO that may be changed.
pub const FLEXIBLE: u16 = 0x0000;
/// Two E-bus ports.
pub const EBUS_PORTS: [PortKind; 4] =
    [PortKind::Ebus, PortKind::Ebus, PortKind::NotImplemented, PortKind::NotImplemented];

const MAILBOX_START: u16 = 0x1000;
const MAILBOX_SIZE: u16 = 128;
/// Behind the two mailboxes.
pub const OUTPUTS_START: u16 = MAILBOX_START + 2 * MAILBOX_SIZE;

/// A SyncManager.
pub const fn sync_manager(start: u16, length: u16, control: u8, kind: SyncManagerKind) -> SyncManagerDescription {
    let enable = if length == 0 { 0 } else { ENABLE };
    SyncManagerDescription { start, length, control, enable, kind }
}

/// SyncManagers of a device with mailbox: two mailboxes, outputs, inputs (facts 3.11).
pub fn four_sync_managers(
    outputs: u16,
    outputs_control: u8,
    inputs_start: u16,
    inputs: u16,
) -> Vec<SyncManagerDescription> {
    vec![
        sync_manager(MAILBOX_START, MAILBOX_SIZE, 0x26, SyncManagerKind::MailboxOut),
        sync_manager(MAILBOX_START + MAILBOX_SIZE, MAILBOX_SIZE, 0x22, SyncManagerKind::MailboxIn),
        sync_manager(OUTPUTS_START, outputs, outputs_control, SyncManagerKind::Outputs),
        sync_manager(inputs_start, inputs, 0x20, SyncManagerKind::Inputs),
    ]
}

/// A mailbox with CoE.
pub fn coe_mailbox(details: u8) -> MailboxDescription {
    MailboxDescription {
        standard: MailboxLayout {
            receive_offset: MAILBOX_START,
            receive_size: MAILBOX_SIZE,
            send_offset: MAILBOX_START + MAILBOX_SIZE,
            send_size: MAILBOX_SIZE,
        },
        bootstrap: MailboxLayout::default(),
        protocols: MailboxProtocols(MailboxProtocols::COE),
        coe_details: CoeDetails(CoeDetails::SDO | details),
        response_time: Duration::from_micros(200),
    }
}

/// A PDO entry.
pub fn entry(index: u16, sub_index: u8, name: &str, data_type: u8, bit_length: u8) -> PdoEntryDescription {
    PdoEntryDescription { index, sub_index, name: name.into(), data_type, bit_length }
}

/// A PDO.
pub fn pdo(
    direction: PdoDirection,
    index: u16,
    name: &str,
    sync_manager: Option<u8>,
    flags: u16,
    entries: Vec<PdoEntryDescription>,
) -> PdoDescription {
    PdoDescription { direction, index, name: name.into(), sync_manager, flags, entries }
}

/// Settings of one channel: a record with a number that can be written and a text too long for an expedited transfer.
pub fn channel_settings(index: u16) -> Object {
    let entries = vec![
        Entry::new(0, data_type::U8, Access::ReadOnly, &[3]),
        Entry::new(1, data_type::U16, Access::ReadWrite, &0u16.to_le_bytes()),
        Entry::new(2, data_type::U32, Access::ReadWritePreOp, &50_000u32.to_le_bytes()),
        Entry::new(3, data_type::VISIBLE_STRING, Access::ReadWrite, b"channel text 16b"),
    ];
    Object { index, name: "Settings".into(), role: ObjectRole::Plain, entries }
}
