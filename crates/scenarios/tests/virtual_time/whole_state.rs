//! A program beside the application follows the state: a snapshot of the whole, then the events since, by number.

use std::time::Duration;

use ringcat::{
    Activity, Application, DomainId, Event, EventsSince, LastOutputs, MainDevice, Options, Progress, Snapshot,
    automatic,
};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::NetworkOptions;
use scenarios::dice::Dice;
use scenarios::segments::{descriptions, line, ring};
use scenarios::tap::Tap;
use scenarios::world::{CYCLE, World};

const KINDS: [&str; 4] = ["coupler", "digital-input-8", "all-protocols", "digital-output-8"];
/// Events that the engine keeps.
const KEPT: usize = 4096;
/// Maximum number of events of the cyclic half that wait until they are requested.
const QUEUE: u64 = 1024;

fn world(seed: u64) -> World {
    let options = NetworkOptions::default().with_detection_delay(Duration::from_micros(10));
    World::in_op(seed, ring(descriptions(&KINDS), options))
}

fn snapshot(world: &mut World) -> Snapshot {
    world.application_mut().engine_mut().snapshot()
}

fn since(world: &mut World, number: u64) -> EventsSince {
    world.application_mut().engine_mut().events_since(number)
}

fn disturb(world: &mut World) {
    world.cut(CableId(2));
    world.run_cycles(30);
    world.heal(CableId(2));
    world.run_cycles(30);
    world.power_off(DeviceIndex(1));
    world.run_cycles(30);
    world.power_on(DeviceIndex(1));
    world.settle();
}

// covers: jobs
#[test]
fn a_client_that_was_away_reads_all_events_or_how_many_it_missed() {
    let mut world = world(1);
    let mark = world.mark();
    let before = snapshot(&mut world);
    disturb(&mut world);
    world.run_cycles(5);
    let missed = since(&mut world, before.next_event);
    // The application has fetched all of them meanwhile.
    assert_eq!(missed.events, world.events(mark));
    assert!(missed.events.len() > 8 && missed.missed == 0 && missed.epoch == before.epoch, "{missed:?}");
    let numbers: Vec<u64> = missed.events.iter().map(|event| event.number).collect();
    assert_eq!(numbers, (before.next_event..missed.next).collect::<Vec<_>>());
    assert_eq!(since(&mut world, missed.next).events, []);
    // Longer than the engine keeps.
    let bus = world.application_mut().engine_mut().bus();
    for _ in 0..KEPT {
        bus.report(Event::Skipped { domain: ringcat::DomainId(0) });
    }
    let rest = since(&mut world, before.next_event);
    assert_eq!((rest.events.len(), rest.missed), (KEPT, missed.next - before.next_event));
    assert_eq!(rest.next, missed.next + KEPT as u64);
}

// covers: jobs
#[test]
fn a_snapshot_and_the_events_before_it_agree_at_every_cycle() {
    let mut world = world(2);
    let mut seen = [false; 3];
    let mut from = snapshot(&mut world).next_event;
    let mut absent = false;
    for cycle in 0..400 {
        match cycle {
            20 => world.cut(CableId(2)),
            80 => world.heal(CableId(2)),
            120 => world.power_off(DeviceIndex(1)),
            200 => world.power_on(DeviceIndex(1)),
            _ => {}
        }
        world.cycle();
        let state = snapshot(&mut world);
        let since = since(&mut world, from);
        assert_eq!((since.next, since.missed), (state.next_event, 0));
        from = since.next;
        for event in since.events {
            absent = match event.event {
                Event::Lost { .. } => true,
                Event::Returned { .. } => false,
                _ => absent,
            };
        }
        let own = &state.subdevices[1];
        assert_eq!(own.progress == Progress::Absent, absent, "cycle {cycle}");
        let states = world.application().states();
        assert_eq!(
            (state.activity, state.subdevices.len(), states.len()),
            (Activity::Active, KINDS.len(), KINDS.len())
        );
        let status = world.application().engine().ring_status();
        assert_eq!(state.ring.changes, status.changes);
        seen[0] |= own.progress == Progress::Absent;
        seen[1] |= state.ring.closed == Some(false) && state.ring.break_at.is_some();
        seen[2] |= own.progress == Progress::Settled && state.ring.closed == Some(true) && cycle > 250;
    }
    assert_eq!(seen, [true; 3], "absent, broken, all well again");
    assert_eq!(snapshot(&mut world).subdevices[2].identity[0], 0x0C47);
}

/// Without an application, beside one that names none of them, and one that came later.
// covers: jobs
#[test]
fn a_snapshot_has_identity_and_mailbox_of_subdevices_without_a_declaration() {
    use ringcat::{Declaration, Error, MainDevice, Options};
    let mut network = ring(descriptions(&KINDS), NetworkOptions::default());
    network.power_off(DeviceIndex(3));
    let options = Options::default().with_idle_operation(true).with_pdos(ringcat::ReadPdos::Always);
    let mut main_device = MainDevice::request(scenarios::tap::Tap::new(network), &options);
    main_device.attend(Duration::from_secs(1));
    main_device.subdevice(ringcat::Position(2)).sdo_read::<u32>(0x1018, 1).expect("it answers");
    let check = |state: &Snapshot, count: usize, text: &str| {
        assert_eq!(state.subdevices.len(), count, "{text}");
        let positions: Vec<Option<u16>> = state.subdevices.iter().map(|one| one.position).collect();
        assert_eq!(positions, (0..count as u16).map(Some).collect::<Vec<_>>(), "{text}");
        assert!(state.subdevices.iter().all(|one| one.identity[0] != 0 && one.declared.is_none()), "{text}");
        let device = &state.subdevices[2];
        assert!(device.mailbox_open && device.mail[0] > 0 && device.mail[1] > 0, "{text}: {device:?}");
        assert!(device.mailbox_bytes[0] >= 64 && device.mailbox_bytes[1] >= 64, "{text}: {device:?}");
        assert_eq!(device.protocols & 0x3E, 0x3E, "{text}: {device:?}");
        let without = &state.subdevices[1];
        assert_eq!((without.mailbox_bytes, without.protocols, without.mailbox_open), ([0; 2], 0, false), "{text}");
    };
    check(&main_device.engine_mut().snapshot(), 3, "idle");
    let declaration = Declaration::new(scenarios::world::CYCLE);
    let mut application = main_device.activate(declaration).map_err(Error::from).expect("it names none");
    (0..200).for_each(|_| application.cycle(|_| ()));
    check(&application.engine_mut().snapshot(), 3, "beside an application");
    application.links_mut().network_mut().power_on(DeviceIndex(3));
    (0..1_500).for_each(|_| application.cycle(|_| ()));
    check(&application.engine_mut().snapshot(), 4, "one came");
}

// covers: jobs
#[test]
fn numbers_of_events_go_on_after_a_stop_and_a_new_scan() {
    let mut world = world(3);
    let before = snapshot(&mut world);
    let now = world.application().now();
    let engine = world.application_mut().engine_mut();
    engine.start_stop(ringcat::AlState::Init, Duration::from_secs(1), now);
    let state = engine.snapshot();
    assert_eq!((state.activity, state.epoch), (Activity::Scanned, before.epoch));
    assert!(state.next_event >= before.next_event && state.subdevices.iter().all(|one| one.declared.is_none()));
    assert_eq!(engine.events_since(0).missed, 0, "the events before the stop are kept");
}

/// Runs an application that fetches no event, with cycles whose frames are lost: each is an event, and so is the next
/// cycle whose frame returns. Returns the number of the first of these events, and their count; `asked` gets the events
/// that a client reads every `ask` cycles.
fn disturbed(cycles: u64, ask: u64, asked: &mut Vec<EventsSince>) -> (Application<Tap>, u64, u64) {
    let network = ring(descriptions(&KINDS), NetworkOptions::default());
    let mut main_device = MainDevice::request(Tap::new(network), &Options::default());
    let scan = main_device.scan().expect("it can be scanned");
    let mut application = main_device.activate(automatic(&scan.subdevices, CYCLE)).expect("it fits");
    (0..1_000).for_each(|_| application.cycle(|_| ()));
    assert!(application.all_settled());
    let number = application.engine_mut().snapshot().next_event;
    application.links_mut().lose_per_mille(300, 1);
    let (mut raised, mut last, mut next) = (0, application.process(DomainId(0)).state, number);
    for cycle in 1..=cycles {
        application.cycle(|_| ());
        let state = application.process(DomainId(0)).state;
        raised += u64::from(std::mem::replace(&mut last, state) != state);
        if cycle % ask == 0 {
            let since = application.engine_mut().events_since(next);
            next = since.next;
            asked.push(since);
        }
    }
    application.links_mut().lose_per_mille(0, 1);
    assert!(raised > cycles / 10, "{raised} of {cycles}");
    (application, number, raised)
}

fn of_domains(since: &EventsSince) -> u64 {
    since.events.iter().filter(|event| matches!(event.event, Event::Domain { .. })).count() as u64
}

// covers: jobs
#[test]
fn a_client_gets_each_event_of_a_cycle_although_the_application_fetches_none() {
    let mut asked = Vec::new();
    let (_, _, raised) = disturbed(12_000, 100, &mut asked);
    assert_eq!((asked.iter().map(of_domains).sum::<u64>(), asked.len()), (raised, 120));
    assert!(asked.iter().all(|since| since.missed == 0), "none is missed");
}

// covers: jobs
#[test]
fn each_event_of_a_cycle_has_a_number_without_a_request_for_it() {
    for cycles in [400, 3_000, 12_000] {
        let (mut application, number, raised) = disturbed(cycles, u64::MAX, &mut Vec::new());
        // Events that are not in the result were missed.
        let since = application.engine_mut().events_since(number);
        assert!(since.next - number >= raised, "{} numbers for {raised} events", since.next - number);
        assert_eq!(since.events.len() as u64 + since.missed, since.next - number);
        assert!(since.events.len() <= KEPT && since.events.is_sorted_by_key(|event| event.number));
        assert_eq!(of_domains(&since), raised.min(QUEUE));
        // The end of the application takes no event away, and no count.
        let dropped = application.engine().events_dropped();
        let ended = application.deactivate(LastOutputs::Zero, Duration::from_secs(1));
        let mut main_device = ended.unwrap_or_else(|refused| panic!("{}", refused.error));
        let after = main_device.engine_mut().events_since(number);
        assert!(after.next >= since.next && main_device.engine().events_dropped() >= dropped);
        assert!(since.events.iter().all(|event| after.events.contains(event)), "the log has room for more");
        assert_eq!(after.events.len() as u64 + after.missed, after.next - number);
    }
}

// covers: jobs
#[test]
fn the_end_of_an_application_numbers_the_events_of_its_cycles() {
    for cycles in [400, 12_000] {
        let (application, number, raised) = disturbed(cycles, u64::MAX, &mut Vec::new());
        let dropped = application.engine().events_dropped();
        let ended = application.deactivate(LastOutputs::Zero, Duration::from_secs(1));
        let mut main_device = ended.unwrap_or_else(|refused| panic!("{}", refused.error));
        let since = main_device.engine_mut().events_since(number);
        assert!(since.next - number >= raised, "{} numbers for {raised} events", since.next - number);
        // The last cycles, in which no frame is lost, may be one more.
        let expected = raised.min(QUEUE)..=(raised + 1).min(QUEUE);
        assert!(expected.contains(&of_domains(&since)), "{} of {raised}", of_domains(&since));
        assert!(main_device.engine().events_dropped() >= dropped);
    }
}

/// Without an application: at each time of random scenarios the snapshot has as many SubDevices as the events up to its
/// number say, each with an address and a position of its own, and those that are there in the end.
// covers: jobs
#[test]
fn snapshots_of_undeclared_subdevices_and_numbered_events_agree_at_all_times() {
    for seed in 0..12 {
        let mut dice = Dice::new(seed);
        let size = 2 + dice.below(6) as usize;
        let kinds: Vec<&str> = (0..size).map(|_| *dice.pick(&KINDS)).collect();
        let is_ring = dice.one_in(2);
        let build = if is_ring { ring } else { line };
        let network = build(descriptions(&kinds), NetworkOptions::default());
        let mut main_device = MainDevice::request(Tap::new(network), &Options::default().with_idle_operation(true));
        let mut known = Known { next: 0, count: 0 };
        let mut text = format!("seed {seed}, {kinds:?}, ring {is_ring}");
        let attend = |main_device: &mut MainDevice<Tap>, known: &mut Known, ms: u64, text: &str| {
            for _ in 0..ms * 4 {
                main_device.attend(Duration::from_micros(250));
                known.follow(main_device, text);
            }
        };
        attend(&mut main_device, &mut known, 500, &text);
        assert_eq!(known.count, size, "{text}");
        for _ in 0..6 {
            let ms = *dice.pick(&[1, 4, 30, 120, 700]);
            let device = DeviceIndex(dice.below(size as u64) as usize);
            let cable = CableId(dice.below(size as u64) as usize);
            let (fault, undo) = match dice.below(2) {
                0 => (Fault::PowerOff(device), Fault::PowerOn(device)),
                _ => (Fault::Cut(cable), Fault::Heal(cable)),
            };
            text = format!("{text}\n  {fault:?} for {ms} ms");
            main_device.links_mut().network_mut().apply(fault);
            attend(&mut main_device, &mut known, ms, &text);
            main_device.links_mut().network_mut().apply(undo);
            let pause = *dice.pick(&[1, 30, 150, 900]);
            attend(&mut main_device, &mut known, pause, &text);
        }
        attend(&mut main_device, &mut known, 3_000, &text);
        let state = main_device.engine_mut().snapshot();
        let network = main_device.links_mut().network();
        assert_eq!((known.count, state.subdevices.len()), (size, size), "{text}");
        for (at, it) in state.subdevices.iter().enumerate() {
            let device = network.device(DeviceIndex(at));
            let station = device.controller.register(ringcat_wire::register::map::STATION_ADDRESS, 2);
            assert_eq!((it.position, it.declared), (Some(at as u16), None), "{text}");
            assert_eq!(it.station.to_le_bytes(), station, "{text}");
            assert_eq!(it.identity[1], scenarios::segments::describe(kinds[at], "x").identity.product_code, "{text}");
        }
    }
}

/// What the numbered events have said so far of a segment without an application.
struct Known {
    next: u64,
    count: usize,
}

impl Known {
    fn follow(&mut self, main_device: &mut MainDevice<Tap>, text: &str) {
        let state = main_device.engine_mut().snapshot();
        let since = main_device.engine_mut().events_since(self.next);
        assert_eq!((since.missed, since.next), (0, state.next_event), "{text}");
        self.next = since.next;
        for timed in &since.events {
            self.count = match timed.event {
                Event::SegmentChanged { subdevices, .. } | Event::ScanFinished { subdevices } => subdevices,
                _ => self.count,
            };
        }
        let events: Vec<&Event> = since.events.iter().map(|timed| &timed.event).collect();
        assert_eq!(state.subdevices.len(), self.count, "{text}\n{:?} {events:?}", main_device.now());
        let mut positions: Vec<_> = state.subdevices.iter().map(|it| it.position).collect();
        let mut stations: Vec<_> = state.subdevices.iter().map(|it| it.station).collect();
        positions.sort_unstable();
        stations.sort_unstable();
        positions.dedup();
        stations.dedup();
        assert_eq!((positions.len(), stations.len()), (self.count, self.count), "{text}: {state:?}");
    }
}
