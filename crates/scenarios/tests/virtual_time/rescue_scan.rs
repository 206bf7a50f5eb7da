//! The rescue scan: a scan on request without an application disturbs no SubDevice that has stayed; evaluated by the
//! SubDevices and by the frames on the links.

use std::time::Duration;

use ringcat::{
    AlState, EngineKey, Identified, Limits, MainDevice, Options, Position, RegisterAddress, Rescan, SdoAddress,
    ServiceError, Services, StationAddress,
};
use ringcat_sim::cable::{CableId, DeviceIndex, HostLink};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::al::AlStatus;
use ringcat_wire::command::Addressing;
use ringcat_wire::frame::Frame;
use ringcat_wire::register::map;
use scenarios::segments::{descriptions, line, ring};
use scenarios::tap::Tap;
use scenarios::uploads::start_upload;
use scenarios::witness::{Frames, Passed, Witness};

const FOLLOWED: Duration = Duration::from_millis(400);
const LIMIT: Duration = Duration::from_secs(2);
const PREOP: AlStatus = AlStatus::new(AlState::PreOp);
/// A drive with an object of 100,000 bytes.
const TALKER: Position = Position(1);
const LARGE: SdoAddress = SdoAddress::new(0x2002, 0);
const LIMITS: Limits = Limits::new(Duration::from_secs(1), Duration::from_secs(5));
/// Registers of the EEPROM interface.
const SII: std::ops::Range<u16> = 0x0500..0x0510;

type Watched = MainDevice<Witness<Tap>>;

/// Segments of several sizes, with the talker at position 1.
fn networks() -> Vec<Network> {
    let options = || NetworkOptions::default().with_detection_delay(Duration::from_micros(10));
    let kinds = |count: usize| -> Vec<&str> {
        let others = ["digital-output-8", "servo", "digital-input-8", "all-protocols"].into_iter().cycle();
        ["coupler", "all-protocols"].into_iter().chain(others).take(count).collect()
    };
    let of = |count| [line(descriptions(&kinds(count)), options()), ring(descriptions(&kinds(count)), options())];
    [3, 7, 40].into_iter().flat_map(of).collect()
}

fn idle(network: Network) -> (Watched, Frames) {
    let (links, frames) = Witness::new(Tap::new(network));
    let mut main_device = MainDevice::request(links, &Options::default().with_idle_operation(true));
    main_device.attend(2 * FOLLOWED);
    while main_device.pop_event().is_some() {}
    assert!(statuses(&mut main_device).iter().all(|status| *status == PREOP));
    (main_device, frames)
}

fn network(main_device: &mut Watched) -> &mut Network {
    main_device.links_mut().links_mut().network_mut()
}

fn statuses(main_device: &mut Watched) -> Vec<AlStatus> {
    network(main_device).devices().map(|device| device.al_status()).collect()
}

/// Station addresses in the SubDevices themselves.
fn stations(main_device: &mut Watched) -> Vec<StationAddress> {
    let station = |device: &ringcat_sim::device::Device| {
        let bytes = device.controller.register(map::STATION_ADDRESS, 2);
        StationAddress(u16::from_le_bytes([bytes[0], bytes[1]]))
    };
    network(main_device).devices().map(station).collect()
}

/// Whether a frame writes AL control of one of these SubDevices or of all, or touches the EEPROM of one of these.
fn disturbs(passed: &Passed, stayed: &[StationAddress]) -> bool {
    let Ok(frame) = Frame::parse(&passed.frame) else { return false };
    let is_addressed = |addressing, adp| match addressing {
        Addressing::Broadcast => true,
        Addressing::Station => stayed.contains(&StationAddress(adp)),
        _ => false,
    };
    let mut datagrams = frame.datagrams();
    passed.is_sent
        && datagrams.any(|it| {
            let (command, RegisterAddress(register)) = (it.header.command, it.header.ado());
            let is_control = command.writes() && register == map::AL_CONTROL.0;
            let is_to_them = is_addressed(command.addressing(), it.header.adp());
            is_to_them && (is_control || SII.contains(&register))
        })
}

/// A rescan beside the read of a large object, and whether that was still running when the rescan ended.
fn rescan_beside_a_transfer(main_device: &mut Watched) -> (Rescan, usize, bool) {
    let both = Services::call(main_device, EngineKey, |engine| {
        let read = start_upload(engine, TALKER, LARGE, LIMITS, 200_000);
        let rescan = engine.start_rescan(LIMIT);
        engine.start(async move {
            let rescan = rescan.ended().await?;
            let was_running = read.is_running();
            let bytes = read.ended().await.map(|data| data.len()).unwrap_or_default();
            Ok::<_, ServiceError>((rescan, bytes, was_running))
        })
    });
    both.expect("the segment is stable")
}

// covers: rescan, 9.11
#[test]
fn a_rescan_in_idle_disturbs_no_subdevice_and_no_transfer() {
    for network in networks() {
        let (mut main_device, frames) = idle(network);
        let (before, infos) = (stations(&mut main_device), main_device.subdevices());
        let mailbox = main_device.engine().mailbox(TALKER).expect("it has one");
        let written = mailbox.counters().written;
        frames.take();
        for round in 0..3 {
            let (rescan, bytes, was_running) = rescan_beside_a_transfer(&mut main_device);
            assert_eq!((bytes, was_running), (100_000, true), "round {round}");
            assert_eq!((rescan.added.len(), rescan.removed.len(), rescan.moved().count()), (0, 0, 0));
            let found: Vec<StationAddress> = rescan.subdevices.iter().map(|found| found.station).collect();
            assert_eq!(found, before);
            assert_eq!(usize::from(rescan.counts.main) + usize::from(rescan.counts.redundant), before.len());
            let identities = rescan.subdevices.iter().zip(&infos);
            assert!(identities.clone().all(|(it, info)| it.identified == Identified::Undeclared(info.identity)));
        }
        assert_eq!(stations(&mut main_device), before);
        assert!(statuses(&mut main_device).iter().all(|status| *status == PREOP));
        assert!(mailbox.is_open() && mailbox.counters().written > written, "the same mailbox goes on");
        let passed = frames.take();
        let disturbing = passed.iter().filter(|passed| disturbs(passed, &before)).count();
        assert_eq!(disturbing, 0, "of {} frames", passed.len());
        assert!(main_device.pop_event().is_none(), "nothing has changed");
    }
}

// covers: rescan
#[test]
fn a_rescan_in_idle_says_what_was_added_and_removed_and_leaves_the_others() {
    for network in networks() {
        let last = network.devices().count() - 1;
        let has_ring = network.host_cable(HostLink::Redundant).is_some();
        let (mut main_device, frames) = idle(network);
        let before = stations(&mut main_device);
        for powered in [false, true, false, true] {
            let network = self::network(&mut main_device);
            if powered {
                network.power_on(DeviceIndex(last));
            } else {
                network.power_off(DeviceIndex(last));
            }
            // In a ring the others are reached from both sides.
            let rest = &before[..last];
            frames.take();
            let rescan = (&mut main_device).rescan(LIMIT).expect("it becomes stable");
            let (added, removed) = (rescan.added.len(), rescan.removed.len());
            assert_eq!((added, removed), if powered { (1, 0) } else { (0, 1) }, "ring: {has_ring}");
            assert_eq!(rescan.subdevices.len(), if powered { last + 1 } else { last });
            main_device.attend(FOLLOWED);
            let now = stations(&mut main_device);
            assert_eq!(&now[..last], rest);
            if powered {
                assert_eq!(rescan.added, now[last..]);
            }
            let expected = if powered { last + 1 } else { last };
            assert!(statuses(&mut main_device)[..expected].iter().all(|status| *status == PREOP));
            assert!(frames.take().iter().all(|passed| !disturbs(passed, rest)), "powered: {powered}");
        }
    }
}

// covers: rescan
#[test]
fn a_rescan_in_idle_succeeds_while_frames_are_lost_and_names_an_unplugged_segment() {
    for network in networks() {
        let (mut main_device, frames) = idle(network);
        let before = stations(&mut main_device);
        main_device.links_mut().links_mut().lose_per_mille(10, 7);
        frames.take();
        for _ in 0..5 {
            let rescan = (&mut main_device).rescan(Duration::from_secs(5)).expect("frames are sent again");
            assert_eq!((rescan.added.len(), rescan.removed.len()), (0, 0));
            assert_eq!(rescan.subdevices.len(), before.len());
        }
        main_device.links_mut().links_mut().lose_per_mille(0, 7);
        assert!(frames.take().iter().all(|passed| !disturbs(passed, &before)));
        assert!(statuses(&mut main_device).iter().all(|status| *status == PREOP));
        let cables = self::network(&mut main_device).cables().count();
        for cable in 0..cables {
            self::network(&mut main_device).apply(Fault::Cut(CableId(cable)));
        }
        let rescan = (&mut main_device).rescan(LIMIT).expect("nothing is there any more");
        assert_eq!((rescan.removed.len(), rescan.subdevices.len()), (before.len(), 0));
    }
}

// covers: rescan
#[test]
fn a_rescan_without_application_and_idle_operation_is_refused_with_the_remedy() {
    let network = networks().into_iter().next().expect("one");
    let mut main_device = MainDevice::request(Tap::new(network), &Options::default());
    main_device.scan().expect("it is stable");
    let error = (&mut main_device).rescan(LIMIT).expect_err("nothing keeps the SubDevices");
    assert!(error.to_string().contains("set the option, or scan"), "{error}");
}
