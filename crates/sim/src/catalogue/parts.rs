//! Parts shared by the devices of the catalogue.

use core::time::Duration;

use ringcat_wire::mailbox::coe::AccessRights;
use ringcat_wire::register::PortKind;
use ringcat_wire::sii::{CoeDetails, MailboxLayout, MailboxProtocols, PdoDirection, SyncManagerKind};

use crate::application::dictionary::{Access, Entry, Object, SyncParameters};
use crate::description::{MailboxDescription, PdoDescription, PdoEntryDescription, SyncManagerDescription, data_type};

/// SyncManager enable byte: activate.
pub const ENABLE: u8 = 0x01;
/// Flags of a mandatory PDO with fixed content.
pub const FIXED_MANDATORY: u16 = 0x0011;
/// Flags of a PDO that can be changed.
pub const FLEXIBLE: u16 = 0x0000;
/// Two E-bus ports.
pub const EBUS_PORTS: [PortKind; 4] =
    [PortKind::Ebus, PortKind::Ebus, PortKind::NotImplemented, PortKind::NotImplemented];

/// Units of ETG.1004: prefix and unit.
pub const MILLISECONDS: u16 = 0xFD03;
const NANOSECONDS: u16 = 0xF703;

const MAILBOX_START: u16 = 0x1000;
const MAILBOX_SIZE: u16 = 128;
/// First address after the two mailboxes.
pub const OUTPUTS_START: u16 = MAILBOX_START + 2 * MAILBOX_SIZE;

/// A SyncManager.
pub const fn sync_manager(start: u16, length: u16, control: u8, kind: SyncManagerKind) -> SyncManagerDescription {
    let enable = if length == 0 { 0 } else { ENABLE };
    SyncManagerDescription { start, length, control, enable, kind }
}

/// SyncManagers of a device with mailbox: two mailboxes, outputs, inputs (protocol 3.11).
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

/// Settings of one channel: a record with a writable number and a text too long for an expedited transfer.
pub fn channel_settings(index: u16) -> Object {
    let entries = vec![
        Entry::new(1, data_type::U16, Access::ReadWrite, &0u16.to_le_bytes()).named("User value"),
        Entry::new(2, data_type::U32, Access::ReadWritePreOp, &50_000u32.to_le_bytes()).named("User time"),
        Entry::new(3, data_type::VISIBLE_STRING, Access::ReadWrite, b"channel text 16b").named("User text"),
    ];
    let entries = entries.into_iter().map(|entry| entry.allow(AccessRights::SETTING)).collect();
    Object::record(index, "Settings", entries)
}

/// Synchronisation of a SyncManager (ETG.1020): free run or SyncManager event, and optionally SYNC0. The MainDevice
/// sets type and cycle, or the device takes them from the distributed clocks when SAFEOP is entered.
pub fn sync_parameters(index: u16, name: &str, minimum_cycle_ns: u32, sync0: bool) -> Object {
    let sync0 = if sync0 { SyncParameters::SYNC0 } else { 0 };
    let types = SyncParameters::FREE_RUN | SyncParameters::SYNCHRONOUS | sync0;
    let time = |sub_index, access, ns: u32, name: &str| {
        Entry::new(sub_index, data_type::U32, access, &ns.to_le_bytes()).named(name).in_unit(NANOSECONDS)
    };
    let entries = vec![
        Entry::new(SyncParameters::TYPE, data_type::U16, Access::ReadWrite, &[1, 0])
            .named("Synchronization type")
            .one_of(&[0, 1, 2, 0x22]),
        time(SyncParameters::CYCLE, Access::ReadWrite, 0, "Cycle time"),
        Entry::new(4, data_type::U16, Access::ReadOnly, &types.to_le_bytes()).named("Synchronization types supported"),
        time(5, Access::ReadOnly, minimum_cycle_ns, "Minimum cycle time"),
        time(6, Access::ReadOnly, 0, "Calc and copy time"),
        time(9, Access::ReadOnly, 0, "Delay time"),
        time(SyncParameters::SYNC0_CYCLE, Access::ReadOnly, 0, "Sync0 cycle time"),
    ];
    Object::record(index, name, entries)
}

/// Vendor number of the simulated devices; it is not assigned to any vendor.
pub const VENDOR_ID: u32 = 0x0000_0C47;
