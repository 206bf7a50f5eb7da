//! Power-on to OP: SubDevices that appear one after the other, and the duration (protocol 5.6).

use std::time::Duration;

use ringcat::{Error, Event, Links, MainDevice, Options, ScanError};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_sim::time::SimTime;
use scenarios::phases::{End, start_up};
use scenarios::segments::{descriptions, line, plant};
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
fn fifty_subdevices_are_in_op_after_60_ms_and_one_after_34() {
    for (count, limit) in [(1, 34), (10, 40), (50, 60)] {
        let phases = start_up(plant(count), &Options::default(), Duration::from_millis(1)).expect("they start");
        let op = phases.iter().find(|phase| matches!(phase.end, End::State(ringcat_wire::al::AlState::Op)));
        let at = op.expect("the last phase").at;
        assert!(at <= Duration::from_millis(limit), "{count} SubDevices: {at:?}");
    }
}
