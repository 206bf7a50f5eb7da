//! A network compared with a file: each difference has one message.

use std::time::{Duration, Instant};

use ringcat_config::network::model::{Pdo, SyncManager};
use ringcat_config::network::{NetworkFile, ScanOptions};
use ringcat_config::{DifferenceKind, FoundNetwork};
use ringcat_engine::Topology;
use ringcat_engine::info::SubDeviceInfo;
use ringcat_wire::address::Position;
use ringcat_wire::sii::Identity;

/// SubDevices of these products, at consecutive positions.
fn bus(products: &[u32]) -> Vec<SubDeviceInfo> {
    (0..)
        .zip(products)
        .map(|(position, product)| {
            let mut info = SubDeviceInfo::default();
            info.position = Position(position);
            info.identity = Identity { vendor_id: 7, product_code: *product, revision: 1, serial: 0 };
            info.name = format!("P{product}");
            info
        })
        .collect()
}

fn file_of(found: &[SubDeviceInfo]) -> NetworkFile {
    NetworkFile::from_scan(found, &Topology::default(), &ScanOptions::new("machine", Duration::from_millis(1)))
}

/// Kinds and indices in the file, with positions on the bus.
fn differences(file: &NetworkFile, found: &[SubDeviceInfo]) -> Vec<(DifferenceKind, Option<usize>, Option<u16>)> {
    let topology = Topology::default();
    let network = FoundNetwork::new(found, &topology);
    let all = file.configuration().differences(network, &file.stated());
    assert!(all.iter().all(|it| !it.text.is_empty()));
    all.into_iter().map(|it| (it.kind, it.subdevice.map(|at| at.0), it.position.map(|at| at.0))).collect()
}

use DifferenceKind::{Additional, Device, Missing, Order, Revision, Serial};

// covers: network-file
#[test]
fn one_missing_or_additional_subdevice_is_one_difference() {
    let file = file_of(&bus(&[1, 2, 3, 4, 4, 5]));
    assert_eq!(differences(&file, &bus(&[1, 2, 3, 4, 4, 5])), []);
    assert_eq!(differences(&file, &bus(&[1, 3, 4, 4, 5])), [(Missing, Some(1), None)]);
    assert_eq!(differences(&file, &bus(&[2, 3, 4, 4, 5])), [(Missing, Some(0), None)]);
    assert_eq!(differences(&file, &bus(&[1, 2, 9, 3, 4, 4, 5])), [(Additional, None, Some(2))]);
    assert_eq!(differences(&file, &bus(&[9, 1, 2, 3, 4, 4, 5])), [(Additional, None, Some(0))]);
    assert_eq!(differences(&file, &bus(&[1, 2, 9, 4, 4, 5])), [(Device, Some(2), Some(2))]);
    assert_eq!(differences(&file, &bus(&[1, 3, 2, 4, 4, 5])).len(), 1, "one of the two has moved");
    assert_eq!(differences(&file, &bus(&[2, 3, 4, 4, 5, 1])), [(Order, Some(0), Some(5))]);
    assert_eq!(differences(&file, &[]).len(), 6);
    assert_eq!(differences(&file_of(&[]), &bus(&[1, 2])).len(), 2);
}

/// Rows of alike devices between them could also be paired one place further.
// covers: network-file
#[test]
fn two_subdevices_swapped_around_a_row_are_one_difference() {
    for (file, found) in [
        ([1, 2, 2, 3, 3, 2], [2, 2, 2, 3, 3, 1]),
        ([4, 3, 2, 3, 1, 3], [3, 3, 2, 3, 1, 4]),
        ([2, 1, 1, 1, 1, 1], [1, 1, 1, 1, 1, 2]),
    ] {
        assert_eq!(differences(&file_of(&bus(&file)), &bus(&found)).len(), 1, "{file:?}, {found:?}");
    }
}

/// The order of the file is not that of the positions.
// covers: network-file
#[test]
fn positions_of_a_file_count_and_not_the_order_of_its_tables() {
    let mut file = file_of(&bus(&[1, 2, 3]));
    let places = |file: &mut NetworkFile, places: [u16; 3]| {
        for (subdevice, place) in file.subdevice.iter_mut().zip(places) {
            subdevice.position = Some(place);
        }
    };
    places(&mut file, [2, 0, 1]);
    assert_eq!(differences(&file, &bus(&[2, 3, 1])), []);
    assert_eq!(differences(&file, &bus(&[1, 2, 3])), [(Order, Some(0), Some(0))]);
    places(&mut file, [0, 1, 14]);
    assert_eq!(differences(&file, &bus(&[1, 2, 3])), [(Order, Some(2), Some(2))]);
}

// covers: network-file
#[test]
fn another_revision_or_serial_number_is_no_change_of_place() {
    let found = bus(&[1, 2, 3]);
    let mut file = file_of(&found);
    let mut other = found.clone();
    other[1].identity.revision = 2;
    assert_eq!(differences(&file, &other), [(Revision, Some(1), Some(1))]);
    file.subdevice[2].serial = Some(5);
    assert_eq!(differences(&file, &found), [(Serial, Some(2), Some(2))]);
}

// covers: network-file
#[test]
fn a_subdevice_with_an_alias_is_found_anywhere() {
    let mut found = bus(&[1, 2, 3]);
    found[0].alias = 8;
    let mut options = ScanOptions::new("machine", Duration::from_millis(1));
    options.by_alias = true;
    let mut file = NetworkFile::from_scan(&found, &Topology::default(), &options);
    let mut moved = bus(&[2, 3, 1]);
    moved[2].alias = 8;
    // One difference for the two that are not at their positions any more.
    assert_eq!(differences(&file, &moved), [(Order, Some(1), Some(0))]);
    for subdevice in &mut file.subdevice {
        (subdevice.position, subdevice.alias) = (None, Some(subdevice.product.unwrap_or_default() as u16 + 7));
    }
    for info in &mut moved {
        info.alias = info.identity.product_code as u16 + 7;
    }
    assert_eq!(differences(&file, &moved), []);
}

// covers: network-file
#[test]
fn large_different_networks_are_compared_in_bounded_time() {
    let file = file_of(&bus(&(0..6_000).map(|n| n % 50).collect::<Vec<_>>()));
    let found = bus(&(0..6_000).map(|n| (n + 1) % 49 + 1).collect::<Vec<_>>());
    let begin = std::time::Instant::now();
    assert!(!differences(&file, &found).is_empty());
    assert!(begin.elapsed() < Duration::from_secs(20), "{:?}", begin.elapsed());
}

/// Each found SubDevice is looked up by its device: not all declarations are compared with it.
// covers: network-file
#[test]
fn pdos_that_no_eeprom_lists_are_found_in_linear_time() {
    let count = 40_000;
    let mut found = bus(&(0..count).collect::<Vec<_>>());
    let mut file = file_of(&found);
    for (at, subdevice) in file.subdevice.iter_mut().enumerate() {
        let pdo = vec![Pdo { index: 0x1A00 + (at % 512) as u16, ..Pdo::default() }];
        subdevice.sync_manager.push(SyncManager { pdo, ..SyncManager::default() });
    }
    let configuration = file.configuration();
    let begin = Instant::now();
    let declared = configuration.declared_pdos(&file.stated());
    assert!(found.iter().all(|info| declared.are_unlisted(info)));
    assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
    found[0].identity.product_code = count;
    assert!(!declared.are_unlisted(&found[0]), "the file has no such device");
    // A declaration without a product is for any.
    file.subdevice[1].product = None;
    assert!(file.configuration().declared_pdos(&file.stated()).are_unlisted(&found[0]));
}
