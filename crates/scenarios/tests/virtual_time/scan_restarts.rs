//! A scan under way is ended by a call, at every moment, and begins anew.

use std::time::Duration;

use ringcat::shared_segment::SharedSegment;
use ringcat::{JunctionMode, MainDevice, Options, Position, SupervisorThread};
use ringcat_sim::cable::{DeviceIndex, HostLink};
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::al::{AlState, AlStatus};
use ringcat_wire::register::map;
use scenarios::segments::{descriptions, line, ring};
use scenarios::tap::Tap;

const KINDS: [&str; 6] = ["coupler", "servo", "digital-output-8", "servo", "emulated-input-8", "analog-input-4"];
const SERVO: Position = Position(1);

fn networks() -> [Network; 2] {
    [line, ring].map(|network| network(descriptions(&KINDS), NetworkOptions::default()))
}

fn options(with_idle: bool) -> Options {
    Options::default()
        .with_idle_operation(with_idle)
        .with_junctions(JunctionMode::Automatic)
        .with_enhanced_line_crossed(true)
}

/// How long a scan takes.
fn duration(network: Network) -> Duration {
    let mut main_device = MainDevice::request(Tap::new(network), &options(false));
    let begun = main_device.now();
    main_device.scan().expect("a scan");
    main_device.now().since(begun)
}

/// Works for a time without anything that waits.
fn work(main_device: &mut MainDevice<Tap>, time: Duration) {
    main_device.attend(time);
}

/// All are found, in INIT or on their way, with addresses of their own, open ports, and they answer.
fn assert_whole(main_device: &mut MainDevice<Tap>, text: &str) {
    let network = main_device.links_mut().network();
    let stations: Vec<Vec<u8>> =
        network.devices().map(|device| device.controller.register(map::STATION_ADDRESS, 2).to_vec()).collect();
    let loops: Vec<u8> = network.devices().map(|device| device.controller.register(map::DL_CONTROL, 2)[1]).collect();
    assert!(loops.iter().all(|control| *control == 0), "{text}: {loops:02x?}");
    for (at, info) in main_device.subdevices().iter().enumerate() {
        assert_eq!(stations[at], info.station.0.to_le_bytes(), "{text}: {at}");
    }
    let vendor = main_device.subdevice(SERVO).sdo_read::<u32>(0x1018, 1).expect(text);
    assert_eq!(vendor, main_device.subdevices()[1].identity.vendor_id);
}

// covers: scan
#[test]
fn a_requested_scan_begins_anew_at_every_moment() {
    for at in 0..2 {
        let whole = duration(networks().into_iter().nth(at).expect("two"));
        let mut after = Duration::ZERO;
        let mut ended = 0;
        while after < whole {
            for with_idle in [false, true] {
                let network = networks().into_iter().nth(at).expect("two");
                let mut main_device = MainDevice::request(Tap::new(network), &options(with_idle));
                main_device.engine_mut().restart_scan().expect("none is under way");
                work(&mut main_device, after);
                ended += u32::from(main_device.engine().scan_result().is_none());
                let begun = main_device.now();
                let scan = main_device.restart_scan().expect("it ends");
                let took = main_device.now().since(begun);
                let text = format!("network {at}, idle {with_idle}, after {after:?}");
                assert_eq!(scan.subdevices.len(), KINDS.len(), "{text}");
                assert!(took < whole + whole / 2, "{text}: {took:?} instead of {whole:?}");
                assert_whole(&mut main_device, &text);
            }
            after += Duration::from_micros(730);
        }
        assert!(ended > 20, "scans were ended: {ended}");
    }
}

/// Interfaces take long to establish a link: a scan meanwhile would find the ring open.
// covers: scan, crossed-enhanced
#[test]
fn a_scan_waits_for_the_link_that_the_ended_one_has_taken_down() {
    let mut were_down = 0;
    for step in 0..40 {
        let network = NetworkOptions::default().with_detection_delay(Duration::from_millis(200));
        let mut main_device = MainDevice::request(Tap::new(ring(descriptions(&KINDS), network)), &options(false));
        main_device.engine_mut().restart_scan().expect("none is under way");
        let end = main_device.now() + Duration::from_secs(1);
        while main_device.links_mut().network().carrier(HostLink::Redundant) && main_device.now() < end {
            work(&mut main_device, Duration::from_micros(200));
        }
        work(&mut main_device, Duration::from_millis(10 * step));
        if main_device.engine().scan_result().is_some() {
            continue;
        }
        were_down += u32::from(!main_device.links_mut().network().carrier(HostLink::Redundant));
        let scan = main_device.restart_scan().expect("it ends");
        assert!(main_device.links_mut().network().carrier(HostLink::Redundant), "step {step}");
        let last = scan.subdevices[KINDS.len() - 1].dl_status.ports[1].communication;
        assert!(last, "step {step}: the ring is found open");
        assert_whole(&mut main_device, "restarted");
    }
    assert!(were_down > 5, "the link was down: {were_down}");
}

// covers: scan, states
#[test]
fn a_scan_of_idle_operation_begins_anew_and_all_reach_preop() {
    for at in 0..2 {
        for step in 0..40 {
            let network = networks().into_iter().nth(at).expect("two");
            let mut main_device = MainDevice::request(Tap::new(network), &options(true));
            work(&mut main_device, Duration::from_micros(19_000 + 1_100 * step));
            assert_eq!(main_device.restart_scan().expect("it ends").subdevices.len(), KINDS.len(), "{step}");
            main_device.attend(Duration::from_millis(600));
            let preop = AlStatus::new(AlState::PreOp);
            let statuses: Vec<AlStatus> =
                main_device.links_mut().network().devices().map(|device| device.al_status()).collect();
            assert_eq!(statuses, [preop; KINDS.len()], "network {at}, step {step}");
            assert_whole(&mut main_device, "idle");
        }
    }
}

/// An EEPROM that answers slowly would delay the result: another scan does not wait for it.
// covers: scan, slow-eeproms
#[test]
fn a_scan_that_waits_for_an_eeprom_is_ended_when_it_is_no_longer_slow() {
    let mut network = line(descriptions(&["coupler", "servo"]), NetworkOptions::default());
    network.device_mut(DeviceIndex(1)).controller.slow_sii(Duration::from_millis(9), u32::MAX);
    let usual = duration(line(descriptions(&["coupler", "servo"]), NetworkOptions::default()));
    let mut main_device = MainDevice::request(Tap::new(network), &options(false));
    main_device.engine_mut().start_scan().expect("none is under way");
    main_device.attend(4 * usual);
    assert!(main_device.engine().scan_result().is_none(), "it is being read");
    assert!(main_device.engine_mut().start_scan().is_err(), "another scan is refused");
    let network = main_device.links_mut().network_mut();
    network.device_mut(DeviceIndex(1)).controller.slow_sii(Duration::ZERO, 0);
    let begun = main_device.now();
    assert_eq!(main_device.restart_scan().expect("it ends").subdevices.len(), 2);
    let took = main_device.now().since(begun);
    assert!(took < 3 * usual, "{took:?} instead of {usual:?}");
}

// covers: scan
#[test]
fn a_scan_of_another_thread_gives_the_result_of_the_one_that_ended_it() {
    let (_, acyclic) = SharedSegment::halves(line(descriptions(&KINDS), NetworkOptions::default()));
    let supervisor = SupervisorThread::start(acyclic, &options(true), || ()).expect("a thread");
    let other = supervisor.clone();
    let waiting = std::thread::spawn(move || other.restart_scan().map(|scan| scan.subdevices.len()));
    for _ in 0..10 {
        assert_eq!(supervisor.restart_scan().expect("it ends").subdevices.len(), KINDS.len());
    }
    assert_eq!(waiting.join().expect("no panic").expect("a result"), KINDS.len());
}
