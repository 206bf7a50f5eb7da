//! Failures of a SubDevice, its application or the whole segment, their reports and the recovery.

use std::time::Duration;

use ringcat::{Declaration, Error, Event, Options, Scan, ScanError, SubDeviceId, SubDeviceState, Timeouts, automatic};
use ringcat_sim::cable::{CableId, DeviceIndex, Endpoint, HostLink};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::builder::SegmentBuilder;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_sim::time::SimTime;
use ringcat_wire::address::StationAddress;
use ringcat_wire::al::{AlState, AlStatus, AlStatusCode};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::frame::{FrameBuilder, MacAddress};
use ringcat_wire::register::map;
use scenarios::check::{Delivery, ring_events, troubles};
use scenarios::segments::{SIXTEEN, descriptions, line, ring, ring_of_16};
use scenarios::world::{CYCLE, World};

const FAST: Duration = Duration::from_micros(10);
const LIMIT: Duration = Duration::from_secs(5);

fn all_well(world: &World) -> bool {
    world.all_in_op() && world.application().all_settled()
}

// covers: refused-states
#[test]
fn after_an_application_stall_all_subdevices_return_to_op() {
    for network in [ring_of_16(FAST), line(descriptions(&SIXTEEN), NetworkOptions::default())] {
        let mut world = World::in_op(1, network);
        world.run_cycles(50);
        let mark = world.mark();
        world.stall(Duration::from_millis(150));
        world.cycle();
        let watched: Vec<usize> = world.left_op(mark).iter().map(|device| device.0).collect();
        let (outputs, drives) = ([2, 6, 7, 12, 13], [4, 15]);
        assert!(outputs.iter().chain(&drives).all(|device| watched.contains(device)), "{watched:?} fell");
        for step in world.steps(mark) {
            assert_eq!(
                (step.to, step.code),
                (AlStatus::with_error(AlState::SafeOp), AlStatusCode::SYNC_MANAGER_WATCHDOG)
            );
        }
        world.until(LIMIT, "all back in OP", all_well);
        world.run_cycles(20);
        for subdevice in watched {
            let fell = |event: &Event| {
                matches!(event, Event::StateError { subdevice: fallen, requested: None, code, .. }
                    if *fallen == SubDeviceId(subdevice) && *code == AlStatusCode::SYNC_MANAGER_WATCHDOG)
            };
            assert!(world.saw(mark, fell), "{subdevice} is named with its code");
        }
        assert_eq!(world.evaluated(mark).last().map(|evaluated| evaluated.delivery), Some(Delivery::Complete));
        assert_eq!(ring_events(world.events(mark)), Vec::<&Event>::new());
    }
}

// covers: refused-states
#[test]
fn every_watchdog_expiry_is_reported_once() {
    for network in [ring_of_16(FAST), line(descriptions(&SIXTEEN), NetworkOptions::default())] {
        let mut world = World::in_op(10, network);
        world.run_cycles(50);
        for round in 0..3 {
            let mark = world.mark();
            world.stall(Duration::from_millis(150));
            world.until(LIMIT, "all back in OP", all_well);
            world.run_cycles(1_100);
            let mut fell: Vec<usize> = world.left_op(mark).iter().map(|device| device.0).collect();
            fell.sort_unstable();
            let reports = troubles(world.events(mark)).into_iter().map(|event| match event {
                Event::StateError { subdevice, requested: None, code: AlStatusCode::SYNC_MANAGER_WATCHDOG, .. } => {
                    subdevice.0
                }
                other => panic!("{other:?}"),
            });
            let mut reports: Vec<usize> = reports.collect();
            reports.sort_unstable();
            assert_eq!(reports, fell, "round {round}");
            assert!(!fell.is_empty());
        }
    }
}

#[test]
fn a_hanging_subdevice_application_in_op_does_not_affect_others() {
    let mut world = World::in_op(2, ring_of_16(FAST));
    let mark = world.mark();
    world.hang(DeviceIndex(4), true);
    world.run_cycles(300);
    world.hang(DeviceIndex(4), false);
    world.run_cycles(50);
    world.until(LIMIT, "all in OP", all_well);
    let left: Vec<usize> = world.left_op(mark).iter().map(|device| device.0).collect();
    assert!(left.iter().all(|device| *device == 4), "{left:?}");
    assert_eq!(world.incomplete(mark), 0);
}

/// All SubDevices as found, with short time limits.
fn impatient(scan: &Scan) -> Declaration {
    let short = Duration::from_millis(40);
    let timeouts = Timeouts::default().with_preop(short).with_safeop_op(short).with_back_to_init(short).with_sdo(short);
    let mut declaration = automatic(&scan.subdevices, CYCLE);
    for config in &mut declaration.subdevices {
        *config = config.clone().timeouts(timeouts);
    }
    declaration
}

#[test]
fn a_subdevice_hanging_during_configuration_is_reported_and_retried() {
    for after in [0, 1, 2, 3] {
        let mut world = World::with(after, ring_of_16(FAST), &Options::default(), impatient).expect("activation");
        world.run_cycles(after);
        world.hang(DeviceIndex(3), true);
        world.run_cycles(100);
        assert!(matches!(world.application().states()[3], SubDeviceState::Configuring));
        world.hang(DeviceIndex(3), false);
        world.until(LIMIT, "all in OP", all_well);
        let named = |event: &Event| {
            matches!(event, Event::ConfigurationFailed { subdevice: SubDeviceId(3), reason }
            if reason.contains("within 40 ms"))
        };
        assert!(world.saw(world.beginning(), named));
        assert_eq!(world.left_op(world.beginning()), []);
    }
}

// covers: refused-states
#[test]
fn a_refused_transition_is_reported_with_its_code_and_retried() {
    for to in [AlState::PreOp, AlState::SafeOp, AlState::Op] {
        for (device, times) in [(2, 1), (4, 2), (13, 3)] {
            let mut network = ring_of_16(FAST);
            let code = AlStatusCode(0x8000 + device as u16);
            network.apply(Fault::RefuseTransition { device: DeviceIndex(device), to, code, times });
            let mut world = World::new(3, network);
            world.until(LIMIT, "all in OP", all_well);
            let refused = world.events(world.beginning()).iter().filter(|timed| {
                matches!(timed.event, Event::StateError { subdevice, requested, code: got, .. }
                    if subdevice == SubDeviceId(device) && requested == Some(to) && got == code)
            });
            assert_eq!(refused.count(), times as usize, "device {device} refuses {to}");
            assert_eq!(troubles(world.events(world.beginning())).len(), times as usize);
            assert!(world.left_op(world.beginning()).is_empty());
        }
    }
}

// covers: refused-states
#[test]
fn a_subdevice_that_refuses_for_long_does_not_delay_others() {
    let mut network = ring_of_16(FAST);
    let code = AlStatusCode::INVALID_INPUT_MAPPING;
    network.apply(Fault::RefuseTransition { device: DeviceIndex(3), to: AlState::SafeOp, code, times: 1_000 });
    let mut world = World::new(4, network);
    world.run_cycles(3_000);
    let states = world.application().states();
    assert_eq!(states.iter().filter(|state| **state == SubDeviceState::Settled(AlState::Op)).count(), 15);
    // The pause between attempts grows, which limits the number of events.
    let errors = troubles(world.events(world.beginning())).len();
    assert!((3..12).contains(&errors), "{errors} events");
    let last = world.evaluated(world.beginning()).last().expect("cycles went by");
    assert_eq!((last.delivery, last.stale.as_slice()), (Delivery::WithoutAbsent, [3].as_slice()));
}

// covers: refused-states
#[test]
fn a_corrupt_sii_is_reported_with_expected_and_read_value() {
    // Byte 16 is the first of the vendor id in word 8, byte 14 the checksum (protocol 4.1).
    let mut network = ring_of_16(FAST);
    network.apply(Fault::CorruptSii { device: DeviceIndex(2), offset: 14, mask: 0x40 });
    network.apply(Fault::CorruptSii { device: DeviceIndex(5), offset: 16, mask: 0x80 });
    let declare = |scan: &Scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        declaration.subdevices[5] = declaration.subdevices[5].clone().expect_product(0x0C47, 0x03F0_0010);
        declaration
    };
    let failed = World::with(5, network, &Options::default(), declare).expect_err("the vendor id differs");
    let text = failed.to_string();
    assert!(text.contains("expected vendor id 0x00000c47, got 0x00000cc7"), "{text}");
}

#[test]
fn a_wrong_sii_checksum_is_reported_and_does_not_affect_others() {
    let mut network = ring_of_16(FAST);
    network.apply(Fault::CorruptSii { device: DeviceIndex(2), offset: 14, mask: 0x40 });
    let mut world = World::with(6, network, &Options::default(), impatient).expect("activation");
    world.run_cycles(200);
    let start = world.beginning();
    let reports = |event: &Event| {
        matches!(event, Event::SiiWarning { position, what }
        if position.0 == 2 && what.contains("checksum: expected"))
    };
    assert!(world.saw(start, reports));
    // The controller does not load such an EEPROM, and without it the application does not run (protocol 4.7).
    let named = |event: &Event| {
        matches!(event, Event::ConfigurationFailed { subdevice: SubDeviceId(2), reason }
        if reason.contains("expected PREOP"))
    };
    assert!(world.saw(start, named));
    let op = AlStatus::new(AlState::Op);
    assert!(world.network().devices().enumerate().all(|(number, device)| number == 2 || device.al_status() == op));
}

fn impatiently() -> Options {
    Options::default().with_patience(Duration::from_millis(300))
}

fn scan_error(network: Network) -> ScanError {
    match World::with(7, network, &impatiently(), |scan| automatic(&scan.subdevices, CYCLE)) {
        Err(Error::Scan(error)) => error,
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("there is nothing to scan"),
    }
}

#[test]
fn connected_links_without_subdevices_differ_from_dead_links() {
    let (main, redundant) = (Endpoint::Host(HostLink::Main), Endpoint::Host(HostLink::Redundant));
    let joined = SegmentBuilder::new().cable(main, redundant).build().expect("two links");
    let error = scan_error(joined);
    assert_eq!(error, ScanError::NoSubDevices);
    assert_eq!(error.to_string(), "frames return, but no SubDevice processes them");
    let nothing = SegmentBuilder::new().build().expect("nothing");
    assert_eq!(scan_error(nothing), ScanError::NoAnswer);
    let mut cut = ring(descriptions(&SIXTEEN), NetworkOptions::default());
    cut.cut(CableId(0));
    cut.cut(CableId(16));
    let error = scan_error(cut);
    assert_eq!(error, ScanError::NoAnswer);
    assert!(error.to_string().contains("is the cable plugged"), "{error}");
}

#[test]
fn a_count_that_does_not_settle_is_an_error_with_the_counts() {
    for network in [ring_of_16(FAST), line(descriptions(&SIXTEEN), NetworkOptions::default())] {
        let mut network = network;
        for tick in 0..200 {
            let device = DeviceIndex(9);
            let fault = if tick % 2 == 0 { Fault::PowerOff(device) } else { Fault::PowerOn(device) };
            network.schedule(SimTime::from_micros(1_000 + 3_500 * tick), fault);
        }
        let error = scan_error(network);
        assert!(matches!(error, ScanError::Unsettled { .. }), "{error:?}");
        assert!(error.to_string().starts_with("the number of SubDevices does not settle: "), "{error}");
    }
}

// covers: recovery
#[test]
fn a_whole_segment_that_loses_power_recovers_automatically() {
    for ring in [true, false] {
        let network = if ring { ring_of_16(FAST) } else { line(descriptions(&SIXTEEN), NetworkOptions::default()) };
        let mut world = World::in_op(8, network);
        for device in 0..SIXTEEN.len() {
            world.power_off(DeviceIndex(device));
        }
        world.run_cycles(300);
        for device in 0..SIXTEEN.len() {
            world.power_on(DeviceIndex(device));
        }
        world.until(LIMIT, "all in OP", all_well);
        world.run_cycles(20);
        let last = world.evaluated(world.beginning()).last().map(|evaluated| evaluated.delivery);
        assert_eq!(last, Some(Delivery::Complete));
        assert!(!world.saw(world.beginning(), |event| matches!(event, Event::Unexpected { .. })));
    }
}

/// A frame of another MainDevice that clears the first FMMU of a station.
fn fmmu_thief(station: u16) -> Vec<u8> {
    let source = MacAddress([0x00, 0x00, 0x5E, 0x00, 0x53, 0x77]);
    let mut bytes = vec![0; 100];
    let length = {
        let mut builder = FrameBuilder::ethernet(&mut bytes, MacAddress::ETHERCAT_GROUP, source).expect("room");
        let target = Target::Station(StationAddress(station), map::FMMU_BASE);
        builder.datagram(Command::Fpwr, 0, target, 16).expect("room");
        builder.finish()
    };
    bytes.truncate(length);
    bytes
}

// covers: refused-states
#[test]
fn a_subdevice_in_op_without_fmmus_is_detected_and_reconfigured() {
    let mut world = World::in_op(9, ring_of_16(FAST));
    let mark = world.mark();
    let frame = fmmu_thief(0x1001 + 1);
    world.network_mut().send(HostLink::Main, &frame);
    world.run_cycles(20);
    assert!(world.all_in_op());
    assert!(world.evaluated(mark).last().expect("cycles went by").delivery.is_incomplete());
    world.run_cycles(1_200);
    assert_eq!(world.evaluated(mark).last().map(|evaluated| evaluated.delivery), Some(Delivery::Complete));
    let named = |event: &Event| match event {
        Event::ConfigurationFailed { subdevice: SubDeviceId(1), reason } => reason.contains("FMMU"),
        _ => false,
    };
    assert!(world.saw(mark, named));
    assert!(world.left_op(mark).iter().all(|device| device.0 == 1));
}
