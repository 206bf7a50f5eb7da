//! The role changes while procedures run: with INACTIVE all of them end and nothing is sent, with ACTIVE the MainDevice
//! continues with its knowledge (protocol 9.11).

use std::time::Duration;

use ringcat::{
    AlState, AlStatus, Error, Event, Handover, Knowledge, LastOutputs, Limits, MainDevice, MainDeviceRole, Options,
    Position, SdoAddress, Services, StateScope, automatic,
};
use ringcat_engine::mail::foe::{self, FoeOptions};
use ringcat_engine::mail::stream::Bytes;
use ringcat_engine::main_device::MainDevice as Engine;
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use scenarios::segments::{descriptions, line, ring};
use scenarios::tap::Tap;
use scenarios::uploads::start_upload;
use scenarios::witness::{Frames, Witness};
use scenarios::world::CYCLE;

type Watched = Witness<Tap>;

const KINDS: [&str; 5] = ["coupler", "all-protocols", "digital-input-8", "servo", "digital-output-8"];
const DRIVE: Position = Position(1);
const LIMIT: Duration = Duration::from_secs(1);
const LIMITS: Limits = Limits::new(Duration::from_millis(100), Duration::from_millis(500));
const PREOP: AlStatus = AlStatus::new(AlState::PreOp);
/// Within this time after the role is ACTIVE all are in their states.
const FOLLOWED: Duration = Duration::from_millis(400);

fn networks() -> [Network; 2] {
    let options = NetworkOptions::default;
    [line(descriptions(&KINDS), options()), ring(descriptions(&KINDS), options())]
}

fn idle(network: Network) -> (MainDevice<Watched>, Frames) {
    let (links, frames) = Witness::new(Tap::new(network));
    let mut main_device = MainDevice::request(links, &Options::default().with_idle_operation(true));
    main_device.attend(Duration::from_secs(1));
    assert_eq!(statuses(&mut main_device), [PREOP; KINDS.len()]);
    (main_device, frames)
}

fn statuses(main_device: &mut MainDevice<Watched>) -> Vec<AlStatus> {
    main_device.links_mut().links_mut().network().devices().map(|device| device.al_status()).collect()
}

fn spoil_siis(main_device: &mut MainDevice<Watched>) {
    let network = main_device.links_mut().links_mut().network_mut();
    let count = network.devices().len();
    (0..count).for_each(|at| network.device_mut(DeviceIndex(at)).controller.sii_image_mut().fill(0));
}

fn sent(frames: &Frames) -> usize {
    frames.take().into_iter().filter(|passed| passed.is_sent).count()
}

/// Begins procedures of all kinds; the result is whether any of them still runs.
fn begin(engine: &mut Engine, number: usize) -> Box<dyn FnMut() -> bool> {
    fn running<T: 'static>(pending: ringcat::Pending<T>) -> Box<dyn FnMut() -> bool> {
        Box::new(move || pending.is_running())
    }
    match number {
        0 => running(start_upload(engine, DRIVE, SdoAddress::new(0x2002, 0), LIMITS, 200_000)),
        1 => {
            let mailbox = engine.mailbox(DRIVE).expect("it has one");
            running(engine.start(async move {
                let mut source = Bytes::new(&[0x5A; 40_000]);
                foe::write(&mailbox, "large.bin", FoeOptions::default(), &mut source, |_| ()).await.is_ok()
            }))
        }
        2 => running(engine.start_state_request(DRIVE, AlState::SafeOp)),
        3 => running(engine.start_sii_read(Position(3))),
        4 => running(engine.start_rescan(LIMIT)),
        5 => running(engine.start_port_report()),
        6 => running(engine.start_state_of_all(AlState::SafeOp, StateScope::All, LIMIT)),
        _ => running(engine.start_sii_completion()),
    }
}

/// Kinds of [`begin`].
const PROCEDURES: usize = 8;

// covers: 9.11
#[test]
fn inactive_ends_all_that_runs_and_sends_nothing_until_it_is_active_again() {
    for network in 0..2 {
        for number in 0..PROCEDURES {
            for after_us in [0, 400, 1_900, 7_300] {
                let (mut main_device, frames) = idle(networks().into_iter().nth(network).expect("two networks"));
                let text = format!("network {network}, procedure {number}, after {after_us} us");
                let mut is_running = begin(main_device.engine_mut(), number);
                main_device.attend(Duration::from_micros(after_us));
                frames.take();
                Services::set_role(&mut main_device, MainDeviceRole::Inactive);
                while main_device.pop_event().is_some() {}
                for _ in 0..20 {
                    main_device.attend(Duration::from_millis(50));
                    assert_eq!(sent(&frames), 0, "{text}");
                }
                assert!(!is_running(), "{text}: it has no end");
                assert!(main_device.pop_event().is_none(), "{text}: silence is no loss");
                Services::set_role(&mut main_device, MainDeviceRole::Active);
                main_device.attend(FOLLOWED);
                // A state that was requested is still wanted.
                let is_wanted = |status: AlStatus| match number {
                    2 | 6 => [PREOP, AlStatus::new(AlState::SafeOp)].contains(&status),
                    _ => status == PREOP,
                };
                let now = statuses(&mut main_device);
                assert!(now.iter().all(|status| is_wanted(*status)), "{text}: {now:?}");
                assert!(number != 2 || now[1] == AlStatus::new(AlState::SafeOp), "{text}: {now:?}");
                main_device.subdevice(DRIVE).sdo_read::<u32>(0x1018, 1).unwrap_or_else(|e| panic!("{text}: {e}"));
                main_device.subdevice(Position(3)).sdo_read::<u32>(0x1018, 1).unwrap_or_else(|e| panic!("{text}: {e}"));
            }
        }
    }
}

/// Another MainDevice has used the mailboxes, brought one to OP and one to INIT, and one has lost its power.
// covers: 9.11, states
#[test]
fn active_again_all_are_brought_back_whatever_another_main_device_has_left() {
    for network in networks() {
        let (mut main_device, _) = idle(network);
        Services::set_role(&mut main_device, MainDeviceRole::Inactive);
        let bytes = main_device.knowledge().expect("it is kept").to_bytes();
        let network = main_device.links_mut().links_mut().network_mut();
        network.apply(Fault::PowerOff(DeviceIndex(4)));
        network.advance_by(Duration::from_millis(50));
        network.apply(Fault::PowerOn(DeviceIndex(4)));
        network.advance_by(Duration::from_millis(50));
        // It goes on from the same knowledge, with mailbox counters of its own.
        let (nowhere, _) = Witness::new(Tap::new(line(descriptions(&KINDS), NetworkOptions::default())));
        let mut other = MainDevice::request(nowhere, &Options::default().with_idle_operation(true));
        std::mem::swap(main_device.links_mut(), other.links_mut());
        let knowledge = Knowledge::from_bytes(&bytes).expect("they were written");
        other.resume(knowledge, Handover::AfterCrash).expect("the segment answers");
        for _ in 0..5 {
            other.subdevice(DRIVE).sdo_read::<u32>(0x1018, 1).expect("it answers");
        }
        other.subdevice(Position(2)).request_state(AlState::Op).expect("it follows");
        other.subdevice(Position(3)).request_state(AlState::Init).expect("it follows");
        std::mem::swap(main_device.links_mut(), other.links_mut());
        Services::set_role(&mut main_device, MainDeviceRole::Active);
        main_device.attend(FOLLOWED);
        assert_eq!(statuses(&mut main_device), [PREOP; KINDS.len()]);
        for position in [DRIVE, Position(3)] {
            main_device.subdevice(position).sdo_read::<u32>(0x1018, 1).expect("it answers");
        }
    }
}

// covers: 9.11, states
#[test]
fn an_application_ends_with_its_role_and_another_one_begins_when_it_is_active_again() {
    for network in networks() {
        let (main_device, frames) = idle(network);
        let declaration = automatic(&main_device.subdevices(), CYCLE);
        let mut application = main_device.activate(declaration).map_err(Error::from).expect("it fits");
        (0..1_000).for_each(|_| application.cycle(|_| ()));
        assert!(application.all_settled());
        application.engine_mut().set_role(MainDeviceRole::Inactive);
        let engine = application.engine_mut();
        assert!(engine.under_way().datagrams == 0 && engine.states().is_empty());
        frames.take();
        let refused = application.deactivate(LastOutputs::Zero, LIMIT).expect_err("another one has the segment");
        assert!(refused.error.to_string().contains("INACTIVE"), "{}", refused.error);
        let mut engine = refused.main_device;
        engine.attend(LIMIT);
        assert_eq!(sent(&frames), 0);
        spoil_siis(&mut engine);
        Services::set_role(&mut engine, MainDeviceRole::Active);
        engine.attend(FOLLOWED);
        assert_eq!(statuses(&mut engine), [PREOP; KINDS.len()]);
        let declaration = automatic(&engine.subdevices(), CYCLE);
        let mut application = engine.activate(declaration).map_err(Error::from).expect("it fits");
        (0..1_000).for_each(|_| application.cycle(|_| ()));
        assert!(application.all_settled());
        let _ = application.deactivate(LastOutputs::Zero, LIMIT).map_err(Error::from).expect("all follow");
    }
}

/// A change of the role ends a deactivation that waits for a SubDevice: idle operation continues when the MainDevice is
/// ACTIVE again.
// covers: 9.11, stop
#[test]
fn changes_are_followed_after_a_deactivation_that_the_role_has_ended() {
    for network in networks() {
        let (main_device, _) = idle(network);
        let declaration = automatic(&main_device.subdevices(), CYCLE);
        let mut application = main_device.activate(declaration).map_err(Error::from).expect("it fits");
        (0..1_000).for_each(|_| application.cycle(|_| ()));
        assert!(application.all_settled());
        application.links_mut().links_mut().network_mut().apply(Fault::Hang(DeviceIndex(3), true));
        let now = application.now();
        application.engine_mut().start_deactivate(Duration::from_millis(150), now).expect("it is active");
        (0..5).for_each(|_| application.cycle(|_| ()));
        application.engine_mut().set_role(MainDeviceRole::Inactive);
        let refused = application.deactivate(LastOutputs::Zero, LIMIT).expect_err("another one has the segment");
        let mut engine = refused.main_device;
        engine.links_mut().links_mut().network_mut().apply(Fault::Hang(DeviceIndex(3), false));
        Services::set_role(&mut engine, MainDeviceRole::Active);
        engine.attend(Duration::from_secs(1));
        assert_eq!(statuses(&mut engine), [PREOP; KINDS.len()]);
        while engine.pop_event().is_some() {}
        engine.links_mut().links_mut().network_mut().apply(Fault::PowerOff(DeviceIndex(4)));
        engine.attend(Duration::from_secs(1));
        let events: Vec<Event> = std::iter::from_fn(|| engine.pop_event()).map(|timed| timed.event).collect();
        let is_change = |event: &Event| matches!(event, Event::SegmentChanged { .. });
        assert!(events.iter().any(is_change), "{events:?}");
    }
}

// covers: 9.11
#[test]
fn a_scan_and_a_stop_that_the_role_ends_have_a_result_that_says_so() {
    for network in networks() {
        let (mut main_device, _) = idle(network);
        main_device.engine_mut().start_scan().expect("nothing is active");
        main_device.attend(Duration::from_millis(1));
        Services::set_role(&mut main_device, MainDeviceRole::Inactive);
        let result = main_device.engine().scan_result().expect("it has ended");
        assert!(result.expect_err("it was cut").to_string().contains("INACTIVE"));
        Services::set_role(&mut main_device, MainDeviceRole::Active);
        main_device.attend(Duration::from_secs(1));
        assert_eq!(statuses(&mut main_device), [PREOP; KINDS.len()]);
        let now = main_device.now();
        main_device.engine_mut().start_stop(AlState::Init, LIMIT, now);
        Services::set_role(&mut main_device, MainDeviceRole::Inactive);
        let result = main_device.engine().stop_result().expect("it has ended");
        assert!(result.expect_err("it was cut").to_string().contains("INACTIVE"));
    }
}

// covers: 9.11, mailbox
#[test]
fn events_and_emergencies_stay_when_the_role_changes() {
    use ringcat_sim::application::mailbox::faults::MailFault;
    for network in networks() {
        let (mut main_device, _) = idle(network);
        let ring = main_device.engine_mut().create_emergency_ring(DRIVE, 4);
        let number = main_device.engine_mut().snapshot().next_event;
        for round in 1..=2 {
            Services::set_role(&mut main_device, MainDeviceRole::Inactive);
            Services::set_role(&mut main_device, MainDeviceRole::Active);
            let emergency = MailFault::EmergencyBefore { count: 1, code: 0x1234 };
            main_device.links_mut().links_mut().network_mut().apply(Fault::Mail(DeviceIndex(1), emergency));
            main_device.subdevice(DRIVE).sdo_read::<u32>(0x1018, 1).expect("it answers");
            main_device.attend(Duration::from_millis(50));
            assert_eq!(ring.len(), round, "the ring of before gets it");
        }
        let since = main_device.engine_mut().events_since(number);
        let is_emergency = |timed: &&ringcat::TimedEvent| matches!(timed.event, Event::Emergency { .. });
        assert_eq!((since.missed, since.events.iter().filter(is_emergency).count()), (0, 2));
    }
}
