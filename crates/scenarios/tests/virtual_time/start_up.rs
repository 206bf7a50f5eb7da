//! Power-on to OP: SubDevices that appear one after the other, and the duration (protocol 5.6).

use std::time::Duration;

use ringcat::{Error, Event, Links, MainDevice, Options, ScanError, SubDeviceInfo};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::device::Device;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_sim::time::SimTime;
use scenarios::phases::{ENDS, End, bring_up, start_up};
use scenarios::segments::{describe, descriptions, drives, line, plant};
use scenarios::tap::Tap;

const KINDS: [&str; 5] = ["coupler", "digital-output-8", "servo", "digital-input-8", "digital-output-8"];

/// Devices from this number on are switched on late, one after the other.
fn slow_to_appear(from: usize, pause: Duration) -> Network {
    let mut network = line(descriptions(&KINDS), NetworkOptions::default());
    for (late, device) in (from..KINDS.len()).enumerate() {
        network.apply(Fault::PowerOff(DeviceIndex(device)));
        let at = pause * (late as u32 + 1);
        network.schedule(SimTime(at.as_nanos() as u64), Fault::PowerOn(DeviceIndex(device)));
    }
    network
}

// covers: scan
#[test]
fn subdevices_that_appear_while_the_first_are_read_are_all_found() {
    for pause_us in [300, 1_100, 2_500, 4_500] {
        for from in 0..KINDS.len() {
            let network = slow_to_appear(from, Duration::from_micros(pause_us));
            let mut tap = Tap::new(network);
            tap.set_limit(tap.now() + Duration::from_secs(1));
            let options = Options::default().with_sii_cache(false);
            let mut main_device = MainDevice::request(tap, &options);
            let mut counts = Vec::new();
            let scan = main_device.scan_with(|timed| {
                if let Event::Counted { main, .. } = timed.event {
                    counts.push(main);
                }
            });
            let found = scan.unwrap_or_else(|error| panic!("{pause_us} us, from {from}: {error}"));
            let names: Vec<&str> = found.subdevices.iter().map(|info| info.name.as_str()).collect();
            let expected: Vec<String> = KINDS.iter().enumerate().map(|(at, kind)| format!("{kind}-{at}")).collect();
            assert_eq!((names, counts), (expected.iter().map(String::as_str).collect(), vec![5]), "{pause_us} us");
            assert!(found.subdevices.iter().all(|info| info.warnings.is_empty()));
        }
    }
}

// covers: scan
#[test]
fn a_scan_that_has_read_everything_waits_until_the_count_has_settled() {
    let options = Options::default().with_settle(Duration::from_millis(200));
    let network = line(descriptions(&KINDS), NetworkOptions::default());
    let mut main_device = MainDevice::request(Tap::new(network), &options);
    assert_eq!(main_device.scan().expect("all are there").subdevices.len(), 5);
    let now = main_device.links_mut().now();
    assert!((200_000_000..202_000_000).contains(&now.0), "{now:?}");
}

// covers: scan
#[test]
fn a_count_that_never_settles_ends_the_scan_after_its_limit() {
    let mut network = line(descriptions(&KINDS), NetworkOptions::default());
    for ms in (3..200).step_by(6) {
        network.schedule(SimTime(ms * 1_000_000), Fault::PowerOff(DeviceIndex(4)));
        network.schedule(SimTime((ms + 3) * 1_000_000), Fault::PowerOn(DeviceIndex(4)));
    }
    let mut tap = Tap::new(network);
    tap.set_limit(tap.now() + Duration::from_secs(1));
    let options = Options::default().with_patience(Duration::from_millis(100));
    let mut main_device = MainDevice::request(tap, &options);
    match main_device.scan() {
        Err(Error::Scan(ScanError::Unsettled { .. })) => {}
        other => panic!("{other:?}"),
    }
    let now = main_device.links_mut().now();
    assert!((100_000_000..130_000_000).contains(&now.0), "{now:?}");
}

// covers: scan
#[test]
fn fifty_subdevices_are_in_op_after_52_ms_and_one_after_34() {
    for (count, limit) in [(1, 34), (10, 28), (50, 52)] {
        let phases = start_up(plant(count), &Options::default(), Duration::from_millis(1)).expect("they start");
        let op = phases.iter().find(|phase| matches!(phase.end, End::State(ringcat_wire::al::AlState::Op)));
        let at = op.expect("the last phase").at;
        assert!(at <= Duration::from_millis(limit), "{count} SubDevices: {at:?}");
    }
}

// covers: scan
#[test]
fn drives_are_in_op_after_25_to_40_ms_with_default_options_in_one_step() {
    for (count, limit) in [(1, 25), (10, 30), (50, 35), (100, 40)] {
        let phases = bring_up(drives(count), &Options::default(), Duration::from_millis(1)).expect("they start");
        let ends: Vec<End> = phases.iter().map(|phase| phase.end).collect();
        let last = phases.last().expect("all phases");
        assert_eq!(ends, ENDS);
        println!("{count} drives: {:?}", last.at);
        assert!(last.at <= Duration::from_millis(limit), "{count} drives: {:?}", last.at);
    }
}

/// Eight drives of one type with these names, the categories of one of them changed at a byte of a PDO.
fn alike(names: impl Fn(usize) -> String, changed: Option<usize>) -> Network {
    let device = |number: usize| {
        let mut drive = describe("servo", &names(number));
        if changed == Some(number) {
            let mut image = Device::new(drive.clone()).controller.sii_image().to_vec();
            let index = image.windows(2).position(|word| word == [0x01, 0x1A]).expect("the drive has a PDO 0x1A01");
            image[index] = 0x02;
            drive.sii_image = Some(image);
        }
        drive
    };
    line((0..8).map(device).collect(), NetworkOptions::default())
}

/// What a scan finds, and the time that it takes.
fn scanned(network: Network, cache: bool) -> (Vec<SubDeviceInfo>, Duration) {
    let mut main_device = MainDevice::request(Tap::new(network), &Options::default().with_sii_cache(cache));
    let found = main_device.scan().expect("all are there").subdevices;
    (found, Duration::from_nanos(main_device.links_mut().now().0))
}

// covers: scan
#[test]
fn subdevices_of_one_type_share_the_reading_of_their_sii() {
    for (names, limit_ms) in [((|_| "drive".to_owned()) as fn(usize) -> String, 22), (|at| format!("drive-{at}"), 26)] {
        let (alone, alone_took) = scanned(alike(names, None), false);
        let (shared, shared_took) = scanned(alike(names, None), true);
        println!("{alone_took:?} without sharing, {shared_took:?} with it");
        assert_eq!(shared.len(), 8);
        for (one, other) in shared.iter().zip(&alone) {
            assert_eq!((&one.pdos, &one.sync_managers, &one.warnings), (&other.pdos, &other.sync_managers, &vec![]));
            assert!(alone.iter().any(|any| any.name == one.name), "{}", one.name);
        }
        assert!(alone_took > Duration::from_millis(36), "{alone_took:?}");
        assert!(shared_took < Duration::from_millis(limit_ms), "{shared_took:?}");
    }
}

// covers: scan
#[test]
fn one_bad_eeprom_never_changes_what_is_known_of_the_others() {
    let (good, _) = scanned(alike(|_| "drive".to_owned(), None), false);
    for changed in 0..8 {
        let (found, took) = scanned(alike(|_| "drive".to_owned(), Some(changed)), true);
        for (number, (found, good)) in found.iter().zip(&good).enumerate() {
            assert!(number == changed || found.pdos == good.pdos, "drive {number}, changed {changed}");
        }
        println!("changed {changed}: {took:?}");
        assert!(took < Duration::from_millis(85), "at most every SII is read twice: {took:?}");
    }
}
