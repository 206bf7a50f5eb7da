//! Services for a tool: ports of all SubDevices, urgent register writes, forced states, owners of EEPROMs, clients of
//! events.

mod latched;

use std::time::Duration;

use ringcat::{
    Acknowledge, AlState, AlStatus, AlStatusCode, EepromAssignment, EepromOwner, Error, Event, Link, MainDevice,
    Neighbour, Options, PortOf, Position, RawDatagram, RegisterAddress, Services, SubDeviceId, SubDevicePorts, Subject,
    Subjects, TimedEvent, Urgency, automatic,
};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::address::StationAddress;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::map;
use scenarios::clocks::clocked;
use scenarios::segments::{descriptions, line, ring};
use scenarios::tap::Tap;
use scenarios::world::World;

const KINDS: [&str; 5] = ["coupler", "digital-input-8", "digital-output-8", "all-protocols", "digital-input-16"];
const LIMIT: Duration = Duration::from_secs(2);
const FOLLOWED: Duration = Duration::from_millis(400);
/// Memory of the user in each controller.
const USER_RAM: RegisterAddress = RegisterAddress(0x0F80);
/// Delay of a pass and of a cable in the simulator.
const HOP_NS: i64 = 300 + 50;

fn options() -> NetworkOptions {
    NetworkOptions::default().with_detection_delay(Duration::from_micros(10))
}

fn idle(network: Network) -> MainDevice<Tap> {
    let mut main_device = MainDevice::request(Tap::new(network), &Options::default().with_idle_operation(true));
    main_device.attend(FOLLOWED);
    while main_device.pop_event().is_some() {}
    main_device
}

fn status(main_device: &mut MainDevice<Tap>, device: usize) -> AlStatus {
    main_device.links_mut().network().device(DeviceIndex(device)).al_status()
}

/// Cycles until the user's memory of a SubDevice holds a value that is written while datagrams to it wait.
fn cycles_until_written(world: &mut World, value: u8, urgency: Urgency) -> usize {
    const DEVICE: usize = 2;
    let station = StationAddress(world.station_of(DEVICE));
    let read = |_| RawDatagram::new(Command::Fprd, Target::Station(station, RegisterAddress(0)), vec![0; 1400]);
    let engine = world.application_mut().engine_mut();
    let waiting = engine.start_datagrams((0..400).map(read).collect());
    world.run_cycles(2);
    let engine = world.application_mut().engine_mut();
    let write = engine.start_register_write_with(SubDeviceId(DEVICE), USER_RAM, vec![value], urgency);
    let mut cycles = 0;
    while world.network().device(DeviceIndex(DEVICE)).controller.register(USER_RAM, 1) != [value] {
        world.cycle();
        cycles += 1;
        assert!(cycles < 5_000, "it is not written");
    }
    assert_eq!(world.finish(LIMIT, write), Ok(()));
    let replies = world.finish(Duration::from_secs(10), waiting).expect("they are sent");
    assert!(replies.iter().all(Result::is_ok), "the others are sent as well");
    cycles
}

// covers: registers
#[test]
fn an_urgent_register_write_goes_ahead_of_all_that_wait() {
    for network in [line(descriptions(&KINDS), options()), ring(descriptions(&KINDS), options())] {
        let mut world = World::in_op(1, network);
        let usual = cycles_until_written(&mut world, 0x11, Urgency::InOrder);
        let urgent = cycles_until_written(&mut world, 0x22, Urgency::First);
        println!("written after {usual} cycles, urgently after {urgent}");
        assert!(usual >= 20 && urgent <= 2, "{usual} and {urgent}");
        let error = world.application_mut().engine_mut().start_register_write_with(
            SubDeviceId(9),
            USER_RAM,
            vec![1],
            Urgency::First,
        );
        assert!(world.finish(LIMIT, error).is_err(), "there is no such SubDevice");
    }
}

// covers: registers
#[test]
fn lost_urgent_writes_are_sent_again() {
    let mut world = World::in_op(2, line(descriptions(&KINDS), options()));
    for round in 1..=20 {
        world.drop(CableId(1), 1);
        let engine = world.application_mut().engine_mut();
        let write = engine.start_register_write_with(SubDeviceId(2), USER_RAM, vec![round; 8], Urgency::First);
        assert_eq!(world.finish(LIMIT, write), Ok(()));
        assert_eq!(world.network().device(DeviceIndex(2)).controller.register(USER_RAM, 8), [round; 8]);
    }
}

// covers: states
#[test]
fn a_forced_state_is_left_until_another_state_is_requested() {
    for network in [line(descriptions(&KINDS), options()), ring(descriptions(&KINDS), options())] {
        let mut main_device = idle(network);
        let force = |main_device: &mut MainDevice<Tap>, at, state, acknowledge| {
            main_device.subdevice(Position(at)).force_state(state, acknowledge).expect("it answers");
            main_device.attend(Duration::from_millis(100));
            status(main_device, at.into())
        };
        for at in [1, 3] {
            let init = AlStatus::new(AlState::Init);
            assert_eq!(force(&mut main_device, at, AlState::Init, Acknowledge::No), init);
            main_device.attend(Duration::from_secs(3));
            assert_eq!(status(&mut main_device, at.into()), init, "it is left there");
            // OP without the states between is refused, and the error stays until it is acknowledged.
            let refused = force(&mut main_device, at, AlState::Op, Acknowledge::No);
            assert_eq!((refused.error, refused.al_state()), (true, Some(AlState::Init)), "{refused:?}");
            let shown = main_device.subdevice(Position(at)).state().expect("it answers");
            assert_eq!((shown.status, shown.code), (refused, AlStatusCode(0x0011)));
            assert_eq!(force(&mut main_device, at, AlState::PreOp, Acknowledge::No), refused, "at {at}");
            assert_eq!(force(&mut main_device, at, AlState::Init, Acknowledge::Yes), init);
            let others = (0..KINDS.len()).filter(|other| *other != usize::from(at));
            let wrong = others.filter(|other| status(&mut main_device, *other) != AlStatus::new(AlState::PreOp));
            assert_eq!(wrong.count(), 0, "the others stay in PREOP");
            main_device.subdevice(Position(at)).request_state(AlState::PreOp).expect("it follows");
            main_device.attend(Duration::from_secs(2));
            assert_eq!(status(&mut main_device, at.into()), AlStatus::new(AlState::PreOp));
        }
        main_device.subdevice(Position(3)).sdo_read::<u32>(0x1018, 1).expect("its mailbox is open");
    }
}

// covers: states
#[test]
fn a_declared_subdevice_is_brought_back_from_a_forced_state() {
    let mut world = World::in_op(3, line(descriptions(&KINDS), options()));
    for state in [AlState::SafeOp, AlState::Init, AlState::PreOp] {
        let engine = world.application_mut().engine_mut();
        let force = engine.start_forced_state(SubDeviceId(3), state, Acknowledge::No);
        world.finish(LIMIT, force).expect("it answers");
        let left = |world: &World| world.network().device(DeviceIndex(3)).al_status() == AlStatus::new(state);
        world.until(Duration::from_millis(100), "it follows", left);
        world.until(Duration::from_secs(5), "all are back", World::all_in_op);
        world.settle();
    }
}

fn neighbours(report: &[SubDevicePorts]) -> Vec<[Option<Neighbour>; 4]> {
    report.iter().map(|it| it.ports.map(|port| port.neighbour)).collect()
}

/// Neighbours of a line, or of a ring.
fn in_a_row(count: usize, is_ring: bool) -> Vec<[Option<Neighbour>; 4]> {
    let other = |node: usize, port| Some(Neighbour::SubDevice(PortOf::new(Position(node as u16), port)));
    let before = |node: usize| match node {
        0 => Some(Neighbour::Interface(Link::Main)),
        node => other(node - 1, 1),
    };
    let after = |node: usize| match node + 1 == count {
        true => is_ring.then_some(Neighbour::Interface(Link::Redundant)),
        false => other(node + 1, 0),
    };
    (0..count).map(|node| [before(node), after(node), None, None]).collect()
}

fn clocked_segment(count: usize) -> Vec<DeviceDescription> {
    clocked(count, 0)
}

// covers: registers, cable-errors
#[test]
fn ports_of_all_are_reported_with_neighbours_delays_and_counters() {
    const COUNT: usize = 6;
    for is_ring in [false, true] {
        let segment = clocked_segment(COUNT);
        let network = if is_ring { ring(segment, options()) } else { line(segment, options()) };
        let mut main_device = MainDevice::request(Tap::new(network), &Options::default().with_idle_operation(true));
        assert_eq!(main_device.port_report().expect("it can be asked"), [], "nothing is scanned");
        main_device.attend(FOLLOWED);
        let report = main_device.port_report().expect("all answer");
        assert_eq!(neighbours(&report), in_a_row(COUNT, is_ring));
        for (at, it) in report.iter().enumerate() {
            assert_eq!((it.position, it.subdevice), (Position(at as u16), Position(at as u16).into()));
            let used = it.ports.map(|port| port.registers.expect("it answers").link);
            assert_eq!(used, it.ports.map(|port| port.neighbour.is_some()), "{at}");
            let closed = it.ports.map(|port| port.registers.expect("it answers").loop_closed);
            assert_eq!(closed, used.map(|used| !used));
            let error = it.delay_ns.map(|delay| (delay - HOP_NS * at as i64).abs());
            assert!(error.is_some_and(|error| error <= 10), "SubDevice {at}: {it:?}");
            let next = it.ports[1].delay_ns;
            assert_eq!(next.is_some(), at + 1 < COUNT);
            assert!(next.is_none_or(|next| (next - HOP_NS).abs() <= 20), "{next:?}");
        }
        // Damaged frames, and a SubDevice that does not answer.
        let corrupt = Fault::Corrupt { cable: CableId(2), direction: None, count: 4 };
        main_device.links_mut().network_mut().apply(corrupt);
        main_device.attend(Duration::from_secs(1));
        let report = main_device.port_report().expect("all answer");
        let counts = |at: usize, port: usize| report[at].ports[port].registers.expect("it answers").invalid_frames;
        assert!(counts(2, 0) > 0, "{:?}", report[2].ports[0]);
        assert_eq!((0..COUNT).filter(|at| counts(*at, 0) > 0).count(), 1);
        main_device.links_mut().network_mut().apply(Fault::PowerOff(DeviceIndex(COUNT - 1)));
        let report = main_device.port_report().expect("it can be asked");
        let silent = |it: &SubDevicePorts| it.unit_errors.is_none() && it.ports.iter().all(|p| p.registers.is_none());
        assert!(silent(&report[COUNT - 1]) && !report[..COUNT - 1].iter().any(silent));
    }
}

/// A ring is opened at its last port for the delays, and closed again: nothing is reported, and no transfer fails.
// covers: registers, ring-goes-on
#[test]
fn delays_of_a_ring_without_an_application_are_measured_and_it_is_closed_again() {
    const COUNT: usize = 12;
    for with_idle in [true, false] {
        let options_of = Options::default().with_idle_operation(with_idle);
        let network = ring(clocked_segment(COUNT), options());
        let mut main_device = MainDevice::request(Tap::new(network), &options_of);
        main_device.scan().expect("a scan");
        main_device.attend(FOLLOWED);
        while main_device.pop_event().is_some() {}
        for _ in 0..5 {
            let begun = main_device.now();
            let report = main_device.port_report().expect("all answer");
            assert!(main_device.now().since(begun) < Duration::from_millis(100));
            assert!(report.iter().all(|it| it.delay_ns.is_some()), "{report:?}");
            let loops = |device: &ringcat_sim::device::Device| device.controller.register(map::DL_CONTROL, 2)[1];
            assert!(main_device.links_mut().network().devices().all(|device| loops(device) == 0));
            main_device.attend(Duration::from_millis(200));
            let said: Vec<_> = std::iter::from_fn(|| main_device.pop_event()).collect();
            assert!(said.is_empty(), "idle operation {with_idle}: {said:?}");
        }
        // A job that no longer waits leaves the ring closed as well.
        for after in 0..40 {
            let report = main_device.engine_mut().start_port_report();
            main_device.attend(Duration::from_micros(150 * after));
            drop(report);
            main_device.attend(Duration::from_millis(100));
            let loops = |device: &ringcat_sim::device::Device| device.controller.register(map::DL_CONTROL, 2)[1];
            assert!(main_device.links_mut().network().devices().all(|device| loops(device) == 0), "{after}");
        }
        assert!(std::iter::from_fn(|| main_device.pop_event()).next().is_none());
    }
}

/// An application begins at every moment of a measurement: the ring is closed again, and its opening is no event.
// covers: registers, ring-cut
#[test]
fn an_application_that_begins_while_delays_are_measured_reports_no_open_ring() {
    for after in 0..40 {
        let mut main_device = idle(ring(clocked_segment(6), options()));
        let report = main_device.engine_mut().start_port_report();
        main_device.attend(Duration::from_micros(150 * after));
        let declaration = automatic(&main_device.subdevices(), Duration::from_millis(1));
        let mut application = main_device.activate(declaration).map_err(Error::from).expect("it fits");
        application.wait_until_op(LIMIT).expect("all are well");
        (0..200).for_each(|_| application.cycle(|_| ()));
        drop(report);
        let events: Vec<Event> = std::iter::from_fn(|| application.pop_event()).map(|timed| timed.event).collect();
        let of_ring = |event: &&Event| event.subject() == Subject::Ring;
        let seen: Vec<&Event> = events.iter().filter(of_ring).collect();
        assert!(seen.is_empty(), "{after}: {seen:?}");
        let loops = |device: &ringcat_sim::device::Device| device.controller.register(map::DL_CONTROL, 2)[1];
        assert!(application.links_mut().network().devices().all(|device| loops(device) == 0), "{after}");
    }
}

/// A cable is cut, or SubDevices lose their power, at every moment of a measurement: it is followed as at any time.
// covers: registers, ring-cut
#[test]
fn a_ring_that_breaks_while_it_is_measured_is_followed() {
    for cable in [0, 2, 6] {
        for after in 0..30 {
            let network = ring(clocked_segment(6), options());
            let mut main_device = MainDevice::request(Tap::new(network), &Options::default().with_idle_operation(true));
            main_device.attend(FOLLOWED);
            let report = main_device.engine_mut().start_port_report();
            main_device.attend(Duration::from_micros(200 * after));
            main_device.links_mut().network_mut().apply(Fault::Cut(CableId(cable)));
            main_device.attend(Duration::from_secs(2));
            drop(report);
            assert_eq!(main_device.subdevices().len(), 6, "cable {cable}, {after}");
            let delays = main_device.port_report().expect("all answer");
            let error = |(at, it): (usize, &SubDevicePorts)| Some((it.delay_ns? - HOP_NS * at as i64).abs());
            if cable == 6 {
                let errors = delays.iter().enumerate().map(error);
                assert!(errors.clone().all(|error| error.is_some_and(|error| error <= 20)), "{after}: {delays:?}");
            }
            main_device.links_mut().network_mut().apply(Fault::Heal(CableId(cable)));
            main_device.attend(Duration::from_secs(1));
            let delays = main_device.port_report().expect("all answer");
            let errors = delays.iter().enumerate().map(error);
            assert!(errors.clone().all(|error| error.is_some_and(|error| error <= 20)), "{after}: {delays:?}");
        }
    }
}

// covers: registers
#[test]
fn a_port_report_beside_an_application_names_declared_ones_and_disturbs_no_cycle() {
    let mut world = World::in_op(4, ring(descriptions(&KINDS), options()));
    let mark = world.mark();
    let report = world.application_mut().engine_mut().start_port_report();
    let report = world.finish(LIMIT, report).expect("all answer");
    assert_eq!(neighbours(&report), in_a_row(KINDS.len(), true));
    let declared = |(at, it): (usize, &SubDevicePorts)| it.subdevice == SubDeviceId(at).into();
    assert!(report.iter().enumerate().all(declared));
    assert_eq!((world.incomplete(mark), world.left_op(mark)), (0, Vec::new()));
}

// covers: eeprom
#[test]
fn the_owner_of_an_eeprom_is_read_and_assigned() {
    let mut main_device = idle(line(descriptions(&KINDS), options()));
    let both = |main_device: &mut MainDevice<Tap>| {
        let owner = main_device.subdevice(Position(3)).eeprom_owner().expect("it answers");
        (owner.assigned, owner.active)
    };
    let assign = |main_device: &mut MainDevice<Tap>, assignment| {
        let owner = main_device.subdevice(Position(3)).assign_eeprom(assignment).expect("it answers");
        (owner.assigned, owner.active)
    };
    let take = |main_device: &mut MainDevice<Tap>, value: u8| {
        let network = main_device.links_mut().network_mut();
        let now = network.now();
        let controller = &mut network.device_mut(DeviceIndex(3)).controller;
        assert!(controller.pdi_write(map::SII_PDI_ACCESS, &[value], now), "the PDI works");
    };
    use EepromOwner::{Ethercat, Pdi};
    assert_eq!(both(&mut main_device), (Ethercat, Ethercat));
    assert_eq!(assign(&mut main_device, EepromAssignment::ToPdi), (Pdi, Ethercat));
    take(&mut main_device, 1);
    assert_eq!(both(&mut main_device), (Pdi, Pdi));
    // The PDI keeps it until it gives it back, or until it is taken.
    assert_eq!(assign(&mut main_device, EepromAssignment::ToEthercat), (Ethercat, Pdi));
    take(&mut main_device, 0);
    assert_eq!(both(&mut main_device), (Ethercat, Ethercat));
    assign(&mut main_device, EepromAssignment::ToPdi);
    take(&mut main_device, 1);
    assert_eq!(assign(&mut main_device, EepromAssignment::Force), (Ethercat, Ethercat));
    // A function that needs it takes it, and gives it back.
    assign(&mut main_device, EepromAssignment::ToPdi);
    take(&mut main_device, 1);
    let image = main_device.subdevice(Position(3)).sii_read().expect("it is taken");
    assert_eq!(image, main_device.links_mut().network().device(DeviceIndex(3)).controller.sii_image());
    assert_eq!(both(&mut main_device).0, Pdi);
    main_device.subdevice(Position(3)).sii_reload().expect("it is taken");
    let error = main_device.subdevice(Position(99)).eeprom_owner().expect_err("there is none");
    assert!(matches!(error, Error::SubDevice(_)), "{error}");
}

// covers: jobs
#[test]
fn each_client_of_events_has_its_own_queue_and_subjects() {
    let mut world = World::in_op(5, ring(descriptions(&KINDS), options()));
    let mark = world.mark();
    let engine = world.application_mut().engine_mut();
    let rings = engine.register_client(Subjects::NONE.with(Subject::Ring), 100).expect("there is room");
    let all = engine.register_client(Subjects::ALL, 100).expect("there is room");
    let small = engine.register_client(Subjects::ALL, 2).expect("there is room");
    for cable in [2, 4] {
        world.cut(CableId(cable));
        world.run_cycles(50);
        world.heal(CableId(cable));
        world.run_cycles(50);
    }
    world.power_off(DeviceIndex(4));
    world.run_cycles(100);
    let of = |world: &mut World, client| -> (Vec<TimedEvent>, u64) {
        let events = world.application_mut().engine_mut().take_client_events(client).expect("it is registered");
        (events.events, events.missed)
    };
    let reported: Vec<TimedEvent> = world.events(mark).to_vec();
    assert!(reported.iter().any(|timed| matches!(timed.event, Event::Lost { .. })), "{reported:?}");
    assert_eq!(of(&mut world, all), (reported.clone(), 0), "the application takes nothing from a client");
    let of_ring: Vec<TimedEvent> =
        reported.iter().filter(|timed| timed.event.subject() == Subject::Ring).cloned().collect();
    assert!(of_ring.len() >= 4 && of_ring.len() < reported.len());
    assert_eq!(of(&mut world, rings), (of_ring, 0));
    let (kept, missed) = of(&mut world, small);
    assert_eq!((kept.as_slice(), missed), (&reported[reported.len() - 2..], reported.len() as u64 - 2));
    assert_eq!(of(&mut world, all), (Vec::new(), 0));
    // Another subject, and the end.
    let engine = world.application_mut().engine_mut();
    assert!(engine.set_client_subjects(rings, Subjects::NONE.with(Subject::Domains)));
    assert!(engine.unregister_client(all) && engine.take_client_events(all).is_none());
    world.power_on(DeviceIndex(4));
    world.settle();
    let (domains, _) = of(&mut world, rings);
    assert!(!domains.is_empty() && domains.iter().all(|timed| timed.event.subject() == Subject::Domains));
}

// covers: jobs
#[test]
fn clients_of_events_stay_over_stops_and_need_no_application_that_fetches() {
    let mut main_device = MainDevice::request(Tap::new(ring(descriptions(&KINDS), options())), &Options::default());
    let client = main_device.register_client(Subjects::ALL, 4096).expect("there is room");
    let scan = main_device.scan().expect("it is stable");
    let declaration = ringcat::automatic(&scan.subdevices, scenarios::world::CYCLE);
    let mut application = main_device.activate(declaration).map_err(Error::from).expect("it fits");
    (0..500).for_each(|_| application.cycle(|_| ()));
    // Events of the cyclic half do not wait for the application, which fetches none.
    for _ in 0..400 {
        application.links_mut().network_mut().apply(Fault::Drop { cable: CableId(0), direction: None, count: 4 });
        (0..5).for_each(|_| application.cycle(|_| ()));
    }
    let events = application.client_events(client).expect("it is registered");
    let domains = events.events.iter().filter(|timed| timed.event.subject() == Subject::Domains).count();
    assert!(domains > 400, "{domains} of {}", events.events.len());
    let numbers: Vec<u64> = events.events.iter().map(|timed| timed.number).collect();
    assert!(numbers.is_sorted_by(|a, b| a < b));
    let mut stopped = application.deactivate(ringcat::LastOutputs::Zero, LIMIT).expect("all follow");
    stopped.scan().expect("it is stable");
    let events = stopped.client_events(client).expect("it is still registered");
    assert!(events.events.iter().any(|timed| matches!(timed.event, Event::ScanFinished { .. })));
}
