use std::path::Path;
use std::string::ToString;
use std::vec;
use std::vec::Vec;
use std::{format, fs, println};

use proptest::prelude::*;
use ringcat_wire::address::Position;
use ringcat_wire::sii::{Categories, Category, PdoDirection, Sii, SiiWriter, SyncManagerKind};

use super::*;

/// An ET1100: 8 FMMUs, 8 SyncManagers, 8 KiB, four MII ports, DC.
const INFORMATION: [u8; Information::LEN] = [0x11, 0x01, 0x02, 0x00, 8, 8, 8, 0xFF, 0x0C, 0x00];

fn readout() -> Readout {
    Readout {
        position: Position(3),
        station: StationAddress(0x1003),
        alias: 9,
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

fn info(categories: &[(CategoryKind, &[u8])]) -> SubDeviceInfo {
    SubDeviceInfo::from_parts(readout(), &header(), categories.iter().copied())
}

fn warning(category: CategoryKind, offset: usize, problem: SiiProblem) -> InfoWarning {
    InfoWarning { category: Some(category), offset, problem }
}

#[test]
fn every_category_finds_its_place() {
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

#[test]
fn a_blank_eeprom_is_one_warning() {
    for erased in [0xFF, 0x00] {
        let header = SiiHeader::decode(&[erased; 128]);
        let info = SubDeviceInfo::from_parts(readout(), &header, []);
        assert_eq!(info.warnings, [InfoWarning { category: None, offset: 0, problem: SiiProblem::Blank }]);
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
    assert_eq!(info.warnings, [InfoWarning { category: None, offset: 14, problem }]);
    assert_eq!(info.identity, header.identity);
}

#[test]
fn half_a_mailbox_is_no_mailbox() {
    let mut header = header();
    header.standard_mailbox.send_size = 0;
    let info = SubDeviceInfo::from_parts(readout(), &header, []);
    assert_eq!(info.mailbox, None);
    let problems: Vec<_> = info.warnings.iter().map(|warning| (warning.offset, warning.problem)).collect();
    let half = SiiProblem::HalfMailbox { receive_size: 128, send_size: 0 };
    assert_eq!(problems, [(0x30, half), (0x38, SiiProblem::NoMailbox { protocols: 4 })]);
}

#[test]
fn a_pdo_with_more_entries_than_the_category_holds_keeps_those_there() {
    let mut data = TX_PDO.to_vec();
    data[2] = 3;
    let info = info(&[(CategoryKind::SyncManager, SYNC_MANAGERS), (CategoryKind::TxPdo, &data)]);
    assert_eq!(info.pdos[0].entries.len(), 1);
    let problem = SiiProblem::PdoEntries { pdo: 0x1A00, expected: 3, got: 1 };
    assert!(info.warnings.contains(&warning(CategoryKind::TxPdo, 0, problem)));
    assert_eq!(
        warning(CategoryKind::TxPdo, 0, problem).to_string(),
        "SII category TXPDO at byte 0: PDO 0x1a00 announces 3 entries, 1 are there"
    );
}

#[test]
fn a_pdo_of_the_wrong_sync_manager_is_a_warning() {
    let mut outputs = TX_PDO.to_vec();
    outputs[3] = 2;
    outputs[5] = 0;
    let mut nowhere = outputs.clone();
    nowhere[3] = 7;
    let info = info(&[(CategoryKind::SyncManager, SYNC_MANAGERS), (CategoryKind::TxPdo, &[outputs, nowhere].concat())]);
    let expected = [
        warning(CategoryKind::TxPdo, 0, SiiProblem::PdoDirection { pdo: 0x1A00, sync_manager: 2 }),
        warning(CategoryKind::TxPdo, 16, SiiProblem::PdoSyncManager { pdo: 0x1A00, sync_manager: 7 }),
    ];
    assert_eq!(info.warnings, expected);
}

#[test]
fn an_unassigned_pdo_is_nothing_odd() {
    let mut data = TX_PDO.to_vec();
    (data[3], data[5]) = (0xFF, 0);
    let info = info(&[(CategoryKind::SyncManager, SYNC_MANAGERS), (CategoryKind::TxPdo, &data)]);
    assert_eq!((info.pdos[0].sync_manager, info.warnings), (None, vec![]));
}

#[test]
fn missing_strings_and_a_short_general_category_are_warnings() {
    let info = info(&[(CategoryKind::General, &general()[..16])]);
    let problems: Vec<_> = info.warnings.iter().map(|warning| warning.problem).collect();
    let missing = |index| SiiProblem::NoString { index };
    assert_eq!(problems, [SiiProblem::Short { expected: 32, got: 16 }, missing(1), missing(2), missing(3)]);
    assert_eq!(info.ebus_current_ma, -500);
}

#[test]
fn sync_managers_beyond_those_of_the_controller_are_left_out() {
    let info = info(&[(CategoryKind::SyncManager, &SYNC_MANAGERS.repeat(3))]);
    assert_eq!(info.sync_managers.len(), 8);
    let problem = SiiProblem::SyncManagers { expected: 8, got: 12 };
    assert_eq!(info.warnings, [warning(CategoryKind::SyncManager, 64, problem)]);
}

#[test]
fn a_sync_manager_with_the_wrong_direction_is_a_warning() {
    let mut data = SYNC_MANAGERS.to_vec();
    data[2 * 8 + 4] = 0x20;
    let info = info(&[(CategoryKind::SyncManager, &data)]);
    let problem = SiiProblem::ControlDirection { sync_manager: 2, control: 0x20 };
    assert_eq!(info.warnings, [warning(CategoryKind::SyncManager, 16, problem)]);
}

#[test]
fn what_a_writer_wrote_is_found_without_warnings() {
    let mut image = vec![0; 1024];
    let mut writer = SiiWriter::new(&mut image, &header()).unwrap();
    writer.strings(&["Group", "Order", "Name"]).unwrap();
    writer.category(CategoryKind::General, &general()).unwrap();
    writer.category(CategoryKind::SyncManager, SYNC_MANAGERS).unwrap();
    writer.category(CategoryKind::TxPdo, TX_PDO).unwrap();
    writer.finish().unwrap();
    let sii = Sii::parse(&image).unwrap();
    let parts = sii.categories().map(|Category { kind, data, .. }| (kind, data));
    let info = SubDeviceInfo::from_parts(readout(), sii.header(), parts);
    assert_eq!((info.name.as_str(), info.warnings), ("Name", vec![]));
}

/// Every real image gives an info with a name and as many PDOs as the reader of whole images finds.
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
        let categories: Categories<'_> = sii.categories();
        let info = SubDeviceInfo::from_parts(readout(), sii.header(), categories.map(|c| (c.kind, c.data)));
        let whole = sii.pdos(PdoDirection::Rx).count() + sii.pdos(PdoDirection::Tx).count();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        assert!(info.pdos.len() >= whole, "{name}");
        let warnings: Vec<_> = info.warnings.iter().map(|warning| format!("{warning}")).collect();
        println!("{name}: {} {:?}", info.name, warnings);
    }
}

proptest! {
    #[test]
    fn any_bytes_give_an_info_without_panic(
        header in proptest::collection::vec(any::<u8>(), 128),
        parts in proptest::collection::vec((0u16..62, proptest::collection::vec(any::<u8>(), 0..200)), 0..8),
    ) {
        let header = SiiHeader::decode(header.as_slice().try_into().unwrap());
        let parts: Vec<_> =
            parts.iter().map(|(code, data)| (CategoryKind::from_code(*code / 10 * 10 + *code % 2), &data[..])).collect();
        let info = SubDeviceInfo::from_parts(readout(), &header, parts);
        info.warnings.iter().for_each(|warning| drop(warning.to_string()));
    }
}
