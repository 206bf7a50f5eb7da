//! Operation without an application, and of SubDevices without a declaration beside one: the MainDevice scans by
//! itself, follows changes, and keeps all in PREOP with their mailboxes.

mod beside;
mod dictionaries;
mod foreign;
mod live;
mod load;
mod noticing;
mod on_the_way;
mod pdos;
mod protocols;
mod sequences;

use std::time::Duration;

use ringcat::{
    Address, Application, Declaration, DomainId, Error, Event, LastOutputs, MainDevice, MainDevicePhase, Options,
    Position, RegisterAddress, RequestState, Services, SubDeviceConfig, SubDeviceId, TimedEvent, automatic,
};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::al::{AlState, AlStatus};
use ringcat_wire::register::map;
use scenarios::segments::{descriptions, line, ring};
use scenarios::tap::Tap;
use scenarios::world::CYCLE;

const MIXED: [&str; 6] =
    ["servo", "digital-output-8", "emulated-output-8", "servo", "emulated-input-8", "digital-input-8"];
const PREOP: AlStatus = AlStatus::new(AlState::PreOp);
const LIMIT: Duration = Duration::from_secs(1);
/// Within this time the MainDevice notices a change.
const NOTICED: Duration = Duration::from_millis(100);
/// Within this time it has followed a change.
const FOLLOWED: Duration = Duration::from_millis(400);

fn networks() -> [Network; 2] {
    let options = NetworkOptions::default;
    [line(descriptions(&MIXED), options()), ring(descriptions(&MIXED), options())]
}

fn options() -> Options {
    Options::default().with_idle_operation(true)
}

/// Works until all are in PREOP.
fn idle(network: Network) -> MainDevice<Tap> {
    let mut main_device = MainDevice::request(Tap::new(network), &options());
    main_device.attend(FOLLOWED);
    assert_eq!(statuses(&mut main_device), [PREOP; MIXED.len()]);
    while main_device.pop_event().is_some() {}
    main_device
}

fn statuses(main_device: &mut MainDevice<Tap>) -> Vec<AlStatus> {
    main_device.links_mut().network().devices().map(|device| device.al_status()).collect()
}

fn stations(network: &Network) -> Vec<u16> {
    let station = |device: &ringcat_sim::device::Device| {
        let bytes = device.controller.register(map::STATION_ADDRESS, 2);
        u16::from_le_bytes([bytes[0], bytes[1]])
    };
    network.devices().map(station).collect()
}

fn apply(main_device: &mut MainDevice<Tap>, fault: Fault) {
    main_device.links_mut().network_mut().apply(fault);
}

fn events(main_device: &mut MainDevice<Tap>) -> Vec<TimedEvent> {
    std::iter::from_fn(|| main_device.pop_event()).collect()
}

/// Time from now on until an event.
fn noticed(main_device: &mut MainDevice<Tap>, is_it: impl Fn(&Event) -> bool) -> Duration {
    let begun = main_device.now();
    let mut others = Vec::new();
    loop {
        main_device.attend(Duration::from_millis(1));
        let happened = events(main_device);
        if let Some(event) = happened.iter().find(|timed| is_it(&timed.event)) {
            return event.at.since(begun);
        }
        others.extend(happened.into_iter().map(|timed| timed.event));
        let is_late = main_device.now().since(begun) >= Duration::from_secs(5);
        assert!(!is_late, "it is not noticed: {others:?}, {} are known", main_device.subdevices().len());
    }
}

fn activate(main_device: MainDevice<Tap>, declared: &[usize]) -> Application<Tap> {
    let found = main_device.subdevices();
    let mut declaration = Declaration::new(CYCLE);
    for at in declared {
        declaration.add(SubDeviceConfig::from_info(&found[*at]));
    }
    main_device.activate(declaration).map_err(Error::from).expect("it fits")
}

fn cycles(application: &mut Application<Tap>, count: usize) {
    (0..count).for_each(|_| application.cycle(|_| ()));
}

// covers: states
#[test]
fn a_segment_is_scanned_without_a_call_and_all_are_in_preop_with_mailboxes() {
    for network in networks() {
        let mut main_device = idle(network);
        assert_eq!(main_device.subdevices().len(), MIXED.len());
        assert_eq!(Services::phase(&mut main_device), MainDevicePhase::Idle);
        for servo in [0, 3] {
            assert!(main_device.engine().mailbox(Position(servo)).expect("it has one").is_open());
            let servo = main_device.subdevice(Position(servo));
            assert_eq!(servo.state().expect("it answers").status, PREOP);
            let servo = main_device.subdevice(Position(3));
            assert!(servo.sdo_read::<u32>(0x1018, 1).expect("it answers") > 0);
        }
        main_device.attend(Duration::from_secs(3));
        assert!(events(&mut main_device).is_empty(), "nothing has changed");
        assert_eq!(statuses(&mut main_device), [PREOP; MIXED.len()]);
    }
}

// covers: states
#[test]
fn a_segment_that_is_connected_later_is_found_and_one_that_is_unplugged_is_orphaned() {
    let mut network = line(descriptions(&MIXED), NetworkOptions::default());
    network.apply(Fault::Cut(CableId(0)));
    let mut main_device = MainDevice::request(Tap::new(network), &options());
    main_device.attend(Duration::from_secs(7));
    assert_eq!(Services::phase(&mut main_device), MainDevicePhase::Orphaned);
    assert!(main_device.subdevices().is_empty());
    for _ in 0..3 {
        apply(&mut main_device, Fault::Heal(CableId(0)));
        assert!(noticed(&mut main_device, |event| matches!(event, Event::LinkUp { .. })) < NOTICED);
        main_device.attend(FOLLOWED);
        assert_eq!(statuses(&mut main_device), [PREOP; MIXED.len()]);
        assert_eq!(main_device.subdevices().len(), MIXED.len());
        assert_eq!(Services::phase(&mut main_device), MainDevicePhase::Idle);
        apply(&mut main_device, Fault::Cut(CableId(0)));
        assert!(noticed(&mut main_device, |event| matches!(event, Event::LinkDown { .. })) < NOTICED);
        main_device.attend(FOLLOWED);
        assert_eq!(Services::phase(&mut main_device), MainDevicePhase::Orphaned);
        assert!(main_device.subdevices().is_empty());
    }
}

// covers: states
#[test]
fn changes_are_noticed_within_100_ms_and_leave_the_others_in_place() {
    let mut slowest = Duration::ZERO;
    for (number, network) in networks().into_iter().enumerate() {
        let is_ring = number == 1;
        let mut main_device = idle(network);
        let mut before = stations(main_device.links_mut().network());
        let mut note = |time: Duration, what: &str| {
            assert!(time < NOTICED, "{what}: {time:?}");
            slowest = slowest.max(time);
        };
        for device in [5, 4, 1] {
            apply(&mut main_device, Fault::PowerOff(DeviceIndex(device)));
            note(noticed(&mut main_device, |event| matches!(event, Event::Counted { .. })), "power off");
            main_device.attend(FOLLOWED);
            let reachable = if is_ring { MIXED.len() - 1 } else { device };
            assert_eq!(main_device.subdevices().len(), reachable);
            apply(&mut main_device, Fault::PowerOn(DeviceIndex(device)));
            note(noticed(&mut main_device, |event| matches!(event, Event::Counted { .. })), "power on");
            // The others stay where they are, all the time.
            for _ in 0..FOLLOWED.as_millis() {
                main_device.attend(Duration::from_millis(1));
                let now = statuses(&mut main_device);
                let stay = if is_ring { MIXED.len() } else { device };
                let left = now[..stay].iter().enumerate().filter(|(at, is)| *at != device && **is != PREOP).count();
                assert_eq!(left, 0, "{now:?}");
            }
            assert_eq!(statuses(&mut main_device), [PREOP; MIXED.len()]);
            assert_eq!(main_device.subdevices().len(), MIXED.len());
            let now = stations(main_device.links_mut().network());
            // All that were reachable and powered meanwhile have kept their addresses.
            let stays = |at: &usize| if is_ring { *at != device } else { *at < device };
            let moved: Vec<usize> = (0..MIXED.len()).filter(stays).filter(|at| now[*at] != before[*at]).collect();
            assert!(moved.is_empty(), "{moved:?}: {now:x?}, before {before:x?}");
            before = now;
            for servo in [0, 3] {
                main_device.subdevice(Position(servo)).sdo_read::<u32>(0x1018, 1).expect("it answers");
            }
            events(&mut main_device);
        }
        if is_ring {
            apply(&mut main_device, Fault::Cut(CableId(3)));
            note(noticed(&mut main_device, |event| matches!(event, Event::RingOpened { .. })), "ring opened");
            main_device.attend(FOLLOWED);
            assert_eq!((statuses(&mut main_device), main_device.subdevices().len()), (vec![PREOP; 6], 6));
            apply(&mut main_device, Fault::Heal(CableId(3)));
            note(noticed(&mut main_device, |event| matches!(event, Event::RingClosed { .. })), "ring closed");
            main_device.attend(FOLLOWED);
        }
        // Another MainDevice, or a program, sends a SubDevice to INIT.
        main_device.subdevice(Position(3)).register_write::<u16>(map::AL_CONTROL, 1).expect("it is written");
        let is_left = |event: &Event| matches!(event, Event::UndeclaredState { position: Position(3), .. });
        note(noticed(&mut main_device, is_left), "state");
        main_device.attend(FOLLOWED);
        assert_eq!(statuses(&mut main_device), [PREOP; MIXED.len()]);
        main_device.subdevice(Position(3)).sdo_read::<u32>(0x1018, 1).expect("it answers");
    }
    println!("idle operation: a change is noticed within {slowest:?}");
}

// covers: states
#[test]
fn a_subdevice_that_restarts_between_two_broadcasts_is_found() {
    for network in networks() {
        let mut main_device = idle(network);
        apply(&mut main_device, Fault::PowerOff(DeviceIndex(5)));
        main_device.attend(Duration::from_millis(1));
        apply(&mut main_device, Fault::PowerOn(DeviceIndex(5)));
        main_device.attend(Duration::from_secs(2));
        assert_eq!(statuses(&mut main_device), [PREOP; MIXED.len()]);
        assert_eq!(main_device.subdevices().len(), MIXED.len());
    }
}

// covers: states
#[test]
fn requested_states_are_kept_without_an_application() {
    for network in networks() {
        let mut main_device = idle(network);
        for (at, state) in [(0, AlState::Op), (1, AlState::Op), (3, AlState::SafeOp), (5, AlState::Init)] {
            main_device.subdevice(Position(at)).request_state(state).expect("it follows");
        }
        main_device.attend(Duration::from_secs(3));
        let states = [AlState::Op, AlState::Op, AlState::PreOp, AlState::SafeOp, AlState::PreOp, AlState::Init];
        assert_eq!(statuses(&mut main_device), states.map(AlStatus::new));
        assert_eq!(main_device.links_mut().network().device(DeviceIndex(1)).outputs(), [0]);
        main_device.subdevice(Position(0)).sdo_read::<u32>(0x1018, 1).expect("it answers in OP");
        let refuse = Fault::RefuseTransition {
            device: DeviceIndex(3),
            to: AlState::Op,
            code: ringcat_wire::al::AlStatusCode(0x8042),
            times: 1,
        };
        apply(&mut main_device, refuse);
        let error = main_device.subdevice(Position(3)).request_state(AlState::Op).expect_err("it refuses");
        assert!(error.to_string().contains("OP"), "{error}");
        main_device.attend(FOLLOWED);
        assert_eq!(statuses(&mut main_device)[3], AlStatus::new(AlState::SafeOp), "it is back");
    }
}

// covers: states
#[test]
fn undeclared_subdevices_have_mailbox_state_and_eeprom_while_others_are_in_op() {
    for network in networks() {
        let main_device = idle(network);
        let mut application = activate(main_device, &[0, 1, 5]);
        cycles(&mut application, 300);
        assert!(application.all_settled(), "{:?}", application.states());
        let before = application.process(DomainId(0));
        let servo = Position(3);
        let run = |application: &mut Application<Tap>, state| {
            let request = ringcat::SubDevice::new(&mut *application, servo).request_state(state);
            application.cycle_until(request, LIMIT, |_| ()).expect("it follows");
        };
        let object = ringcat::SubDevice::new(&mut application, servo).sdo_read::<u32>(0x1018, 1);
        assert!(application.cycle_until(object, LIMIT, |_| ()).expect("it answers") > 0);
        let image = ringcat::SubDevice::new(&mut application, servo).sii_read();
        let image = application.cycle_until(image, LIMIT, |_| ()).expect("it can be read");
        assert_eq!(image, application.links().network().device(DeviceIndex(3)).controller.sii_image());
        let register = ringcat::SubDevice::new(&mut application, servo).register_read::<u8>(RegisterAddress(0));
        assert!(application.cycle_until(register, LIMIT, |_| ()).expect("it can be read") > 0);
        // A declared SubDevice by its position.
        let object = ringcat::SubDevice::new(&mut application, Position(0)).sdo_read::<u32>(0x1018, 1);
        assert!(application.cycle_until(object, LIMIT, |_| ()).expect("it answers") > 0);
        for state in [AlState::SafeOp, AlState::Op, AlState::PreOp, AlState::Init, AlState::Op] {
            run(&mut application, state);
            cycles(&mut application, 200);
            let states: Vec<AlStatus> =
                application.links().network().devices().map(|device| device.al_status()).collect();
            let op = AlStatus::new(AlState::Op);
            assert_eq!(states, [op, op, PREOP, AlStatus::new(state), PREOP, op]);
        }
        let after = application.process(DomainId(0));
        assert_eq!((after.wkc, after.skipped), (before.expected, before.skipped));
        let mut ended = application.deactivate(LastOutputs::Zero, LIMIT).expect("all follow");
        assert_eq!(statuses(&mut ended), [PREOP; MIXED.len()]);
        ended.attend(FOLLOWED);
        assert_eq!(statuses(&mut ended), [PREOP; MIXED.len()], "operation without an application goes on");
        apply(&mut ended, Fault::PowerOff(DeviceIndex(5)));
        assert!(noticed(&mut ended, |event| matches!(event, Event::Counted { .. })) < NOTICED);
    }
}

// covers: states
#[test]
fn rounds_of_reads_during_requests_report_no_state_as_left() {
    for (network, lost) in [0, 1].into_iter().flat_map(|lost| networks().map(|network| (network, lost))) {
        let mut application = activate(idle(network), &[0, 1, 5]);
        cycles(&mut application, 300);
        while application.pop_event().is_some() {}
        let states = [AlState::Op, AlState::Init, AlState::SafeOp, AlState::Op, AlState::PreOp];
        for (number, state) in states.into_iter().cycle().take(60).enumerate() {
            let at = [2, 3, 4][number % 3];
            if lost > 0 {
                let drop = Fault::Drop { cable: CableId(number % 3), direction: None, count: lost };
                application.links_mut().network_mut().apply(drop);
            }
            cycles(&mut application, number % 7);
            let request = ringcat::SubDevice::new(&mut application, Position(at)).request_state(state);
            application.cycle_until(request, LIMIT, |_| ()).expect("it follows");
            for cycle in 0..30 {
                let is = application.links().network().device(DeviceIndex(at.into())).al_status();
                assert_eq!(is, AlStatus::new(state), "request {number}, {cycle} cycles after it was reached");
                application.cycle(|_| ());
            }
        }
        let is_wrong = |event: &Event| matches!(event, Event::UndeclaredState { .. } | Event::UndeclaredFailed { .. });
        let wrong: Vec<TimedEvent> =
            std::iter::from_fn(|| application.pop_event()).filter(|timed| is_wrong(&timed.event)).collect();
        assert!(wrong.is_empty(), "{wrong:?}");
    }
}

// covers: states, jobs
#[test]
fn requests_of_the_cyclic_thread_reach_subdevices_without_a_declaration() {
    for network in networks() {
        let main_device = idle(network);
        let mut application = activate(main_device, &[1, 3, 5]);
        cycles(&mut application, 300);
        // One without a declaration, a declared one by its position and by its index, and none.
        let addresses: [Address; 4] =
            [Position(0).into(), Position(3).into(), SubDeviceId(1).into(), Position(6).into()];
        let mut requests = addresses.map(|address| Services::create_sdo_request(&mut application, address, 4));
        for request in &mut requests {
            request.set_object(0x1018, 1, false).and_then(|()| request.read()).expect("it is free");
        }
        cycles(&mut application, 100);
        let states = requests.each_ref().map(|request| request.state());
        let done = RequestState::Success;
        assert_eq!(states, [done, done, done, RequestState::Error]);
        for request in &requests[..3] {
            let mut vendor = [0; 4];
            assert_eq!(request.data(&mut vendor), 4);
            assert_ne!(vendor, [0; 4]);
        }
    }
}

// covers: states
#[test]
fn a_subdevice_that_comes_while_others_are_in_op_is_brought_to_preop() {
    for network in networks() {
        let mut network = network;
        network.apply(Fault::PowerOff(DeviceIndex(5)));
        network.advance_by(Duration::from_millis(10));
        let mut main_device = MainDevice::request(Tap::new(network), &options());
        main_device.attend(FOLLOWED);
        assert_eq!(main_device.subdevices().len(), MIXED.len() - 1);
        let mut application = activate(main_device, &[0, 1]);
        cycles(&mut application, 300);
        for _ in 0..2 {
            application.links_mut().network_mut().apply(Fault::PowerOn(DeviceIndex(5)));
            cycles(&mut application, 1_500);
            assert_eq!(application.links().network().device(DeviceIndex(5)).al_status(), PREOP);
            let read = ringcat::SubDevice::new(&mut application, Position(5)).state();
            assert_eq!(application.cycle_until(read, LIMIT, |_| ()).expect("it answers").status, PREOP);
            application.links_mut().network_mut().apply(Fault::PowerOff(DeviceIndex(5)));
            cycles(&mut application, 1_500);
        }
        assert!(application.all_settled());
    }
}

// covers: states
#[test]
fn an_activation_in_the_middle_of_a_change_leaves_nothing_behind() {
    for after_us in (0..60_000).step_by(3_700) {
        for network in networks() {
            let mut main_device = idle(network);
            apply(&mut main_device, Fault::PowerOff(DeviceIndex(5)));
            main_device.attend(FOLLOWED);
            apply(&mut main_device, Fault::PowerOn(DeviceIndex(5)));
            main_device.attend(Duration::from_micros(after_us));
            let declaration = automatic(&main_device.subdevices(), CYCLE);
            let declared = declaration.subdevices.len();
            let mut application = main_device.activate(declaration).map_err(Error::from).expect("it fits");
            cycles(&mut application, 1_000);
            assert!(application.all_settled(), "after {after_us} us: {:?}", application.states());
            let op = AlStatus::new(AlState::Op);
            let in_op = application.links().network().devices().filter(|it| it.al_status() == op).count();
            let preop = application.links().network().devices().filter(|it| it.al_status() == PREOP).count();
            assert_eq!((in_op, preop), (declared, MIXED.len() - declared), "after {after_us} us");
        }
    }
}
