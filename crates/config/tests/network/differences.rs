//! A network compared with a file: each difference has one message.

use std::time::Duration;

use ringcat_config::network::Bytes;
use ringcat_config::network::model::{Pdo, Required, Sdo, Startup, SyncManager};
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

/// Of several SubDevices of one type, each is compared with its own declaration only.
// covers: network-file
#[test]
fn a_found_subdevice_has_the_modules_and_pdos_of_its_own_declaration() {
    let found = bus(&[1, 1, 1, 2]);
    let mut file = file_of(&found[..2]);
    let pdo = |index| SyncManager { pdo: vec![Pdo { index, ..Pdo::default() }], ..SyncManager::default() };
    file.subdevice[1].sync_manager.push(pdo(0x1A00));
    let ident = Sdo { index: 0xF030, sub: 1, data: Bytes(vec![1, 0, 0, 0]), complete: false };
    file.subdevice[1].startup = vec![Startup { sdo: Some(ident), ..Startup::default() }];
    let configuration = file.configuration();
    let counterparts = configuration.counterparts(&found, &file.stated());
    assert_eq!(counterparts, [Some(0), Some(1), None, None]);
    assert_eq!([0, 1].map(|config| configuration.declares_modules(config)), [false, true]);
    assert_eq!([0, 1].map(|config| configuration.has_unlisted_pdos(config, &found[config])), [false, true]);
    assert!(!configuration.declares_modules(2) && !configuration.has_unlisted_pdos(2, &found[2]));
}

/// The activation takes the mandatory one; the optional one is absent, and nothing is compared with it.
// covers: network-file
#[test]
fn of_two_equal_subdevices_the_optional_one_is_the_missing_one() {
    for (products, optional, there, missing) in [
        (&[1, 1][..], &[0][..], &[1][..], 0),
        (&[1, 1], &[1], &[1], 1),
        (&[1, 1], &[0, 1], &[1], 1),
        (&[5, 1, 1, 6], &[1], &[5, 1, 6], 1),
        (&[1, 1, 1, 2], &[0, 2], &[1, 1, 2], 2),
        // Both refuse an activation: the second one for its product.
        (&[1, 1, 2], &[0], &[1, 3], 0),
    ] {
        let mut file = file_of(&bus(products));
        optional.iter().for_each(|at| file.subdevice[*at].optional = true);
        for required in [Required::All, Required::Mandatory] {
            file.required = required;
            let all = differences(&file, &bus(there));
            let named: Vec<_> = all.iter().filter(|it| it.0 == Missing).collect();
            assert_eq!(named, [&(Missing, Some(missing), None)], "{products:?}, {optional:?}, {there:?}: {all:?}");
        }
    }
}
