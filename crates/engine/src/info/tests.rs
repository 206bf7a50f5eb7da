use std::path::Path;
use std::string::{String, ToString};
use std::vec;
use std::vec::Vec;
use std::{format, fs, println};

use proptest::prelude::*;
use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::register::{DlStatus, Information, PortKind};
use ringcat_wire::sii::{
    CategoryHeader, CategoryKind, FmmuUsage, General, Identity, MailboxLayout, MailboxProtocols, PdoDirection, Sii,
    SiiWriter, SyncManagerKind,
};

use super::*;
use crate::direction::Direction;

/// An ET1100: 8 FMMUs, 8 SyncManagers, 8 KiB, four MII ports, DC.
const INFORMATION: [u8; Information::LEN] = [0x11, 0x01, 0x02, 0x00, 8, 8, 8, 0xFF, 0x0C, 0x00];

fn readout() -> Readout {
    Readout {
        position: Position(3),
        station: StationAddress(0x1003),
        alias: 9,
        alias_source: AliasSource::Register,
        information: Information::decode(&INFORMATION),
        dl_status: DlStatus::from_bits(0x5A33),
        receive_times: Some([1, 2, 3, 4]),
    }
}

fn header() -> SiiHeader {
    SiiHeader {
        identity: Identity { vendor_id: 2, product_code: 0x1234, revision: 1, serial: 0 },
        standard_mailbox: MailboxLayout {
            receive_offset: 0x1000,
            receive_size: 128,
            send_offset: 0x1080,
            send_size: 128,
        },
        protocols: MailboxProtocols(MailboxProtocols::COE),
        ..SiiHeader::default()
    }
    .with_checksum()
}

/// "Group", "Order", and a name in Latin-1.
const STRINGS: &[u8] = &[3, 5, b'G', b'r', b'o', b'u', b'p', 5, b'O', b'r', b'd', b'e', b'r', 3, b'B', 0xFC, b'r', 0];
const SYNC_MANAGERS: &[u8] = &[
    0x00, 0x10, 0x80, 0x00, 0x26, 0x00, 0x01, 0x01, // mailbox out
    0x80, 0x10, 0x80, 0x00, 0x22, 0x00, 0x01, 0x02, // mailbox in
    0x00, 0x11, 0x02, 0x00, 0x64, 0x00, 0x01, 0x03, // outputs
    0x80, 0x11, 0x02, 0x00, 0x20, 0x00, 0x01, 0x04, // inputs
];
const TX_PDO: &[u8] = &[
    0x00, 0x1A, 0x01, 0x03, 0x00, 0x02, 0x11, 0x00, //
    0x00, 0x60, 0x01, 0x00, 0x06, 0x10, 0x00, 0x00,
];

fn general() -> Vec<u8> {
    let mut general = vec![0; 32];
    general[..4].copy_from_slice(&[1, 0, 2, 3]);
    general[0x05] = 0x0D;
    general[0x0B] = 0x0A;
    general[0x0C..0x0E].copy_from_slice(&(-500i16).to_le_bytes());
    general
}

/// Consecutive categories behind the fixed area.
fn placed<'a>(categories: &[(CategoryKind, &'a [u8])]) -> Vec<Category<'a>> {
    let mut offset = SiiHeader::LEN;
    let mut place = |(kind, data): &(CategoryKind, &'a [u8])| {
        let category = Category { kind: *kind, offset, data };
        offset += CategoryHeader::LEN + data.len().next_multiple_of(2);
        category
    };
    categories.iter().map(&mut place).collect()
}

fn info(categories: &[(CategoryKind, &[u8])]) -> SubDeviceInfo {
    // Every image has a general category.
    let mut categories = categories.to_vec();
    if !categories.iter().any(|(kind, _)| *kind == CategoryKind::General) {
        categories.push((CategoryKind::General, &[0; General::LEN]));
    }
    SubDeviceInfo::from_parts(readout(), &header(), placed(&categories))
}

fn warning(category: CategoryKind, offset: usize, problem: SiiProblem) -> InfoWarning {
    InfoWarning { category: Some(category), offset: Some(offset), problem }
}

// covers: scan
#[test]
fn every_category_is_decoded() {
    let general = general();
    let info = info(&[
        (CategoryKind::TxPdo, TX_PDO),
        (CategoryKind::SyncManager, SYNC_MANAGERS),
        (CategoryKind::Fmmu, &[1, 2, 3, 0xFF]),
        (CategoryKind::General, &general),
        (CategoryKind::Dc, &[0; 24]),
        (CategoryKind::Strings, STRINGS),
    ]);
    assert_eq!((info.position, info.station, info.alias), (Position(3), StationAddress(0x1003), 9));
    assert_eq!((info.controller.fmmu_count, info.controller.ports), (8, [PortKind::Mii; 4]));
    assert_eq!((info.group.as_str(), info.order_code.as_str(), info.name.as_str()), ("Group", "Order", "Bür"));
    assert_eq!(info.ebus_current_ma, -500);
    assert!(info.coe.sdo() && info.coe.pdo_assign() && info.coe.pdo_configuration());
    assert!(!info.lrw_supported());
    assert_eq!(info.sync_managers.len(), 4);
    assert_eq!(info.sync_managers[2].kind, SyncManagerKind::Outputs);
    let usages = [FmmuUsage::Outputs, FmmuUsage::Inputs, FmmuUsage::MailboxStatus, FmmuUsage::Unused];
    assert_eq!(info.fmmu_usages, usages);
    let pdo = info.pdo(0x1A00).unwrap();
    assert_eq!((pdo.direction, pdo.sync_manager, pdo.name.as_str()), (Direction::Inputs, Some(3), "Order"));
    let entry = PdoEntryInfo { index: 0x6000, sub_index: 1, bit_length: 16, data_type: 6, name: String::new() };
    assert_eq!((pdo.entries.as_slice(), pdo.bit_length()), ([entry].as_slice(), 16));
    assert_eq!(info.assigned_pdos(3).count(), 1);
    assert_eq!((info.mailbox.unwrap().receive_size, info.bootstrap, info.dc_modes.len()), (128, None, 1));
    assert_eq!(info.warnings, []);
}

// covers: odd-sii
#[test]
fn impossible_mailboxes_are_ignored_with_a_warning() {
    let spoil: [fn(&mut MailboxLayout); 5] = [
        |layout| (layout.receive_offset, layout.receive_size) = (0x7878, 10_616),
        |layout| layout.send_offset = 0x0F80,
        |layout| layout.send_offset = 0x2FC0,
        |layout| layout.send_offset = 0x107F,
        |layout| layout.send_size = 5,
    ];
    for spoil in spoil {
        let mut header = header();
        spoil(&mut header.standard_mailbox);
        let layout = header.standard_mailbox;
        let read = |parts: &[(CategoryKind, &[u8])]| SubDeviceInfo::from_parts(readout(), &header, placed(parts));
        let alone = read(&[]);
        let problem = SiiProblem::Mailbox { layout, memory_end: 0x3000 };
        assert_eq!(alone.warnings[0], InfoWarning { category: None, offset: Some(0x30), problem });
        assert_eq!(alone.mailbox, None);
        let described = read(&[(CategoryKind::SyncManager, SYNC_MANAGERS)]);
        assert_eq!(described.mailbox.map(|it| (it.receive_offset, it.send_offset)), Some((0x1000, 0x1080)));
    }
}

#[test]
fn the_type_of_a_sync_manager_follows_from_its_pdos_or_its_control_byte() {
    let mut data = SYNC_MANAGERS.to_vec();
    (8..32).step_by(8).for_each(|at| data[at + 7] = 0);
    // PDOs override the control byte.
    data[3 * 8 + 4] = 0x64;
    let info = info(&[(CategoryKind::SyncManager, &data), (CategoryKind::TxPdo, TX_PDO)]);
    use SyncManagerKind::{Inputs, MailboxIn, MailboxOut, Outputs};
    let kinds: Vec<_> = info.sync_managers.iter().map(|manager| manager.kind).collect();
    assert_eq!(kinds, [MailboxOut, MailboxIn, Outputs, Inputs]);
    let texts: Vec<_> = info.warnings.iter().map(ToString::to_string).filter(|text| text.contains("type")).collect();
    assert_eq!(texts[1], "byte 0x0094, category SYNCM: SM 2 has type 0, assumed to be for outputs");
    assert_eq!(texts.len(), 3);
}

// covers: odd-sii
#[test]
fn a_truncated_image_is_a_warning_wherever_it_ends() {
    let whole = SYNC_MANAGERS.to_vec();
    let cut = |bytes: usize| [&whole[..bytes], &vec![0xFF; whole.len() - bytes]].concat();
    for bytes in [0, 8, 12, 28] {
        let data = cut(bytes);
        let info = info(&[(CategoryKind::SyncManager, &data)]);
        let problem = SiiProblem::Erased { bytes: 32 - bytes };
        assert!(info.warnings.contains(&warning(CategoryKind::SyncManager, 132 + bytes, problem)), "{bytes}");
        assert_eq!(info.sync_managers.len(), bytes.div_ceil(8), "{bytes}");
        assert!(info.is_doubtful());
    }
    let general = general();
    let without = SubDeviceInfo::from_parts(readout(), &header(), placed(&[(CategoryKind::Strings, STRINGS)]));
    assert_eq!(
        without.warnings[0].to_string(),
        "category GENERAL: required in every image, but missing: is the image truncated?"
    );
    let ends = info(&[(CategoryKind::Strings, STRINGS), (CategoryKind::General, &general)]);
    assert_eq!(ends.warnings.len(), 1, "{:?}", ends.warnings);
    assert_eq!(ends.warnings[0].problem, SiiProblem::NoSyncManagers);
}

// covers: eni-read
#[test]
fn a_character_of_a_name_that_is_not_printable_becomes_a_space() {
    let strings = [1, 9, b'T', b'w', b'o', b'\n', b'l', 0x1B, b'n', b'e', b's', 0];
    let mut general = general();
    general[..4].copy_from_slice(&[0, 0, 1, 1]);
    let info = info(&[(CategoryKind::Strings, &strings), (CategoryKind::General, &general)]);
    assert_eq!((info.name.as_str(), info.order_code.as_str()), ("Two l nes", "Two l nes"));
}

// covers: scan
#[test]
fn a_blank_eeprom_is_one_warning() {
    for erased in [0xFF, 0x00] {
        let header = SiiHeader::decode(&[erased; 128]);
        let info = SubDeviceInfo::from_parts(readout(), &header, []);
        assert_eq!(info.warnings, [InfoWarning { category: None, offset: None, problem: SiiProblem::Blank }]);
        assert_eq!((info.mailbox, info.protocols), (None, MailboxProtocols(0)));
    }
}

#[test]
fn a_wrong_checksum_is_a_warning() {
    let mut header = header();
    let expected = header.computed_checksum();
    header.checksum ^= 0xFF;
    let info = SubDeviceInfo::from_parts(readout(), &header, []);
    let problem = SiiProblem::Checksum { expected, got: header.checksum };
    assert_eq!(info.warnings, [InfoWarning { category: None, offset: Some(14), problem }]);
    assert_eq!(info.identity, header.identity);
}

#[test]
fn one_mailbox_without_the_other_is_ignored() {
    let mut header = header();
    header.standard_mailbox.send_size = 0;
    let info = SubDeviceInfo::from_parts(readout(), &header, []);
    assert_eq!(info.mailbox, None);
    let problems: Vec<_> = info.warnings.iter().map(|warning| (warning.offset, warning.problem)).collect();
    let half = SiiProblem::HalfMailbox { receive_size: 128, send_size: 0 };
    assert_eq!(problems, [(Some(0x30), half), (Some(0x38), SiiProblem::NoMailbox { protocols: 4 })]);
}

#[test]
fn a_pdo_with_too_many_entries_keeps_those_within_the_category() {
    let mut data = TX_PDO.to_vec();
    data[2] = 3;
    let info = info(&[(CategoryKind::SyncManager, SYNC_MANAGERS), (CategoryKind::TxPdo, &data)]);
    assert_eq!(info.pdos[0].entries.len(), 1);
    let problem = SiiProblem::PdoEntries { pdo: 0x1A00, expected: 3, got: 1 };
    // After 128 bytes, four SyncManagers and two headers.
    assert!(info.warnings.contains(&warning(CategoryKind::TxPdo, 168, problem)));
    assert_eq!(
        warning(CategoryKind::TxPdo, 168, problem).to_string(),
        "byte 0x00a8, category TXPDO: PDO 0x1a00 announces 3 entries, but contains 1"
    );
}

#[test]
fn a_pdo_with_an_impossible_sync_manager_is_a_warning() {
    let mut outputs = TX_PDO.to_vec();
    outputs[3] = 2;
    outputs[5] = 0;
    let mut nowhere = outputs.clone();
    nowhere[3] = 7;
    let info = info(&[(CategoryKind::SyncManager, SYNC_MANAGERS), (CategoryKind::TxPdo, &[outputs, nowhere].concat())]);
    let expected = [
        warning(CategoryKind::TxPdo, 168, SiiProblem::PdoDirection { pdo: 0x1A00, sync_manager: 2 }),
        warning(CategoryKind::TxPdo, 184, SiiProblem::PdoSyncManager { pdo: 0x1A00, sync_manager: 7 }),
    ];
    assert_eq!(info.warnings, expected);
    assert!(info.pdos.iter().all(|pdo| pdo.sync_manager.is_none()), "they are not assigned");
}

#[test]
fn an_unassigned_pdo_is_no_fault() {
    let mut data = TX_PDO.to_vec();
    (data[3], data[5]) = (0xFF, 0);
    let info = info(&[(CategoryKind::SyncManager, SYNC_MANAGERS), (CategoryKind::TxPdo, &data)]);
    assert_eq!((info.pdos[0].sync_manager, info.warnings), (None, vec![]));
}

#[test]
fn missing_strings_and_a_short_general_category_are_warnings() {
    let info = info(&[(CategoryKind::General, &general()[..16]), (CategoryKind::SyncManager, SYNC_MANAGERS)]);
    let problems: Vec<_> = info.warnings.iter().map(|warning| warning.problem).collect();
    let missing = |index| SiiProblem::NoString { index };
    assert_eq!(problems, [SiiProblem::Short { expected: 32, got: 16 }, missing(1), missing(2), missing(3)]);
    assert_eq!(info.ebus_current_ma, -500);
}

#[test]
fn sync_managers_beyond_those_of_the_controller_are_ignored() {
    let info = info(&[(CategoryKind::SyncManager, &SYNC_MANAGERS.repeat(3))]);
    assert_eq!(info.sync_managers.len(), 8);
    let problem = SiiProblem::SyncManagers { expected: 8, got: 12 };
    assert_eq!(info.warnings, [warning(CategoryKind::SyncManager, 132 + 64, problem)]);
}

#[test]
fn a_sync_manager_with_the_wrong_direction_is_a_warning() {
    let mut data = SYNC_MANAGERS.to_vec();
    data[2 * 8 + 4] = 0x20;
    let info = info(&[(CategoryKind::SyncManager, &data)]);
    let problem = SiiProblem::Control { sync_manager: 2, control: 0x20 };
    assert_eq!(info.warnings, [warning(CategoryKind::SyncManager, 132 + 16, problem)]);
}

#[test]
fn an_image_of_the_sii_writer_has_no_warnings() {
    let mut image = vec![0; 1024];
    let mut writer = SiiWriter::new(&mut image, &header()).unwrap();
    writer.strings(&["Group", "Order", "Name"]).unwrap();
    writer.category(CategoryKind::General, &general()).unwrap();
    writer.category(CategoryKind::SyncManager, SYNC_MANAGERS).unwrap();
    writer.category(CategoryKind::TxPdo, TX_PDO).unwrap();
    writer.finish().unwrap();
    let sii = Sii::parse(&image).unwrap();
    let info = SubDeviceInfo::from_parts(readout(), sii.header(), sii.categories());
    assert_eq!((info.name.as_str(), info.warnings), ("Name", vec![]));
}

/// Every real image gives at least as many PDOs as the parser of whole images.
// covers: scan
#[test]
fn real_images_are_listed() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/sii");
    let Ok(entries) = fs::read_dir(&folder) else {
        println!("skipped: {} is not there", folder.display());
        return;
    };
    for path in entries.map(|entry| entry.unwrap().path()).filter(|path| path.extension().is_some_and(|e| e == "bin")) {
        let image = fs::read(&path).unwrap();
        let Ok(sii) = Sii::parse(&image) else { continue };
        let info = SubDeviceInfo::from_parts(readout(), sii.header(), sii.categories());
        let whole = sii.pdos(PdoDirection::Rx).count() + sii.pdos(PdoDirection::Tx).count();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        assert!(info.pdos.len() >= whole, "{name}");
        let warnings: Vec<_> = info.warnings.iter().map(|warning| format!("{warning}")).collect();
        println!("{name}: {} {:?}", info.name, warnings);
    }
}

proptest! {
    // covers: scan
    #[test]
    fn any_bytes_give_an_info_without_panic(
        header in proptest::collection::vec(any::<u8>(), 128),
        parts in proptest::collection::vec((0u16..62, proptest::collection::vec(any::<u8>(), 0..200)), 0..8),
    ) {
        let header = SiiHeader::decode(header.as_slice().try_into().unwrap());
        let parts: Vec<_> =
            parts
            .iter()
            .map(|(code, data)| (CategoryKind::from_code(*code / 10 * 10 + *code % 2), &data[..]))
            .collect();
        let info = SubDeviceInfo::from_parts(readout(), &header, placed(&parts));
        info.warnings.iter().for_each(|warning| drop(warning.to_string()));
    }
}

/// Two terminals of one type cannot be distinguished without a serial number; their modules and parameters may differ.
// covers: 5.1, api
#[test]
fn pdos_of_a_dictionary_are_certain_only_with_the_same_serial_number() {
    let info = |revision: u32, serial: u32, pdo_source: PdoSource, pdos: Vec<PdoInfo>| SubDeviceInfo {
        identity: Identity { vendor_id: 2, product_code: 7, revision, serial },
        pdo_source,
        pdos,
        ..SubDeviceInfo::default()
    };
    let pdos = |index: u16| {
        let (direction, name, entries) = (Direction::Inputs, String::new(), Vec::new());
        vec![PdoInfo { index, direction, sync_manager: Some(3), name, flags: 0, entries }]
    };
    let read = pdos(0x1A00);
    let known = |serial| info(1, serial, PdoSource::Dictionary, read.clone());
    for (serial, before, expected) in
        [(5, 5, PdoSource::Dictionary), (6, 5, PdoSource::Written), (0, 0, PdoSource::Written)]
    {
        let mut found = info(1, serial, PdoSource::Sii, Vec::new());
        found.keep_dictionary(&known(before));
        assert_eq!((found.pdo_source, &found.pdos), (expected, &read), "{serial}, {before}");
        // The SubDevice loses its power again before it is configured.
        let mut again = info(1, serial, PdoSource::Sii, Vec::new());
        again.keep_dictionary(&found);
        assert_eq!((again.pdo_source, &again.pdos), (expected, &read), "{serial}, {before} again");
    }
    // A firmware update may have changed the revision; PDOs that were uncertain remain uncertain.
    for (revision, source) in [(2, PdoSource::Outdated), (1, PdoSource::Outdated)] {
        let mut found = info(revision, 5, source, Vec::new());
        found.keep_dictionary(&known(5));
        assert_eq!((found.pdo_source, &found.pdos), (PdoSource::Outdated, &read));
    }
    let mut found = info(1, 5, PdoSource::Sii, Vec::new());
    found.keep_dictionary(&info(1, 5, PdoSource::Outdated, read.clone()));
    assert_eq!((found.pdo_source, &found.pdos), (PdoSource::Outdated, &read));
    let mut other = info(1, 5, PdoSource::Sii, Vec::new());
    other.identity.product_code = 8;
    other.keep_dictionary(&known(5));
    assert_eq!((other.pdo_source, other.pdos.len()), (PdoSource::Sii, 0));
    // PDOs that were read from this SubDevice have priority.
    let own = pdos(0x1A01);
    let mut found = info(1, 5, PdoSource::Dictionary, own.clone());
    found.keep_dictionary(&known(5));
    assert_eq!((found.pdo_source, found.pdos), (PdoSource::Dictionary, own));
}
