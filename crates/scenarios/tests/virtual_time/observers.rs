//! Snapshots of process data for other threads, rates of links, probes of a cycle, images in memory of the application.

use std::cell::{Cell, RefCell};
use std::time::Duration;

use ringcat::{
    CycleJob, Declaration, Direction, DomainId, DomainState, Instant, JobProbe, LastOutputs, Link, Links, MainDevice,
    Options, Scan, SubDeviceConfig, SubDeviceId, automatic,
};
use ringcat::{FramesIn, simulated::SimulatedSegment};
use ringcat_sim::cable::{CableId, HostLink};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::al::AlState;
use ringcat_wire::frame::MacAddress;
use scenarios::segments::{descriptions, line, ring, ring_of_16};
use scenarios::world::{CYCLE, World};

const FAST: Duration = Duration::from_micros(10);
const FIRST: DomainId = DomainId(0);

/// Every second SubDevice in a domain of twice the period.
fn two_domains(scan: &Scan) -> Declaration {
    let mut declaration = Declaration::new(CYCLE);
    let slow = declaration.add_domain(2 * CYCLE);
    for (number, info) in scan.subdevices.iter().enumerate() {
        declaration.add_to(if number % 2 == 0 { FIRST } else { slow }, SubDeviceConfig::from_info(info));
    }
    declaration
}

fn worlds() -> [World; 3] {
    let alone = line(descriptions(&["servo", "block"]), NetworkOptions::default());
    let mut two = World::with(2, ring_of_16(FAST), &Options::default(), two_domains).expect("it fits");
    two.settle();
    [World::in_op(1, alone), two, World::in_op(3, ring_of_16(FAST))]
}

// covers: threads
#[test]
fn a_snapshot_shows_the_images_and_states_of_one_cycle() {
    for mut world in worlds() {
        let observer = world.application().observer();
        let domains = world.application().exchange().domain_count();
        for _ in 0..20 {
            let request = observer.request();
            assert!(observer.take(request).is_none(), "no cycle has run");
            let seen = RefCell::new(Vec::new());
            let mut taken = None;
            for _ in 0..3 {
                world.application_mut().cycle(|data| {
                    let images: Vec<_> = (0..domains).map(|at| data.image(DomainId(at)).to_vec()).collect();
                    let states: Vec<_> = (0..domains).map(|at| data.status(DomainId(at)).expect("declared")).collect();
                    seen.borrow_mut().push((data.cycle(), data.now(), images, states));
                    data.fill_outputs(data.cycle() as u8);
                });
                taken = taken.or_else(|| observer.take(request));
            }
            let snapshot = taken.expect("two cycles answer a request");
            let seen = seen.into_inner();
            let of_cycle = seen.iter().find(|(cycle, ..)| *cycle == snapshot.cycle).expect("it is a cycle since then");
            assert_eq!(snapshot.taken_at, of_cycle.1);
            for (domain, shown) in snapshot.domains.iter().enumerate() {
                assert_eq!((&shown.image, shown.status), (&of_cycle.2[domain], of_cycle.3[domain]));
                assert_eq!(shown.status.state, DomainState::Complete);
            }
            // Each evaluated domain shows its working counters, all of them from the main link.
            let shown: Vec<_> = snapshot.domains.iter().filter_map(|it| Some((it.wkc_by_link?, it.status))).collect();
            assert!(shown.iter().all(|(by_link, status)| by_link.iter().sum::<u32>() == status.wkc));
            assert!(snapshot.domains[0].wkc_by_link.is_some());
        }
        // Without a request nothing is written.
        let request = observer.request();
        (0..3).for_each(|_| world.application_mut().cycle(|_| ()));
        let last = observer.take(request).expect("it is answered");
        (0..50).for_each(|_| world.application_mut().cycle(|_| ()));
        assert_eq!(observer.take(request), Some(last));
    }
}

// covers: threads
#[test]
fn working_counters_by_link_show_the_sides_of_a_break() {
    let mut world = World::in_op(4, ring_of_16(FAST));
    let observer = world.application().observer();
    let by_link = |world: &mut World| {
        let request = observer.request();
        world.run_cycles(3);
        let snapshot = observer.take(request).expect("it is answered");
        (snapshot.domains[0].wkc_by_link.expect("it is evaluated"), snapshot.domains[0].status)
    };
    let ([main, redundant], closed) = by_link(&mut world);
    assert_eq!((main, redundant), (closed.expected, 0));
    let directory = world.application().directory().clone();
    for cable in [0, 5, 12, 16] {
        world.cut(CableId(cable));
        world.run_cycles(30);
        let before: u32 = (0..cable).map(|subdevice| directory.contribution(SubDeviceId(subdevice))).sum();
        let (by_link, status) = by_link(&mut world);
        assert_eq!(by_link, [before, status.expected - before], "cable {cable}: {status:?}");
        world.heal(CableId(cable));
        world.run_cycles(30);
    }
}

// covers: threads
#[test]
fn an_application_with_a_loop_of_its_own_answers_requests_too() {
    let mut world = World::in_op(5, ring_of_16(FAST));
    let observer = world.application().observer();
    for processes in [true, false] {
        let request = observer.request();
        for _ in 0..3 {
            let application = world.application_mut();
            application.receive();
            if processes {
                assert_eq!(application.process(FIRST).state, DomainState::Complete);
            }
            application.queue(FIRST);
            application.send();
            world.network_mut().advance_by(CYCLE);
        }
        let snapshot = observer.take(request).expect("it is answered");
        assert_eq!(snapshot.domains[0].wkc_by_link.is_some(), processes, "it was not evaluated otherwise");
        assert_eq!(snapshot.domains[0].image.len(), world.application().exchange().image(FIRST).len());
    }
}

// covers: threads
#[test]
fn fmmus_are_those_in_the_registers_of_the_subdevices() {
    use ringcat_wire::address::RegisterAddress;
    let mut world = World::with(6, ring_of_16(FAST), &Options::default(), two_domains).expect("it fits");
    world.settle();
    let observer = world.application().observer();
    let mut found = 0;
    for fmmu in observer.fmmus() {
        let device = world.device_of(fmmu.subdevice.0).expect("it is there");
        let controller = &world.network().device(device).controller;
        let set = (0..8).any(|number| {
            // FMMU: logical start, length; type at offset 11: 1 reads, 2 writes (protocol 3.10).
            let words = controller.register(RegisterAddress(0x0600 + 16 * number), 16);
            let logical = u32::from_le_bytes([words[0], words[1], words[2], words[3]]);
            let length = u16::from_le_bytes([words[4], words[5]]);
            let direction = if fmmu.direction == Direction::Inputs { 1 } else { 2 };
            (logical, length, words[11], words[12] & 1) == (fmmu.logical.0, fmmu.length, direction, 1)
        });
        assert!(set, "{fmmu:?}");
        found += 1;
    }
    let areas = (0..16).flat_map(|subdevice| world.application().directory().areas(SubDeviceId(subdevice)));
    assert_eq!(found, areas.filter(|area| area.placed.area.length > 0).count());
    assert!(found > 10 && observer.fmmus().iter().any(|fmmu| fmmu.domain == DomainId(1)));
}

// covers: threads
#[test]
fn rates_of_links_are_those_that_the_segment_has_counted() {
    let period = 5 * CYCLE;
    let network = ring(descriptions(&["digital-input-8", "digital-output-8"]), NetworkOptions::default());
    let declare = |scan: &Scan| automatic(&scan.subdevices, period);
    let mut world = World::with(7, network, &Options::default(), declare).expect("it fits");
    world.settle();
    let observer = world.application().observer();
    let cycles = |world: &mut World, seconds: u64| {
        let end = world.application().now() + Duration::from_secs(seconds);
        while world.application().now() < end {
            world.application_mut().cycle(|_| ());
        }
    };
    cycles(&mut world, 2);
    for (host, link) in [(HostLink::Main, Link::Main), (HostLink::Redundant, Link::Redundant)] {
        let shown = observer.link(link);
        let counted = world.network().statistics().link(host).frames_sent;
        assert!(shown.frames <= counted && counted - shown.frames < 260, "{shown:?}, {counted} counted");
    }
    // The copies of some frames on one link.
    let lost = 6;
    for _ in 0..lost {
        world.network_mut().apply(Fault::Drop { cable: CableId(0), direction: None, count: 1 });
        cycles(&mut world, 1);
    }
    let all = Link::ALL.map(|link| observer.link(link));
    let sum: u64 = all.iter().map(|shown| shown.lost).sum();
    // A drop counts a frame in each direction.
    assert!((lost..=2 * lost).contains(&sum), "{all:?}");
    cycles(&mut world, 70);
    let before = Link::ALL.map(|link| (observer.link(link), link));
    let at = world.application().now();
    let sent = |world: &World| world.network().statistics().link(HostLink::Main);
    let counted = sent(&world);
    cycles(&mut world, 61);
    let elapsed = world.application().now().since(at).as_secs_f64();
    let after = sent(&world);
    let frames_per_s = (after.frames_sent - counted.frames_sent) as f64 / elapsed;
    let bytes_per_s = (after.bytes_sent - counted.bytes_sent) as f64 / elapsed;
    for (earlier, link) in before {
        let shown = observer.link(link);
        assert_eq!(shown.lost, earlier.lost);
        let spans = shown.rates.map(|rate| rate.over.as_secs_f64().round() as u64);
        assert_eq!(spans, [1, 10, 60], "{shown:?}");
        for rate in shown.rates {
            let is_near = |shown: f64, counted: f64| (shown - counted).abs() < 0.03 * counted;
            assert!(is_near(rate.frames_per_s, frames_per_s), "{rate:?}, {frames_per_s} counted");
            assert!(is_near(rate.bytes_per_s, bytes_per_s), "{rate:?}, {bytes_per_s} counted");
            assert_eq!((rate.lost_per_s, rate.lost_share), (0.0, 0.0));
        }
    }
}

// covers: layout
#[test]
fn an_image_lies_in_memory_of_the_application_and_outlives_it() {
    for is_ring in [false, true] {
        let network = if is_ring { ring } else { line };
        let network = network(descriptions(&["block", "servo", "block"]), NetworkOptions::default());
        let mut main_device = MainDevice::request(SimulatedSegment::new(network), &Options::default());
        let scan = main_device.scan().expect("all are there");
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        let memory: &'static mut [u8] = Vec::leak(vec![0x55; 4096]);
        let address = memory.as_ptr();
        declaration.place_image(FIRST, memory);
        let mut application = main_device.activate(declaration).map_err(|refused| refused.error).expect("it fits");
        let image = application.exchange().image(FIRST);
        assert_eq!((image.as_ptr(), image[0], image.len() < 4096), (address, 0x55, true), "its content stays");
        application.wait_until_op(Duration::from_secs(5)).expect("it settles");
        for cycle in 0..50 {
            application.cycle(|data| data.fill_outputs(cycle));
        }
        // The inputs of a block are its outputs.
        let length = application.exchange().image(FIRST).len();
        let back = application.exchange_mut().give_memory_back(FIRST).expect("it was given");
        assert_eq!((back.as_ptr(), back.len()), (address, length));
        assert_eq!(back, application.exchange().image(FIRST), "the image continues in own memory");
        let blocks = back.iter().filter(|byte| [49, 48, 47].contains(*byte)).count();
        assert!(blocks >= 1_600, "{blocks} bytes of outputs and inputs");
        assert!(application.exchange_mut().give_memory_back(FIRST).is_none());
        application.cycle(|data| data.fill_outputs(77));
        application.stop(LastOutputs::Zero, AlState::Init, Duration::from_secs(2)).expect("it stops");
        back[0] = 1;
        assert!(back.iter().filter(|byte| [49, 48, 47].contains(*byte)).count() + 1 >= blocks, "it is valid");
    }
}

// covers: layout
#[test]
fn memory_that_is_too_short_or_has_two_owners_is_refused_and_comes_back() {
    let network = line(descriptions(&["block", "digital-output-8"]), NetworkOptions::default());
    let mut main_device = MainDevice::request(SimulatedSegment::new(network), &Options::default());
    let scan = main_device.scan().expect("all are there");
    let mut declaration = automatic(&scan.subdevices, CYCLE);
    declaration.place_image(FIRST, Vec::leak(vec![0; 800]));
    let copy = declaration.clone();
    let refused = main_device.activate(declaration).expect_err("a copy has the memory");
    assert!(refused.error.to_string().contains("domain 0: a copy of the declaration has the memory"));
    let mut main_device = refused.main_device;
    let refused = main_device.activate(copy).expect_err("801 bytes");
    assert_eq!(refused.error.to_string(), "activation: domain 0: its image has 801 bytes, the memory for it 800");
    main_device = refused.main_device;
    let back = main_device.unused_memory(FIRST).expect("it was not used");
    assert_eq!(back.len(), 800);
    let mut declaration = automatic(&scan.subdevices, CYCLE);
    declaration.place_image(FIRST, back);
    declaration.domains[FIRST.0].under_way = 0;
    assert!(main_device.load(declaration).is_err(), "an error of the declaration alone");
    let back = main_device.unused_memory(FIRST).expect("it comes back, too");
    assert_eq!(back.len(), 800);
    let mut declaration = automatic(&scan.subdevices, CYCLE);
    declaration.place_image(FIRST, Vec::leak(vec![0; 801]));
    let mut application = main_device.activate(declaration).map_err(|refused| refused.error).expect("it fits");
    application.wait_until_op(Duration::from_secs(5)).expect("it settles");
}

/// Links whose clock advances with each reading, so that each job takes a time.
struct Ticking {
    segment: SimulatedSegment,
    ticks: Cell<u64>,
}

impl Links for Ticking {
    fn now(&self) -> Instant {
        self.ticks.set(self.ticks.get() + 1_000);
        Instant(self.segment.now().0 + self.ticks.get())
    }

    fn addresses(&self) -> ringcat::PerLink<MacAddress> {
        self.segment.addresses()
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        self.segment.send(link, frame);
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        self.segment.receive(take)
    }

    fn wait(&mut self, until: Instant) {
        let ticks = self.ticks.get();
        self.segment.wait(Instant(until.0.saturating_sub(ticks)));
    }
}

// covers: cycles
#[test]
fn each_job_of_a_cycle_has_its_time_once_per_cycle() {
    let network = ring(descriptions(&["block", "digital-output-8"]), NetworkOptions::default());
    let links = Ticking { segment: SimulatedSegment::new(network), ticks: Cell::new(0) };
    let mut main_device = MainDevice::request(links, &Options::default());
    let scan = main_device.scan().expect("all are there");
    let declaration = automatic(&scan.subdevices, CYCLE);
    let mut application = main_device.activate(declaration).map_err(|refused| refused.error).expect("it fits");
    application.wait_until_op(Duration::from_secs(5)).expect("it settles");
    let mut probe = JobProbe::default();
    let count = |probe: &JobProbe| CycleJob::ALL.map(|job| probe.times().of(job).histogram().count());
    for _ in 0..200 {
        application.cycle_probed(&mut probe, |data| data.fill_outputs(1));
    }
    assert_eq!(count(&probe), [200; 5]);
    for job in CycleJob::ALL {
        let time = probe.times().of(job);
        let (shortest, longest) = (time.histogram().shortest(), time.histogram().longest());
        assert!(shortest >= Duration::from_micros(1), "{job:?}: each takes one reading at least");
        assert!(shortest <= time.mean() && time.mean() <= longest && longest < CYCLE, "{job:?}: {time:?}");
    }
    // The same in parts.
    let mut probe = JobProbe::default();
    for _ in 0..100 {
        let mut parts = application.probed(&mut probe);
        let limit = parts.work(|application| application.now()) + CYCLE;
        assert!(parts.receive_until(limit));
        assert_eq!(parts.process(FIRST).state, DomainState::Complete);
        assert!(parts.queue(FIRST));
        parts.send();
    }
    assert_eq!(count(&probe), [100; 5]);
}

// covers: cycles
#[test]
fn the_return_of_the_last_frame_is_reported_once_per_cycle_and_not_where_it_is_lost() {
    for (seed, is_ring, detection) in [(8, false, FAST), (9, true, FAST)] {
        let network = if is_ring { ring } else { line };
        let options = NetworkOptions::default().with_detection_delay(detection);
        // Several frames.
        let mut world = World::in_op(seed, network(descriptions(&["block"; 6]), options));
        let cycle = |world: &mut World, cycles: u64| {
            let returns = RefCell::new(Vec::new());
            let mut probe = FramesIn::new(|at: Instant| returns.borrow_mut().push(at));
            let application = world.application_mut();
            for _ in 0..cycles {
                let before = application.begun_at();
                application.cycle_probed(&mut probe, |_| ());
                // It comes before the cycle begins that evaluates the frames.
                let begun_at = application.begun_at();
                assert!(returns.borrow().iter().all(|at| *at <= begun_at), "after {before:?}");
            }
            returns.into_inner()
        };
        let returns = cycle(&mut world, 100);
        assert_eq!(returns.len(), 100, "ring: {is_ring}");
        assert!(returns.windows(2).all(|pair| pair[0] < pair[1]));
        // All copies of a frame are lost; its cycle is not reported.
        for link in [Link::Main, Link::Redundant] {
            let host = if link == Link::Main { HostLink::Main } else { HostLink::Redundant };
            if let Some(cable) = world.network().host_cable(host) {
                world.network_mut().apply(Fault::Drop { cable, direction: None, count: 1 });
            }
        }
        let mark = world.mark();
        let lossy = cycle(&mut world, 20).len();
        assert!((17..=19).contains(&lossy), "ring: {is_ring}: {lossy}");
        assert_eq!(world.left_op(mark), []);
        // In parts: the wait ends with the last frame.
        for _ in 0..50 {
            let application = world.application_mut();
            let limit = application.now() + CYCLE;
            assert!(application.receive_until(limit));
            assert!(application.now() < limit, "it waited until the limit");
            assert_eq!(application.process(FIRST).state, DomainState::Complete, "all frames are in");
            assert!(application.queue(FIRST));
            application.send();
        }
        // A lost frame: the wait ends at its limit.
        let cable = world.network().host_cable(HostLink::Main).expect("a main link");
        let application = world.application_mut();
        application.receive_until(application.now() + CYCLE);
        application.process(FIRST);
        application.queue(FIRST);
        if !is_ring {
            application.links_mut().network_mut().apply(Fault::Drop { cable, direction: None, count: 1 });
            application.send();
            let limit = application.now() + CYCLE;
            assert!(!application.receive_until(limit));
            assert_eq!(application.now(), limit);
        }
    }
}
