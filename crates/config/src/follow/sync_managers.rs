//! SyncManagers after all commands (protocol 3.11, 8.1): roles, mailboxes, PDOs of their areas.

use ringcat_engine::config::{DeclaredSyncManager, PdoEntry, PdoMapping, SyncManagerRole};
use ringcat_wire::register::{
    SyncManager, SyncManagerActivate, SyncManagerControl, SyncManagerDirection, SyncManagerMode, SyncManagerPdiControl,
    SyncManagerStatus,
};

use super::messages::contradiction;
use super::notices::Notices;
use super::registers::Registers;
use crate::eni::{Eni, EniError, MailboxBuffer, Place, ProcessData, SyncManagerKind, SyncManagerSettings, Transition};

/// Control bytes of mailboxes without a command that sets them (protocol 3.11): one buffer, event to the PDI.
const MAILBOX_OUT: u8 = 0x26;
const MAILBOX_IN: u8 = 0x22;
/// Bits of a piece of an entry that is longer than the 255 bits of one entry in the engine.
const PIECE_BITS: u16 = 248;

/// All SyncManagers of a SubDevice; `None`: use those of the SII.
pub(super) fn declared(
    eni: &Eni,
    index: usize,
    registers: &Registers,
    complete: bool,
    notices: &mut Notices,
) -> Result<Option<Vec<DeclaredSyncManager>>, EniError> {
    let nothing = ProcessData::default();
    let process_data = eni.subdevices[index].process_data.as_ref().unwrap_or(&nothing);
    let mut found: Vec<(DeclaredSyncManager, Place)> = Vec::new();
    if complete {
        for (number, register, place) in registers.sync_managers() {
            let settings = process_data.sync_managers.iter().find(|settings| settings.index == number);
            let role = role(settings, &register);
            check_direction(eni, index, number, role, &register, place)?;
            found.push((declare(number, role, register), place));
        }
    } else {
        for settings in &process_data.sync_managers {
            if let Some(one) = from_settings(settings, process_data) {
                found.push((one, settings.place));
            }
        }
        if found.is_empty() {
            return Ok(None);
        }
        let reason = "created from start, control byte and PDOs of the file: no commands set them";
        notices.add(Some(process_data.sync_managers[0].place), Some(index), "SyncManagers", reason);
    }
    mailboxes(eni, index, &mut found)?;
    let mut list = Vec::with_capacity(found.len());
    for (mut one, place) in found {
        one.pdos = match one.area() {
            None => Vec::new(),
            Some(area) if area.length == 0 => empty_pdos(&one, process_data),
            Some(_) => pdos(index, &one, process_data, place, notices),
        };
        list.push(one);
    }
    list.sort_by_key(|one| one.index);
    Ok(Some(list))
}

/// The declaration of a register value, without the bytes that the SubDevice sets.
fn declare(index: u8, role: SyncManagerRole, register: SyncManager) -> DeclaredSyncManager {
    let register =
        SyncManager { status: SyncManagerStatus::default(), pdi_control: SyncManagerPdiControl::default(), ..register };
    DeclaredSyncManager::new(index, role, register)
}

/// The role by `Type`; without it by the control byte.
fn role(settings: Option<&SyncManagerSettings>, register: &SyncManager) -> SyncManagerRole {
    let writes = register.control.direction == SyncManagerDirection::Write;
    match settings.and_then(|settings| settings.kind) {
        Some(SyncManagerKind::Outputs) => SyncManagerRole::Outputs,
        Some(SyncManagerKind::Inputs) => SyncManagerRole::Inputs,
        Some(SyncManagerKind::MailboxOut) => SyncManagerRole::MailboxOut,
        Some(SyncManagerKind::MailboxIn) => SyncManagerRole::MailboxIn,
        None => match (register.control.mode, writes) {
            (SyncManagerMode::Mailbox, true) => SyncManagerRole::MailboxOut,
            (SyncManagerMode::Mailbox, false) => SyncManagerRole::MailboxIn,
            (SyncManagerMode::Buffered | SyncManagerMode::Reserved(_), true) => SyncManagerRole::Outputs,
            (SyncManagerMode::Buffered | SyncManagerMode::Reserved(_), false) => SyncManagerRole::Inputs,
        },
    }
}

fn check_direction(
    eni: &Eni,
    index: usize,
    number: u8,
    role: SyncManagerRole,
    register: &SyncManager,
    place: Place,
) -> Result<(), EniError> {
    let expected = match role {
        SyncManagerRole::MailboxOut | SyncManagerRole::Outputs => SyncManagerDirection::Write,
        SyncManagerRole::MailboxIn | SyncManagerRole::Inputs => SyncManagerDirection::Read,
    };
    let got = register.control.direction;
    if got == expected || register.length == 0 || matches!(got, SyncManagerDirection::Reserved(_)) {
        return Ok(());
    }
    let what = format!("direction of SyncManager {number}");
    let in_words = |direction| match direction {
        SyncManagerDirection::Write => "Write".to_owned(),
        SyncManagerDirection::Read => "Read".to_owned(),
        SyncManagerDirection::Reserved(bits) => format!("reserved ({bits})"),
    };
    let expected = format!("{} (its Type)", in_words(expected));
    let hint = "Type in ProcessData and the control byte of the command must agree";
    Err(contradiction(eni, index, place, what, expected, in_words(got), hint))
}

/// A SyncManager from `Sm0` to `Sm15` alone.
fn from_settings(settings: &SyncManagerSettings, process_data: &ProcessData) -> Option<DeclaredSyncManager> {
    let (start, control) = (settings.start?, settings.control?);
    let mut register = SyncManager {
        start,
        control: SyncManagerControl::from_bits(control),
        activate: SyncManagerActivate { enable: settings.enable.unwrap_or(true), ..SyncManagerActivate::default() },
        ..SyncManager::default()
    };
    let role = role(Some(settings), &register);
    let one = declare(settings.index, role, register);
    let described = mapped(&one, process_data);
    let bits: Option<u64> =
        described.map(|pdos| pdos.iter().flat_map(|pdo| &pdo.entries).map(|e| u64::from(e.bit_length)).sum());
    let bytes = bits.filter(|bits| *bits > 0).map(|bits| u16::try_from(bits.div_ceil(8)).unwrap_or(u16::MAX));
    register.length = bytes.or(settings.default_size).unwrap_or_default();
    Some(declare(settings.index, role, register))
}

/// The described PDOs of a SyncManager: those in its list, otherwise those that name it. `None` if a PDO of the list is
/// not described.
fn mapped<'a>(one: &DeclaredSyncManager, process_data: &'a ProcessData) -> Option<Vec<&'a crate::eni::Pdo>> {
    let settings = process_data.sync_managers.iter().find(|settings| settings.index == one.index);
    let outputs = one.role == SyncManagerRole::Outputs;
    match settings.filter(|settings| !settings.pdos.is_empty()) {
        Some(settings) => {
            let described =
                |index: &u16| process_data.pdos.iter().find(|pdo| pdo.index == *index && pdo.outputs == outputs);
            settings.pdos.iter().map(described).collect()
        }
        None => Some(process_data.pdos.iter().filter(|pdo| pdo.sync_manager == Some(one.index)).collect()),
    }
}

/// PDOs with their entries, which give variables their positions. If they do not fit the length, only the length is
/// used.
fn pdos(
    subdevice: usize,
    one: &DeclaredSyncManager,
    process_data: &ProcessData,
    place: Place,
    notices: &mut Notices,
) -> Vec<PdoMapping> {
    let subject = || format!("PDOs of SyncManager {}", one.index);
    let Some(described) = mapped(one, process_data) else {
        let reason = "the file does not describe all of them: its length is used, entries have no positions";
        notices.add(Some(place), Some(subdevice), subject(), reason);
        return Vec::new();
    };
    let bits: u64 = described.iter().flat_map(|pdo| &pdo.entries).map(|entry| u64::from(entry.bit_length)).sum();
    let room = u64::from(one.register.length) * 8;
    if bits > room {
        let reason = format!("{bits} bits, more than its {room}: its length is used, entries have no positions");
        notices.add(Some(place), Some(subdevice), subject(), reason);
        return Vec::new();
    }
    let mapping =
        |pdo: &crate::eni::Pdo| PdoMapping::of(pdo.index, pdo.entries.iter().flat_map(entries).collect::<Vec<_>>());
    described.into_iter().map(mapping).collect()
}

/// The PDOs of a disabled SyncManager: PDOs without entries are assigned, although no data is exchanged.
fn empty_pdos(one: &DeclaredSyncManager, process_data: &ProcessData) -> Vec<PdoMapping> {
    let described = mapped(one, process_data).unwrap_or_default();
    let are_empty = described.iter().all(|pdo| pdo.entries.is_empty());
    let of = |pdo: &crate::eni::Pdo| PdoMapping::of(pdo.index, []);
    described.into_iter().filter(|_| are_empty).map(of).collect()
}

/// An entry, split if it is longer than an object dictionary allows (`ARRAY [0..99] OF BYTE`).
pub(super) fn entries(entry: &crate::eni::PdoEntry) -> impl Iterator<Item = PdoEntry> + '_ {
    let most = if entry.bit_length > u8::MAX.into() { PIECE_BITS } else { u8::MAX.into() };
    (0..entry.bit_length.div_ceil(most)).map(move |piece| {
        let bits = (entry.bit_length - piece * most).min(most);
        // The first piece has the name, the others are gaps that follow it.
        let (index, sub_index) = if piece == 0 { (entry.index, entry.sub_index) } else { (0, 0) };
        PdoEntry::new(index, sub_index, bits as u8)
    })
}

/// Checks `Mailbox/Send` and `Recv` against the SyncManagers set by commands; adds SyncManagers that no command sets.
fn mailboxes(eni: &Eni, index: usize, found: &mut Vec<(DeclaredSyncManager, Place)>) -> Result<(), EniError> {
    let Some(mailbox) = &eni.subdevices[index].mailbox else { return Ok(()) };
    let (Some(send), Some(receive)) = (mailbox.send, mailbox.receive) else { return Ok(()) };
    let sides = [
        (send, SyncManagerRole::MailboxOut, "Mailbox/Send", 0, MAILBOX_OUT),
        (receive, SyncManagerRole::MailboxIn, "Mailbox/Recv", 1, MAILBOX_IN),
    ];
    for (buffer, role, what, number, control) in sides {
        let set = found.iter().find(|(one, _)| one.role == role);
        match set {
            Some((one, place)) => {
                let (expected, got) = ((buffer.start, buffer.length), (one.register.start, one.register.length));
                if expected != got {
                    let text = |(start, length)| format!("{length} bytes at {start:#06x}");
                    let hint = "Mailbox and the command that sets the SyncManager must agree";
                    return Err(contradiction(eni, index, *place, what, text(expected), text(got), hint));
                }
            }
            None if found.iter().any(|(one, _)| one.index == number) => {
                let expected = format!("SyncManager {number} as a mailbox");
                let got = "process data in it";
                return Err(contradiction(eni, index, buffer.place, what, expected, got, ""));
            }
            None => found.push((buffer_declared(number, role, buffer, control), buffer.place)),
        }
    }
    Ok(())
}

fn buffer_declared(number: u8, role: SyncManagerRole, buffer: MailboxBuffer, control: u8) -> DeclaredSyncManager {
    let register = SyncManager {
        start: buffer.start,
        length: buffer.length,
        control: SyncManagerControl::from_bits(control),
        activate: SyncManagerActivate { enable: true, ..SyncManagerActivate::default() },
        ..SyncManager::default()
    };
    declare(number, role, register)
}

/// Mailboxes of BOOT: as set by the commands at IB, otherwise as in `BootStrap`; `None`: use those of the SII.
pub(super) fn bootstrap(eni: &Eni, index: usize) -> Result<Option<[DeclaredSyncManager; 2]>, EniError> {
    let subdevice = &eni.subdevices[index];
    let Some((send, receive)) = subdevice.mailbox.as_ref().and_then(|mailbox| mailbox.bootstrap) else {
        return Ok(None);
    };
    let registers = Registers::after(&subdevice.init_commands, &[Transition::Ib]);
    let sides = [
        (send, SyncManagerRole::MailboxOut, "Mailbox/BootStrap/Send", MAILBOX_OUT),
        (receive, SyncManagerRole::MailboxIn, "Mailbox/BootStrap/Recv", MAILBOX_IN),
    ];
    let mut both = Vec::with_capacity(2);
    for (number, (buffer, role, what, control)) in (0..).zip(sides) {
        let set = registers.sync_managers().find(|(index, register, _)| *index == number && register.activate.enable);
        let one = match set {
            None => buffer_declared(number, role, buffer, control),
            Some((_, register, place)) => {
                check_direction(eni, index, number, role, &register, place)?;
                let (expected, got) = ((buffer.start, buffer.length), (register.start, register.length));
                if expected != got {
                    let text = |(start, length)| format!("{length} bytes at {start:#06x}");
                    let hint = "BootStrap and the command that sets the SyncManager must agree";
                    return Err(contradiction(eni, index, place, what, text(expected), text(got), hint));
                }
                declare(number, role, register)
            }
        };
        both.push(one);
    }
    Ok(both.try_into().ok())
}
