//! Checks the configuration written by the MainDevice (protocol 5.2), with codes of protocol 5.5.
//!
//! Input: SyncManager, watchdog and clock registers through the PDI, the description, the dictionary (its PDO
//! assignment defines the lengths). Output: the process data areas, or the AL status code of the refusal.

use ringcat_wire::address::RegisterAddress;
use ringcat_wire::al::AlStatusCode;
use ringcat_wire::register::{SyncManager, SyncManagerControl, SyncManagerDirection, SyncManagerMode, map};
use ringcat_wire::sii::{MailboxLayout, SiiSyncManager, SyncManagerKind};

use super::dictionary::Dictionary;
use crate::controller::Controller;
use crate::description::DeviceDescription;
use crate::time::SimTime;

/// Number of SyncManagers checked; no controller has more (protocol 3.1).
pub const MAX_SYNC_MANAGERS: u8 = 16;
/// First address of the process RAM; below it nothing is buffered.
const RAM_START: u32 = 0x1000;

/// The part of the process data in one SyncManager.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Area {
    /// Number of the SyncManager.
    pub sync_manager: u8,
    /// Physical start address.
    pub start: u16,
    /// Number of bytes.
    pub length: u16,
    /// Whether it raises an AL event.
    pub event: bool,
    /// Whether it retriggers the process data watchdog.
    pub watchdog: bool,
    /// Whether it has one buffer, as a mailbox: a read empties it, and only then it can be written again.
    pub one_buffer: bool,
}

/// Areas of outputs and inputs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Layout {
    /// Areas that EtherCAT writes.
    pub outputs: Vec<Area>,
    /// Areas that EtherCAT reads.
    pub inputs: Vec<Area>,
}

/// Reads all SyncManagers through the PDI, which also clears the event of a changed activation.
pub fn sync_managers(controller: &mut Controller, now: SimTime) -> Vec<SyncManager> {
    let mut found = Vec::new();
    for number in 0..controller.config().sync_manager_count.min(MAX_SYNC_MANAGERS) {
        let mut bytes = [0; SyncManager::LEN];
        controller.pdi_read(map::sync_manager(number), &mut bytes, now);
        found.push(SyncManager::decode(&bytes));
    }
    found
}

/// Whether the mailbox SyncManagers match the layout (standard or bootstrap).
pub fn mailbox_matches(description: &DeviceDescription, layout: &MailboxLayout, actual: &[SyncManager]) -> bool {
    let (out, back) = mailbox_numbers(description, layout);
    let place = |number: u8| actual.get(usize::from(number));
    let matches = |number, start, length, direction| {
        place(number).is_some_and(|manager: &SyncManager| {
            manager.activate.enable
                && manager.start == start
                && manager.length == length
                && manager.control.mode == SyncManagerMode::Mailbox
                && manager.control.direction == direction
        })
    };
    matches(out, layout.receive_offset, layout.receive_size, SyncManagerDirection::Write)
        && matches(back, layout.send_offset, layout.send_size, SyncManagerDirection::Read)
}

/// Numbers of the SyncManagers of mailboxes with this layout: to the device, from the device. These are the
/// SyncManagers at the mailbox addresses if there are any, as for BOOT, otherwise the first ones.
pub fn mailbox_numbers(description: &DeviceDescription, layout: &MailboxLayout) -> (u8, u8) {
    let of = |kind, start| {
        let at_place = description.sync_managers.iter().position(|entry| (entry.kind, entry.start) == (kind, start));
        at_place.and_then(|place| u8::try_from(place).ok()).or_else(|| description.sync_manager_of(kind))
    };
    let out = of(SyncManagerKind::MailboxOut, layout.receive_offset);
    out.zip(of(SyncManagerKind::MailboxIn, layout.send_offset)).unwrap_or((0, 1))
}

/// Checks the SyncManagers of the process data and returns their areas. A SyncManager for OP only may be disabled.
pub fn process_data(
    description: &DeviceDescription,
    dictionary: &Dictionary,
    actual: &[SyncManager],
    ram_kib: u8,
) -> Result<Layout, AlStatusCode> {
    if !modules_match(dictionary) {
        return Err(AlStatusCode::MODULES_DO_NOT_MATCH);
    }
    let mut layout = Layout::default();
    for (number, entry) in (0u8..).zip(&description.sync_managers) {
        let (areas, direction, wrong, wrong_mapping) = match entry.kind {
            SyncManagerKind::Outputs => (
                &mut layout.outputs,
                SyncManagerDirection::Write,
                AlStatusCode::INVALID_OUTPUT_CONFIGURATION,
                AlStatusCode::INVALID_OUTPUT_MAPPING,
            ),
            SyncManagerKind::Inputs => (
                &mut layout.inputs,
                SyncManagerDirection::Read,
                AlStatusCode::INVALID_INPUT_CONFIGURATION,
                AlStatusCode::INVALID_INPUT_MAPPING,
            ),
            SyncManagerKind::Unused
            | SyncManagerKind::MailboxOut
            | SyncManagerKind::MailboxIn
            | SyncManagerKind::Other(_) => continue,
        };
        // A virtual SyncManager has no hardware.
        if entry.enable & SiiSyncManager::VIRTUAL != 0 {
            continue;
        }
        if assigned_twice(dictionary, number) {
            return Err(wrong_mapping);
        }
        let manager = actual.get(usize::from(number)).copied().unwrap_or_default();
        let running = manager.activate.enable && manager.length != 0;
        let expected = expected_length(description, dictionary, number);
        if !running && (expected == 0 || entry.enable & SiiSyncManager::OP_ONLY != 0) {
            continue;
        }
        if !running || manager.start != entry.start || u32::from(manager.length) != expected {
            return Err(wrong);
        }
        // Three buffers; one as well, if the EEPROM says so.
        let modes = [SyncManagerMode::Buffered, SyncManagerControl::from_bits(entry.control).mode];
        if !modes.contains(&manager.control.mode) || manager.control.direction != direction {
            return Err(AlStatusCode::INVALID_SYNC_MANAGER_TYPES);
        }
        areas.push(area(number, &manager));
    }
    if overlap(actual, ram_kib) {
        return Err(AlStatusCode::INVALID_SYNC_MANAGER_CONFIGURATION);
    }
    Ok(layout)
}

/// Areas of the process data of a device without checks: the current settings of the SyncManagers.
pub fn unchecked(description: &DeviceDescription, actual: &[SyncManager]) -> Layout {
    let mut layout = Layout::default();
    for (number, (entry, manager)) in (0u8..).zip(description.sync_managers.iter().zip(actual)) {
        if !manager.activate.enable || manager.length == 0 {
            continue;
        }
        match entry.kind {
            SyncManagerKind::Outputs => layout.outputs.push(area(number, manager)),
            SyncManagerKind::Inputs => layout.inputs.push(area(number, manager)),
            SyncManagerKind::Unused
            | SyncManagerKind::MailboxOut
            | SyncManagerKind::MailboxIn
            | SyncManagerKind::Other(_) => {}
        }
    }
    layout
}

fn area(number: u8, manager: &SyncManager) -> Area {
    Area {
        sync_manager: number,
        start: manager.start,
        length: manager.length,
        event: manager.control.pdi_event,
        watchdog: manager.control.watchdog,
        one_buffer: manager.control.mode == SyncManagerMode::Mailbox,
    }
}

/// Required length of a SyncManager: with CoE the length of the assigned PDOs, otherwise that of the SII.
fn expected_length(description: &DeviceDescription, dictionary: &Dictionary, number: u8) -> u32 {
    if description.has_coe() {
        return dictionary.assigned_bits(number).div_ceil(8);
    }
    u32::from(description.default_length(number))
}

/// Whether the list of modules that was written is that of the detected ones; a list without idents does not count
/// (ES-69).
fn modules_match(dictionary: &Dictionary) -> bool {
    const CONFIGURED: u16 = 0xF030;
    const DETECTED: u16 = 0xF050;
    let list = |index: u16| -> Vec<u64> {
        let entries = || dictionary.numbers(index..=index);
        let count = entries().find(|(_, sub, _)| *sub == 0).map_or(0, |(.., count)| count);
        entries().filter(|(_, sub, _)| (1..=count).contains(&u64::from(*sub))).map(|(.., ident)| ident).collect()
    };
    let configured = list(CONFIGURED);
    configured.iter().all(|ident| *ident == 0) || configured == list(DETECTED)
}

fn assigned_twice(dictionary: &Dictionary, number: u8) -> bool {
    let assigned: Vec<u16> = dictionary.assigned(number).collect();
    assigned.iter().enumerate().any(|(place, pdo)| assigned[..place].contains(pdo))
}

/// Whether two SyncManagers share a byte, or one exceeds the memory. Three-buffer mode uses three times the length.
fn overlap(actual: &[SyncManager], ram_kib: u8) -> bool {
    let memory_end = RAM_START + u32::from(ram_kib) * 1024;
    let ranges: Vec<(u32, u32)> = actual
        .iter()
        .filter(|manager| manager.activate.enable && manager.length != 0)
        .map(|manager| {
            let start = u32::from(manager.start);
            let buffered = manager.control.mode == SyncManagerMode::Buffered;
            let buffers = if buffered && manager.length > 1 && start >= RAM_START { 3 } else { 1 };
            (start, start + u32::from(manager.length) * buffers)
        })
        .collect();
    let outside = ranges.iter().any(|(_, end)| *end > memory_end);
    let shared = ranges.iter().enumerate().any(|(place, (start, end))| {
        ranges[..place].iter().any(|(other_start, other_end)| start < other_end && other_start < end)
    });
    outside || shared
}

/// Checks watchdog and clock settings (0x001F, 0x0030, 0x0035).
pub fn timing(
    description: &DeviceDescription,
    layout: &Layout,
    controller: &mut Controller,
    now: SimTime,
) -> Result<Option<u32>, AlStatusCode> {
    if description.watchdog_required && !layout.outputs.is_empty() {
        let time = read_u16(controller, map::WATCHDOG_TIME_PROCESS_DATA, now);
        if time == 0 || layout.outputs.iter().all(|area| !area.watchdog) {
            return Err(AlStatusCode::INVALID_WATCHDOG_CONFIGURATION);
        }
    }
    let Some(dc) = &description.dc else {
        return Ok(None);
    };
    let mut activation = [0];
    controller.pdi_read(map::DC_ACTIVATION, &mut activation, now);
    // Cyclic unit and the two SYNC signals.
    let signals = activation[0] & 0x07;
    if signals == 0 {
        return Ok(None);
    }
    if !dc.modes.iter().any(|mode| mode.assign_activate.to_le_bytes()[1] & 0x07 == signals) {
        return Err(AlStatusCode::INVALID_DC_SYNC_CONFIGURATION);
    }
    let mut cycle = [0; 4];
    controller.pdi_read(map::DC_SYNC0_CYCLE, &mut cycle, now);
    let cycle_ns = u32::from_le_bytes(cycle);
    // Latch units alone need no cycle (ES-60).
    let has_signals = signals & 0x06 != 0;
    if has_signals && (cycle_ns == 0 || cycle_ns < dc.minimum_cycle_ns) {
        return Err(AlStatusCode::DC_INVALID_SYNC_CYCLE_TIME);
    }
    Ok(has_signals.then_some(cycle_ns))
}

/// A 16-bit register through the PDI.
pub fn read_u16(controller: &mut Controller, address: RegisterAddress, now: SimTime) -> u16 {
    let mut bytes = [0; 2];
    controller.pdi_read(address, &mut bytes, now);
    u16::from_le_bytes(bytes)
}
