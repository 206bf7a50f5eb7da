//! Decodes an SII into a [`SubDeviceInfo`] and tolerates faults (protocol 4.1 to 4.6).

mod mailboxes;
mod parts;
mod sync_managers;

use alloc::string::String;
use alloc::vec::Vec;

use ringcat_wire::register::EscConfiguration;
use ringcat_wire::sii::{
    Category, CategoryKind, DcMode, DcModes, FmmuUsages, General, Pdo, PdoDirection, PdoEntry, Pdos, SiiHeader,
    Strings, SyncManagerKind,
};

use super::eeprom::AliasSource;
use super::subdevice::{PdoEntryInfo, PdoInfo, Readout, SubDeviceInfo};
use super::warning::{InfoWarning, SiiProblem};
use crate::direction::Direction;
pub(crate) use mailboxes::is_possible;
use parts::{Parts, fixed_area, whole, within};

/// Byte offsets in the fixed area, for warnings.
const CHECKSUM_AT: usize = 2 * 0x07;
/// Bytes of the fixed area that a scan reads in one piece.
const READ_BYTES: usize = 2 * 0x24;

/// See [`SubDeviceInfo::from_parts`].
pub(super) fn collect(readout: Readout, header: &SiiHeader, parts: &[Category<'_>]) -> SubDeviceInfo {
    let parts = Parts { parts };
    // The controller loads the high byte of the first word into ESC_CONFIGURATION.
    let esc_configuration = (header.pdi_control >> 8) as u8;
    let mut info = SubDeviceInfo {
        position: readout.position,
        station: readout.station,
        identity: header.identity,
        controller: readout.information.into(),
        device_emulation: EscConfiguration::from_bits(esc_configuration).device_emulation,
        dl_status: readout.dl_status,
        receive_times: readout.receive_times,
        ..SubDeviceInfo::default()
    };
    if readout.alias_source == AliasSource::Register {
        info.alias = readout.alias;
    }
    if is_erased(header) {
        info.warnings.push(InfoWarning { category: None, offset: None, problem: SiiProblem::Blank });
        return info;
    }
    if readout.alias_source == AliasSource::Sii {
        info.alias = header.alias;
    }
    info.warnings.extend(parts.erased());
    collect_header(&mut info, header);
    let strings = parts.first(CategoryKind::Strings, &mut info.warnings);
    let strings = Strings::new(strings.map_or(&[], |category| category.data));
    collect_general(&mut info, &parts, &strings);
    info.fmmu_usages = parts.all(CategoryKind::Fmmu).flat_map(|category| FmmuUsages::new(category.data)).collect();
    sync_managers::collect(&mut info, &parts);
    mailboxes::collect(&mut info, header);
    for direction in [PdoDirection::Rx, PdoDirection::Tx] {
        for category in parts.all(direction.category()) {
            collect_pdos(&mut info, direction, &category, &strings);
        }
    }
    for category in parts.all(CategoryKind::Dc) {
        info.dc_modes.extend(DcModes::new(category.data));
        whole(&category, DcMode::LEN, &mut info.warnings);
    }
    sync_managers::check_completeness(&mut info, &parts);
    info
}

/// The alias of an SII; an erased one has none.
pub(crate) fn alias_of(header: &SiiHeader) -> u16 {
    if is_erased(header) { 0 } else { header.alias }
}

/// Whether all words are erased. The reserved ones behind them are not read.
fn is_erased(header: &SiiHeader) -> bool {
    let bytes = &header.encode()[..READ_BYTES];
    [0x00, 0xFF].iter().any(|erased| bytes.iter().all(|byte| byte == erased))
}

fn collect_header(info: &mut SubDeviceInfo, header: &SiiHeader) {
    if !header.checksum_ok() {
        let problem = SiiProblem::Checksum { expected: header.computed_checksum(), got: header.checksum };
        info.warnings.push(fixed_area(CHECKSUM_AT, problem));
    }
    info.protocols = header.protocols;
}

fn collect_general(info: &mut SubDeviceInfo, parts: &Parts<'_, '_>, strings: &Strings<'_>) {
    let kind = CategoryKind::General;
    let Some(category) = parts.first(kind, &mut info.warnings) else {
        // An image without any category has a warning of its own.
        if !parts.parts.is_empty() {
            info.warnings.push(InfoWarning { category: Some(kind), offset: None, problem: SiiProblem::Missing });
        }
        return;
    };
    // Of a short category, the existing bytes are used; the rest is zero.
    let mut bytes = [0; General::LEN];
    let got = category.data.len().min(General::LEN);
    bytes[..got].copy_from_slice(&category.data[..got]);
    if got < General::LEN {
        info.warnings.push(within(&category, 0, SiiProblem::Short { expected: General::LEN, got }));
    }
    let Some(general) = General::decode(&bytes) else { return };
    let mut named = |index, at| text(strings, index, &category, at, &mut info.warnings);
    info.group = named(general.group, 0);
    info.image = named(general.image, 1);
    info.order_code = named(general.order, 2);
    info.name = named(general.name, 3);
    info.coe = general.coe;
    info.flags = general.flags;
    info.id_switch_address = general.id_switch_address;
    info.physical_ports = general.physical_ports;
    info.ebus_current_ma = general.ebus_current_ma;
}

fn collect_pdos(info: &mut SubDeviceInfo, direction: PdoDirection, category: &Category<'_>, strings: &Strings<'_>) {
    let data = category.data;
    let mut pdos = Pdos::new(data);
    loop {
        let offset = data.len() - pdos.rest().len();
        let Some(pdo) = pdos.next() else { break };
        push_pdo(info, direction, &pdo, (category, offset), strings);
    }
    let rest = pdos.rest();
    let offset = data.len() - rest.len();
    if rest.len() < Pdo::HEADER_LEN {
        return whole(category, Pdo::HEADER_LEN, &mut info.warnings);
    }
    // An erased entry is not a PDO; a warning was given.
    if rest.iter().all(|byte| *byte == 0xFF) {
        return;
    }
    // The PDO announces entries beyond the end of the category: the entries within it are used.
    let got = (rest.len() - Pdo::HEADER_LEN) / PdoEntry::LEN;
    let mut cut = Vec::from(rest);
    let expected = usize::from(core::mem::replace(&mut cut[2], got as u8));
    if let Some(pdo) = Pdos::new(&cut).next() {
        info.warnings.push(within(category, offset, SiiProblem::PdoEntries { pdo: pdo.index, expected, got }));
        push_pdo(info, direction, &pdo, (category, offset), strings);
    }
}

/// Takes the PDO that begins at a byte of a category's data.
fn push_pdo(
    info: &mut SubDeviceInfo,
    direction: PdoDirection,
    pdo: &Pdo<'_>,
    (category, offset): (&Category<'_>, usize),
    strings: &Strings<'_>,
) {
    let own = Direction::from(direction);
    let problem = sync_manager_problem(info, own, pdo);
    // An assignment to an impossible SyncManager is dropped.
    let sync_manager = pdo.sync_manager.filter(|_| problem.is_none());
    info.warnings.extend(problem.map(|problem| within(category, offset, problem)));
    let name = text(strings, pdo.name, category, offset + 5, &mut info.warnings);
    let mut entries = Vec::with_capacity(usize::from(pdo.entry_count));
    // An erased entry is not a PDO entry; a warning was given.
    for (number, entry) in pdo.entries().enumerate().filter(|(_, entry)| !entry.is_erased()) {
        let name_at = offset + Pdo::HEADER_LEN + number * PdoEntry::LEN + 3;
        entries.push(PdoEntryInfo {
            index: entry.index,
            sub_index: entry.sub_index,
            bit_length: entry.bit_length,
            data_type: entry.data_type,
            name: text(strings, entry.name, category, name_at, &mut info.warnings),
        });
    }
    let Pdo { index, flags, .. } = *pdo;
    info.pdos.push(PdoInfo { index, direction: own, sync_manager, name, flags, entries });
}

/// Fault of the SyncManager to which a PDO is assigned.
fn sync_manager_problem(info: &SubDeviceInfo, own: Direction, pdo: &Pdo<'_>) -> Option<SiiProblem> {
    let number = pdo.sync_manager?;
    let Some(sync_manager) = info.sync_managers.get(usize::from(number)) else {
        return Some(SiiProblem::PdoSyncManager { pdo: pdo.index, sync_manager: number });
    };
    let fits = match sync_manager.kind {
        SyncManagerKind::Outputs => own == Direction::Outputs,
        SyncManagerKind::Inputs => own == Direction::Inputs,
        SyncManagerKind::Unused | SyncManagerKind::Other(_) => true,
        SyncManagerKind::MailboxOut | SyncManagerKind::MailboxIn => false,
    };
    (!fits).then_some(SiiProblem::PdoDirection { pdo: pdo.index, sync_manager: number })
}

/// A string by index, empty for none. Bytes that are not UTF-8 are read as Latin-1; a character that is not printable,
/// such as a line break, becomes a space.
fn text(
    strings: &Strings<'_>,
    index: u8,
    category: &Category<'_>,
    at: usize,
    warnings: &mut Vec<InfoWarning>,
) -> String {
    let Some(bytes) = strings.string(index) else {
        if index != 0 {
            warnings.push(within(category, at, SiiProblem::NoString { index }));
        }
        return String::new();
    };
    let bytes = bytes.split(|byte| *byte == 0).next().unwrap_or_default();
    let printable = |character: char| if character.is_control() { ' ' } else { character };
    match core::str::from_utf8(bytes) {
        Ok(text) => text.chars().map(printable).collect(),
        Err(_) => bytes.iter().map(|byte| printable(char::from(*byte))).collect(),
    }
}
