//! From the bytes of an SII to a [`SubDeviceInfo`], leniently (facts 4.1 to 4.6).

use alloc::string::String;
use alloc::vec::Vec;

use ringcat_wire::register::EscConfiguration;
use ringcat_wire::sii::{
    CategoryKind, DcMode, DcModes, FmmuUsages, General, MailboxLayout, Pdo, PdoDirection, PdoEntry, Pdos, SiiHeader,
    SiiSyncManager, SiiSyncManagers, Strings, SyncManagerKind,
};

use super::{Direction, InfoWarning, PdoEntryInfo, PdoInfo, Readout, SiiProblem, SubDeviceInfo};

/// Byte offsets in the fixed area, for warnings.
const CHECKSUM_AT: usize = 2 * 0x07;
const BOOTSTRAP_AT: usize = 2 * 0x14;
const STANDARD_AT: usize = 2 * 0x18;
const PROTOCOLS_AT: usize = 2 * 0x1C;
/// Bytes of the fixed area that a scan reads without a gap.
const READ_BYTES: usize = 2 * 0x24;

/// The categories that were read.
struct Parts<'p, 'a> {
    parts: &'p [(CategoryKind, &'a [u8])],
}

impl<'a> Parts<'_, 'a> {
    fn all(&self, kind: CategoryKind) -> impl Iterator<Item = &'a [u8]> {
        self.parts.iter().filter(move |part| part.0 == kind).map(|part| part.1)
    }

    /// The first category of a kind; more of them are odd.
    fn first(&self, kind: CategoryKind, warnings: &mut Vec<InfoWarning>) -> Option<&'a [u8]> {
        let mut all = self.all(kind);
        let first = all.next();
        if all.next().is_some() {
            warnings.push(InfoWarning { category: Some(kind), offset: 0, problem: SiiProblem::Repeated });
        }
        first
    }
}

/// See [`SubDeviceInfo::from_parts`].
pub(super) fn collect(readout: Readout, header: &SiiHeader, parts: &[(CategoryKind, &[u8])]) -> SubDeviceInfo {
    let parts = Parts { parts };
    // The high byte of the first word is what the controller loads into ESC_CONFIGURATION.
    let esc_configuration = (header.pdi_control >> 8) as u8;
    let mut info = SubDeviceInfo {
        position: readout.position,
        station: readout.station,
        alias: readout.alias,
        identity: header.identity,
        controller: readout.information.into(),
        device_emulation: EscConfiguration::from_bits(esc_configuration).device_emulation,
        dl_status: readout.dl_status,
        receive_times: readout.receive_times,
        ..SubDeviceInfo::default()
    };
    // Reserved words behind are not read.
    let bytes = &header.encode()[..READ_BYTES];
    if [0x00, 0xFF].iter().any(|erased| bytes.iter().all(|byte| byte == erased)) {
        info.warnings.push(fixed_area(0, SiiProblem::Blank));
        return info;
    }
    collect_header(&mut info, header);
    let strings = Strings::new(parts.first(CategoryKind::Strings, &mut info.warnings).unwrap_or_default());
    collect_general(&mut info, &parts, &strings);
    info.fmmu_usages = parts.all(CategoryKind::Fmmu).flat_map(FmmuUsages::new).collect();
    collect_sync_managers(&mut info, &parts);
    for direction in [PdoDirection::Rx, PdoDirection::Tx] {
        for data in parts.all(direction.category()) {
            collect_pdos(&mut info, direction, data, &strings);
        }
    }
    for data in parts.all(CategoryKind::Dc) {
        info.dc_modes.extend(DcModes::new(data));
        whole(data, DcMode::LEN, CategoryKind::Dc, &mut info.warnings);
    }
    info
}

fn fixed_area(offset: usize, problem: SiiProblem) -> InfoWarning {
    InfoWarning { category: None, offset, problem }
}

/// Warns about a category that does not end with a whole entry. Padding to a word is no entry.
fn whole(data: &[u8], entry: usize, kind: CategoryKind, warnings: &mut Vec<InfoWarning>) {
    let got = data.len() % entry;
    let offset = data.len() - got;
    if data[offset..].iter().any(|byte| *byte != 0 && *byte != 0xFF) {
        warnings.push(InfoWarning {
            category: Some(kind),
            offset,
            problem: SiiProblem::Short { expected: entry, got },
        });
    }
}

fn collect_header(info: &mut SubDeviceInfo, header: &SiiHeader) {
    if !header.checksum_ok() {
        let problem = SiiProblem::Checksum { expected: header.computed_checksum(), got: header.checksum };
        info.warnings.push(fixed_area(CHECKSUM_AT, problem));
    }
    info.protocols = header.protocols;
    info.bootstrap = mailbox(&header.bootstrap_mailbox, BOOTSTRAP_AT, &mut info.warnings);
    info.mailbox = mailbox(&header.standard_mailbox, STANDARD_AT, &mut info.warnings);
    let protocols = header.protocols.0;
    if protocols != 0 && info.mailbox.is_none() {
        info.warnings.push(fixed_area(PROTOCOLS_AT, SiiProblem::NoMailbox { protocols }));
    }
}

/// A mailbox pair, `None` where it has no size. Vendors leave 0xFFFF in fields that they do not use.
fn mailbox(layout: &MailboxLayout, offset: usize, warnings: &mut Vec<InfoWarning>) -> Option<MailboxLayout> {
    let none = |size: u16| size == 0 || size == 0xFFFF;
    let MailboxLayout { receive_size, send_size, .. } = *layout;
    match (none(receive_size), none(send_size)) {
        (false, false) => Some(*layout),
        (true, true) => None,
        _ => {
            warnings.push(fixed_area(offset, SiiProblem::HalfMailbox { receive_size, send_size }));
            None
        }
    }
}

fn collect_general(info: &mut SubDeviceInfo, parts: &Parts<'_, '_>, strings: &Strings<'_>) {
    let kind = CategoryKind::General;
    let Some(data) = parts.first(kind, &mut info.warnings) else { return };
    // A short category counts as far as it goes; what is missing is zero.
    let mut bytes = [0; General::LEN];
    let got = data.len().min(General::LEN);
    bytes[..got].copy_from_slice(&data[..got]);
    if got < General::LEN {
        let problem = SiiProblem::Short { expected: General::LEN, got };
        info.warnings.push(InfoWarning { category: Some(kind), offset: 0, problem });
    }
    let Some(general) = General::decode(&bytes) else { return };
    let mut named = |index, offset| text(strings, index, kind, offset, &mut info.warnings);
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

fn collect_sync_managers(info: &mut SubDeviceInfo, parts: &Parts<'_, '_>) {
    let kind = CategoryKind::SyncManager;
    for data in parts.all(kind) {
        info.sync_managers.extend(SiiSyncManagers::new(data));
        whole(data, SiiSyncManager::LEN, kind, &mut info.warnings);
    }
    let available = usize::from(info.controller.sync_manager_count);
    let got = info.sync_managers.len();
    if got > available {
        let problem = SiiProblem::SyncManagers { expected: available, got };
        info.warnings.push(InfoWarning { category: Some(kind), offset: available * SiiSyncManager::LEN, problem });
        info.sync_managers.truncate(available);
    }
    for (index, sm) in info.sync_managers.iter().enumerate() {
        let write = sm.control & 0x0C == 0x04;
        let wrong = match sm.kind {
            SyncManagerKind::MailboxOut | SyncManagerKind::Outputs => !write,
            SyncManagerKind::MailboxIn | SyncManagerKind::Inputs => sm.control & 0x0C != 0,
            SyncManagerKind::Unused | SyncManagerKind::Other(_) => false,
        };
        if wrong {
            let problem = SiiProblem::ControlDirection { sync_manager: index as u8, control: sm.control };
            let offset = index * SiiSyncManager::LEN;
            info.warnings.push(InfoWarning { category: Some(kind), offset, problem });
        }
    }
}

fn collect_pdos(info: &mut SubDeviceInfo, direction: PdoDirection, data: &[u8], strings: &Strings<'_>) {
    let mut pdos = Pdos::new(data);
    loop {
        let offset = data.len() - pdos.rest().len();
        let Some(pdo) = pdos.next() else { break };
        push_pdo(info, direction, &pdo, offset, strings);
    }
    let rest = pdos.rest();
    let offset = data.len() - rest.len();
    let kind = direction.category();
    if rest.len() < Pdo::HEADER_LEN {
        return whole(data, Pdo::HEADER_LEN, kind, &mut info.warnings);
    }
    // Entries beyond the end of the category: those that are there count.
    let got = (rest.len() - Pdo::HEADER_LEN) / PdoEntry::LEN;
    let mut cut = Vec::from(rest);
    let expected = usize::from(core::mem::replace(&mut cut[2], got as u8));
    if let Some(pdo) = Pdos::new(&cut).next() {
        let problem = SiiProblem::PdoEntries { pdo: pdo.index, expected, got };
        info.warnings.push(InfoWarning { category: Some(kind), offset, problem });
        push_pdo(info, direction, &pdo, offset, strings);
    }
}

fn push_pdo(info: &mut SubDeviceInfo, direction: PdoDirection, pdo: &Pdo<'_>, offset: usize, strings: &Strings<'_>) {
    let kind = direction.category();
    let own = Direction::from(direction);
    if let Some(problem) = sync_manager_problem(info, own, pdo) {
        info.warnings.push(InfoWarning { category: Some(kind), offset, problem });
    }
    let name = text(strings, pdo.name, kind, offset + 5, &mut info.warnings);
    let mut entries = Vec::with_capacity(usize::from(pdo.entry_count));
    for (number, entry) in pdo.entries().enumerate() {
        let name_at = offset + Pdo::HEADER_LEN + number * PdoEntry::LEN + 3;
        entries.push(PdoEntryInfo {
            index: entry.index,
            sub_index: entry.sub_index,
            bit_length: entry.bit_length,
            data_type: entry.data_type,
            name: text(strings, entry.name, kind, name_at, &mut info.warnings),
        });
    }
    let Pdo { index, sync_manager, flags, .. } = *pdo;
    info.pdos.push(PdoInfo { index, direction: own, sync_manager, name, flags, entries });
}

/// What is odd about the SyncManager to which a PDO is assigned.
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

/// A string by index, empty for none. Bytes that are not UTF-8 are taken as Latin-1.
fn text(
    strings: &Strings<'_>,
    index: u8,
    kind: CategoryKind,
    offset: usize,
    warnings: &mut Vec<InfoWarning>,
) -> String {
    let Some(bytes) = strings.string(index) else {
        if index != 0 {
            warnings.push(InfoWarning { category: Some(kind), offset, problem: SiiProblem::NoString { index } });
        }
        return String::new();
    };
    let bytes = bytes.split(|byte| *byte == 0).next().unwrap_or_default();
    match core::str::from_utf8(bytes) {
        Ok(text) => String::from(text),
        Err(_) => bytes.iter().map(|byte| char::from(*byte)).collect(),
    }
}
