//! Whole images: literal images, invalid images, and images of the writer.

use super::*;
use proptest::collection::vec;
use proptest::prelude::*;
use std::string::{String, ToString};
use std::vec::Vec;

/// Categories of a small device, including an unknown category, a vendor-specific one and a NOP.
const CATEGORIES: [u8; 146] = [
    0x0A, 0x00, 0x06, 0x00, // STRINGS, 6 words
    2, 6, b'E', b'L', b'9', b'9', b'9', b'9', 3, b'B', b'u', b's', //
    0x03, 0x00, 0x01, 0x00, 0xDE, 0xAD, // unknown, 1 word
    0x1E, 0x00, 0x10, 0x00, // GENERAL, 16 words
    2, 0, 1, 1, 0, 0x23, 0, 0, 0, 0, 0, 0, 0x64, 0, 2, 0, 0x11, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, //
    0x28, 0x00, 0x02, 0x00, 1, 2, 3, 0, // FMMU, 2 words
    0x29, 0x00, 0x08, 0x00, // SYNCM, 8 words
    0x00, 0x11, 0x02, 0x00, 0x64, 0x00, 0x01, 0x03, 0x80, 0x11, 0x04, 0x00, 0x20, 0x00, 0x01, 0x04, //
    0x00, 0x00, 0x00, 0x00, // NOP, empty
    0x32, 0x00, 0x08, 0x00, // TXPDO, 8 words
    0x00, 0x1A, 0x01, 0x03, 0x00, 0x00, 0x00, 0x00, 0x00, 0x60, 0x01, 0x00, 0x06, 0x10, 0x00, 0x00, //
    0x01, 0x80, 0x01, 0x00, 0xBE, 0xEF, // of the vendor, 1 word
    0x3C, 0x00, 0x0C, 0x00, // DC, 12 words
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x00, 0x03, 1, 0, 2, 0, 0, 0, 0, 0, //
    0xFF, 0xFF, // END
];

fn image(categories: &[u8]) -> Vec<u8> {
    let header = SiiHeader { identity: Identity { vendor_id: 2, ..Identity::default() }, ..SiiHeader::default() };
    let mut image = header.with_checksum().encode().to_vec();
    image.extend(categories);
    image
}

/// Reads all content.
fn read_everything(sii: &Sii<'_>) -> usize {
    let entries = |direction| sii.pdos(direction).map(|pdo| pdo.entries().count()).sum::<usize>();
    sii.strings().iter().count()
        + usize::from(sii.general().is_some())
        + sii.fmmu_usages().count()
        + sii.sync_managers().count()
        + entries(PdoDirection::Tx)
        + entries(PdoDirection::Rx)
        + sii.dc_modes().count()
        + sii.categories().map(|category| category.data.len()).sum::<usize>()
}

#[test]
fn every_category_of_an_image_is_found() {
    let image = image(&CATEGORIES);
    let sii = Sii::parse(&image).unwrap();
    assert!(sii.end_marker);
    assert_eq!(sii.used(), image.len());
    assert_eq!(sii.header().identity.vendor_id, 2);
    let general = sii.general().unwrap();
    assert_eq!(general.ebus_current_ma, 100);
    assert_eq!(sii.strings().string(general.name), Some(b"EL9999".as_slice()));
    assert_eq!(sii.strings().string(general.group), Some(b"Bus".as_slice()));
    assert_eq!(sii.strings().string(general.image), None);
    let usages: Vec<_> = sii.fmmu_usages().collect();
    assert_eq!(usages, [FmmuUsage::Outputs, FmmuUsage::Inputs, FmmuUsage::MailboxStatus, FmmuUsage::Unused]);
    let kinds: Vec<_> = sii.sync_managers().map(|sync_manager| (sync_manager.start, sync_manager.kind)).collect();
    assert_eq!(kinds, [(0x1100, SyncManagerKind::Outputs), (0x1180, SyncManagerKind::Inputs)]);
    let pdos: Vec<_> = sii.pdos(PdoDirection::Tx).map(|pdo| (pdo.index, pdo.sync_manager, pdo.bit_length())).collect();
    assert_eq!(pdos, [(0x1A00, Some(3), 16)]);
    assert_eq!(sii.pdos(PdoDirection::Rx).count(), 0);
    let modes: Vec<_> = sii.dc_modes().map(|mode| (mode.assign_activate, mode.sync0_cycle_factor)).collect();
    assert_eq!(modes, [(0x0300, 1)]);
}

// covers: codec-sii
#[test]
fn unknown_and_vendor_categories_are_kept_as_bytes() {
    let image = image(&CATEGORIES);
    let sii = Sii::parse(&image).unwrap();
    let others: Vec<_> = sii.categories().filter(|category| matches!(category.kind, CategoryKind::Other(_))).collect();
    let unknown = Category { kind: CategoryKind::Other(3), offset: 144, data: &[0xDE, 0xAD] };
    let vendor = Category { kind: CategoryKind::Other(0x8001), offset: 238, data: &[0xBE, 0xEF] };
    assert_eq!(others, [unknown, vendor]);
}

#[test]
fn an_image_may_end_after_its_last_category() {
    let image = image(&CATEGORIES[..144]);
    let sii = Sii::parse(&image).unwrap();
    assert!(!sii.end_marker);
    assert_eq!(sii.used(), image.len());
    assert_eq!(sii.dc_modes().count(), 1);
}

#[test]
fn bytes_after_the_end_marker_are_ignored() {
    let mut image = image(&CATEGORIES);
    let used = image.len();
    image.extend([0x0A, 0x00, 0xFF]);
    let sii = Sii::parse(&image).unwrap();
    assert_eq!((sii.used(), sii.end_marker, sii.categories().count()), (used, true, 9));
}

// covers: codec-sii
#[test]
fn an_invalid_image_is_refused_with_the_reason() {
    let good = image(&CATEGORIES);
    assert_eq!(Sii::parse(&good[..127]), Err(SiiError::Short { expected: 128, got: 127 }));
    let mut wrong = good.clone();
    wrong[14] ^= 0x10;
    assert!(matches!(Sii::parse(&wrong), Err(SiiError::Checksum { .. })));
    assert_eq!(Sii::parse(&good[..130]), Err(SiiError::CategoryHeader { offset: 128, got: 2 }));
    let cut = Sii::parse(&good[..140]).unwrap_err();
    assert_eq!(cut, SiiError::Category { kind: CategoryKind::Strings, offset: 128, expected: 12, got: 8 });
    assert_eq!(cut.to_string(), "SII category STRINGS at byte 128 announces 12 bytes, 8 are left");
}

// covers: codec-sii
#[test]
fn the_writer_creates_the_literal_image() {
    let expected = image(&CATEGORIES);
    let mut buffer = [0; 512];
    let mut writer = SiiWriter::new(&mut buffer, Sii::parse(&expected).unwrap().header()).unwrap();
    writer.strings(&["EL9999", "Bus"]).unwrap();
    writer.category(CategoryKind::Other(3), &[0xDE, 0xAD]).unwrap();
    let general = General {
        group: 2,
        order: 1,
        name: 1,
        coe: CoeDetails(0x23),
        ebus_current_ma: 100,
        group_again: 2,
        physical_ports: 0x0011,
        ..General::default()
    };
    writer.general(&general).unwrap();
    writer.fmmus(&[FmmuUsage::Outputs, FmmuUsage::Inputs, FmmuUsage::MailboxStatus]).unwrap();
    let sync_manager =
        |start, length, control, kind| SiiSyncManager { start, length, control, status: 0, enable: 1, kind };
    let outputs = sync_manager(0x1100, 2, 0x64, SyncManagerKind::Outputs);
    writer.sync_managers(&[outputs, sync_manager(0x1180, 4, 0x20, SyncManagerKind::Inputs)]).unwrap();
    writer.category(CategoryKind::Nop, &[]).unwrap();
    let entries = [PdoEntry { index: 0x6000, sub_index: 1, data_type: 6, bit_length: 16, ..PdoEntry::default() }];
    let pdo = PdoDescription {
        index: 0x1A00,
        sync_manager: Some(3),
        synchronisation: 0,
        name: 0,
        flags: 0,
        entries: &entries,
    };
    writer.pdos(PdoDirection::Tx, &[pdo]).unwrap();
    writer.category(CategoryKind::Other(0x8001), &[0xBE, 0xEF]).unwrap();
    let mode = DcMode { assign_activate: 0x0300, sync0_cycle_factor: 1, name: 2, ..DcMode::default() };
    writer.dc_modes(&[mode]).unwrap();
    let used = writer.finish().unwrap();
    assert_eq!(buffer[..used], expected);
    assert!(buffer[used..].iter().all(|byte| *byte == 0xFF));
}

#[test]
fn the_writer_refuses_items_that_do_not_fit() {
    let header = SiiHeader::default();
    let full = SiiWriter::new(&mut [0; 127], &header).unwrap_err();
    assert_eq!(full, SiiWriteError::Full { expected: 128, got: 127 });
    let mut buffer = [0; 134];
    let mut writer = SiiWriter::new(&mut buffer, &header).unwrap();
    assert_eq!(writer.category(CategoryKind::End, &[]), Err(SiiWriteError::EndMarker));
    assert_eq!(writer.general(&General::default()), Err(SiiWriteError::Full { expected: 164, got: 134 }));
    let long = String::from_utf8(std::vec![b'x'; 256]).unwrap();
    let too_many = SiiWriteError::TooMany { what: "characters in a string", got: 256 };
    assert_eq!(writer.strings(&[&long]), Err(too_many));
    let long = std::vec![0; 0x2_0000];
    let too_long = SiiWriteError::TooLong { kind: CategoryKind::Other(99), bytes: 0x2_0000 };
    assert_eq!(writer.category(CategoryKind::Other(99), &long), Err(too_long));
    // A refused category leaves the image unchanged.
    writer.category(CategoryKind::Other(99), &[7]).unwrap();
    assert_eq!(writer.finish(), Err(SiiWriteError::Full { expected: 136, got: 134 }));
    assert_eq!(buffer[128..], [99, 0, 1, 0, 7, 0]);
}

#[test]
fn a_disabled_check_stays_disabled() {
    let mut buffer = [0; 130];
    let header = SiiHeader { checksum: CHECKSUM_DISABLED, alias: 5, ..SiiHeader::default() };
    SiiWriter::new(&mut buffer, &header).unwrap().finish().unwrap();
    assert_eq!(Sii::parse(&buffer).unwrap().header(), &header);
}

type Content = (Vec<String>, Vec<u8>, Vec<[u8; 8]>, Vec<(u16, Option<u8>, Vec<[u8; 8]>)>, Vec<[u8; 24]>);

fn content() -> impl Strategy<Value = Content> {
    let sync_manager = prop_oneof![Just(None), (0_u8..0xFF).prop_map(Some)];
    let pdo = (any::<u16>(), sync_manager, vec(any::<[u8; 8]>(), 0..6));
    (
        vec("[a-zA-Z0-9 ]{0,20}", 0..8),
        vec(0_u8..0xFF, 0..9),
        vec(any::<[u8; 8]>(), 0..5),
        vec(pdo, 0..5),
        vec(any::<[u8; 24]>(), 0..4),
    )
}

proptest! {
    // covers: codec-sii
    #[test]
    fn any_bytes_are_parsed_without_panic(bytes in vec(any::<u8>(), 0..400)) {
        if let Ok(sii) = Sii::parse(&bytes) {
            read_everything(&sii);
        }
    }

    #[test]
    fn any_categories_after_a_valid_fixed_area_are_read_without_panic(
        parts in vec((
            prop_oneof![Just(10_u16), Just(30), Just(40), Just(41), Just(50), Just(51), Just(60), any::<u16>()],
            0_u16..40, vec(any::<u8>(), 0..80)), 0..8),
    ) {
        let mut categories = Vec::new();
        for (kind, words, data) in &parts {
            categories.extend(kind.to_le_bytes());
            // Some lengths are valid, others come from the generator.
            let right = data.len() as u16 / 2;
            categories.extend(if words % 4 == 0 { words } else { &right }.to_le_bytes());
            categories.extend(&data[..data.len() / 2 * 2]);
        }
        let image = image(&categories);
        if let Ok(sii) = Sii::parse(&image) {
            read_everything(&sii);
            prop_assert!(sii.used() <= image.len());
        }
    }

    // covers: codec-sii
    #[test]
    fn written_images_parse_back(content in content(), alias in any::<u16>(), general in any::<[u8; 32]>()) {
        let (strings, usages, sync_managers, pdos, modes) = content;
        let strings: Vec<&str> = strings.iter().map(String::as_str).collect();
        let usages: Vec<_> = usages.into_iter().map(FmmuUsage::from_code).collect();
        let sync_managers: Vec<_> = sync_managers.iter().map(SiiSyncManager::decode).collect();
        let modes: Vec<_> = modes.iter().map(DcMode::decode).collect();
        let general = General::decode(&general).unwrap();
        let entries: Vec<Vec<_>> = pdos.iter().map(|pdo| pdo.2.iter().map(PdoEntry::decode).collect()).collect();
        let descriptions: Vec<_> = pdos.iter().zip(&entries).map(|((index, sync_manager, _), entries)| PdoDescription {
            index: *index, sync_manager: *sync_manager, synchronisation: 1, name: 2, flags: 3, entries,
        }).collect();

        let header = SiiHeader { alias, ..SiiHeader::default() };
        let mut buffer = [0; 2048];
        let mut writer = SiiWriter::new(&mut buffer, &header).unwrap();
        writer.strings(&strings).unwrap();
        writer.general(&general).unwrap();
        writer.fmmus(&usages).unwrap();
        writer.sync_managers(&sync_managers).unwrap();
        writer.pdos(PdoDirection::Rx, &descriptions).unwrap();
        writer.dc_modes(&modes).unwrap();
        let used = writer.finish().unwrap();

        let sii = Sii::parse(&buffer).unwrap();
        prop_assert_eq!(sii.used(), used);
        prop_assert_eq!(*sii.header(), header.with_checksum());
        prop_assert!(sii.strings().iter().eq(strings.iter().map(|string| string.as_bytes())));
        prop_assert_eq!(sii.general(), Some(general));
        prop_assert!(sii.fmmu_usages().take(usages.len()).eq(usages.iter().copied()));
        prop_assert!(sii.sync_managers().eq(sync_managers));
        prop_assert!(sii.dc_modes().eq(modes));
        let read: Vec<_> = sii.pdos(PdoDirection::Rx).collect();
        prop_assert_eq!(read.len(), descriptions.len());
        for (pdo, description) in read.iter().zip(&descriptions) {
            prop_assert_eq!(pdo.index, description.index);
            prop_assert_eq!(pdo.sync_manager, description.sync_manager);
            prop_assert_eq!((pdo.synchronisation, pdo.name, pdo.flags), (1, 2, 3));
            prop_assert!(pdo.entries().eq(description.entries.iter().copied()));
        }
    }
}
