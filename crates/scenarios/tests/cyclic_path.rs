//! After activation the cyclic path neither allocates nor frees memory, for any received frames.

use std::cell::Cell;
use std::time::Duration;

use ringcat::Taps;
use ringcat::eni::{EniFile, EniImage};
use ringcat::links::Links;
use ringcat::memory::MemoryLinks;
use ringcat::shared_segment::SharedSegment;
use ringcat::simulated::SimulatedSegment;
use ringcat::tee::Tee;
use ringcat_engine::domain::{DomainId, Freshness};
use ringcat_engine::exchange::{CopyRule, CyclicCounters, Entry, Received};
use ringcat_engine::link::Link;
use ringcat_engine::main_device::{MainDevice, Options, SubDeviceId};
use ringcat_engine::request::{RequestRefused, RequestState};
use ringcat_engine::time::Instant;
use ringcat_link::Recorder;
use ringcat_wire::address::RegisterAddress;
use ringcat_wire::frame::MacAddress;
use ringcat_wire::mailbox::soe::Idn;
use scenarios::answering_double::Cabling;
use scenarios::counting_allocator::{CountingAllocator, Counts, counts};
use scenarios::cyclic_load::{CyclicLoad, LoadSpec, PERIOD};
use scenarios::segments::ring_of_16;
use scenarios::world::World;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// More than the 256 frames after which Idx changes.
const CYCLES: u64 = 1_000;
const SUBDEVICES: usize = 60;

/// Three domains, two frames each.
fn load(cabling: Cabling) -> CyclicLoad {
    load_under_way(cabling, 1)
}

fn load_under_way(cabling: Cabling, under_way: u8) -> CyclicLoad {
    let lrw = cabling == Cabling::Line;
    let spec = LoadSpec { subdevices: SUBDEVICES, bytes: 60, domains: 3, under_way, lrw, supervision: true, cabling };
    CyclicLoad::new(&spec).expect("fits")
}

const CABLINGS: [Cabling; 3] = [Cabling::Line, Cabling::ClosedRing, Cabling::CutRing { before: 7 }];

/// Allocations and deallocations in `work`.
fn counted(work: impl FnOnce()) -> (u64, u64) {
    let before: Counts = counts();
    work();
    let after = counts();
    (after.allocations - before.allocations, after.deallocations - before.deallocations)
}

// covers: no-allocation
#[test]
fn the_counter_counts_an_allocation() {
    assert_eq!(counted(|| drop(std::hint::black_box(vec![1u8; 100]))), (1, 1));
}

// covers: no-allocation
#[test]
fn undisturbed_cycles_do_not_allocate() {
    for cabling in CABLINGS {
        let mut load = load(cabling);
        let used = counted(|| {
            for _ in 0..CYCLES {
                load.exchange_once();
                load.answer();
            }
        });
        assert_eq!(used, (0, 0), "{cabling:?}");
        let counters = load.exchange.counters();
        assert_eq!((counters.sent, counters.received), (CYCLES * 6, (CYCLES - 1) * 6), "{cabling:?}");
        assert_eq!(counters.incomplete, 0, "{cabling:?}");
    }
}

// covers: under-way
#[test]
fn several_cycles_under_way_do_not_allocate_and_lose_nothing() {
    for (cabling, under_way) in CABLINGS.into_iter().zip(2..=4) {
        let mut load = load_under_way(cabling, under_way);
        let used = counted(|| {
            for cycle in 0..CYCLES {
                load.exchange_once();
                // Responses arrive in bursts, cycle after cycle.
                if (cycle + 1) % u64::from(under_way) == 0 {
                    load.answer();
                }
            }
        });
        assert_eq!(used, (0, 0), "{cabling:?}");
        let counters = load.exchange.counters();
        assert_eq!((counters.sent, counters.incomplete, counters.skipped), (CYCLES * 6, 0, 0), "{cabling:?}");
    }
}

// covers: no-allocation
#[test]
fn disturbed_cycles_do_not_allocate() {
    for cabling in CABLINGS {
        let mut load = load(cabling);
        let used = counted(|| {
            for cycle in 0..CYCLES {
                load.exchange_once();
                disturb(&mut load, cycle);
            }
        });
        assert_eq!(used, (0, 0), "{cabling:?}");
        let CyclicCounters { lost, late, corrupt, foreign, other, skipped, incomplete, half, copies_lost, .. } =
            *load.exchange.counters();
        let everywhere = [lost, late, corrupt, foreign, other, skipped, incomplete];
        assert!(everywhere.iter().all(|count| *count > 0), "{cabling:?}: {:?}", load.exchange.counters());
        // A line has no second half.
        let halves = [half, copies_lost];
        assert!(cabling == Cabling::Line || halves.iter().any(|count| *count > 0), "{cabling:?}: {halves:?}");
    }
}

// covers: no-allocation, lost-frames
#[test]
fn frames_that_are_lost_and_sent_again_do_not_allocate() {
    for cabling in CABLINGS {
        let lrw = cabling == Cabling::Line;
        let spec =
            LoadSpec { subdevices: SUBDEVICES, bytes: 60, domains: 3, under_way: 1, lrw, supervision: true, cabling };
        let mut load = CyclicLoad::sending_again(&spec).expect("fits");
        let used = counted(|| {
            for cycle in 0..CYCLES {
                load.cycle_with_tries(|links| match cycle % 10 {
                    // All frames are lost, or one copy.
                    0 if cycle > 200 => while links.sent.pop().is_some() {},
                    5 if cycle > 200 => drop(links.sent.pop()),
                    _ => (),
                });
            }
        });
        assert_eq!(used, (0, 0), "{cabling:?}");
        let counters = load.exchange.counters();
        println!("{cabling:?}: {} sent again, {} saved", counters.sent_again, counters.saved);
        // All three domains in each tenth cycle at least.
        assert!(counters.saved >= 3 * (CYCLES - 210) / 10, "{cabling:?}: {counters:?}");
        assert_eq!(counters.incomplete, 0, "{cabling:?}");
    }
}

// covers: capture
#[test]
fn recorded_cycles_do_not_allocate() {
    let path = std::env::temp_dir().join(format!("ringcat-no-memory-{}.pcapng", std::process::id()));
    let recorder = Recorder::start(&path, &[("main", ""), ("redundant", "")]).expect("a file");
    let mut load = load(Cabling::ClosedRing);
    let CyclicLoad { exchange, links, double, now, .. } = &mut load;
    let mut tee = Tee::new(std::mem::replace(links, MemoryLinks::new(links.addresses().main, None, 1)), recorder.tap());
    let used = counted(|| {
        for _ in 0..CYCLES {
            *now += PERIOD;
            tee.links_mut().set_now(*now);
            while tee.receive(&mut |link, frame| {
                exchange.receive(link, frame, *now);
            }) {}
            for domain in (0..3).map(DomainId) {
                exchange.process(domain, *now);
                exchange.queue(domain, *now);
            }
            exchange.send(*now, &mut |link, frame| tee.send(link, frame));
            let links = tee.links_mut();
            double.answer(&mut links.sent, &mut links.arriving);
        }
    });
    let recorded = recorder.finish().expect("it was written");
    std::fs::remove_file(&path).expect("it was written");
    assert_eq!(used, (0, 0));
    for link in recorded {
        // This is faster than the writer: frames that find the queue full are counted.
        assert_eq!(link.sent + link.received + link.lost, CYCLES * 6 + (CYCLES - 1) * 6, "{link:?}");
        assert!(link.sent > 0 && link.received > 0, "{link:?}");
    }
}

// covers: capture, no-allocation
#[test]
fn taps_that_another_thread_switches_on_and_off_do_not_allocate_in_cycles() {
    const SWITCHES: usize = 20;
    let taps = Taps::new(2);
    let mut load = load(Cabling::ClosedRing);
    let CyclicLoad { exchange, links, double, now, .. } = &mut load;
    let mut tee = Tee::new(std::mem::replace(links, MemoryLinks::new(links.addresses().main, None, 1)), taps.tap());
    let switching = std::thread::spawn(move || {
        let mut frames = 0_usize;
        for _ in 0..SWITCHES {
            let mut reader = taps.read().expect("it is the only one");
            let before = frames;
            while frames == before {
                let read = reader.read_all(|note, frame| {
                    frames += 1;
                    if note.length == frame.len() { Ok(()) } else { Err(note) }
                });
                read.expect("frames are whole");
            }
        }
        frames
    });
    let mut cycles = 0;
    let used = counted(|| {
        while cycles < CYCLES || !switching.is_finished() {
            cycles += 1;
            *now += PERIOD;
            tee.links_mut().set_now(*now);
            while tee.receive(&mut |link, frame| {
                exchange.receive(link, frame, *now);
            }) {}
            for domain in (0..3).map(DomainId) {
                exchange.process(domain, *now);
                exchange.queue(domain, *now);
            }
            exchange.send(*now, &mut |link, frame| tee.send(link, frame));
            let links = tee.links_mut();
            double.answer(&mut links.sent, &mut links.arriving);
        }
    });
    assert_eq!(used, (0, 0));
    assert!(switching.join().expect("no panic") >= SWITCHES);
}

// covers: copy
#[test]
fn copying_does_not_allocate() {
    let mut load = load(Cabling::ClosedRing);
    let image = load.exchange.image(DomainId(0)).len() as u32;
    // The first SubDevice's inputs, and the last one's.
    let inputs = [image * 4, image * 8 - 60 * 8];
    let entry = |domain, bit_offset| Entry { domain: DomainId(domain), bit_offset, bit_length: 60 * 8 };
    let rules = [CopyRule::new(entry(0, inputs[0]), entry(1, 0)), CopyRule::new(entry(0, inputs[1]), entry(0, 0))];
    let set = load.exchange.set_copies(&rules);
    let used = counted(|| {
        for cycle in 0..CYCLES {
            load.exchange_once();
            if cycle % 10 == 9 {
                disturb(&mut load, cycle);
            } else {
                load.answer();
            }
        }
    });
    assert_eq!((set, used), (Ok(()), (0, 0)));
    assert!(!load.exchange.is_copy_stale(ringcat::CopyId(0)));
    println!("{} words refused", load.exchange.counters().stale_copies);
}

// covers: byte-budget, jobs
#[test]
fn requests_do_not_allocate_in_the_cyclic_thread() {
    let options = Options::new(MacAddress([0x00, 0x00, 0x5E, 0x00, 0x53, 0x01]), None);
    let mut engine = MainDevice::new(options, Instant(0));
    let (mut object, mut register) =
        (engine.create_sdo_request(SubDeviceId(0), 100), engine.create_register_request(SubDeviceId(0), 100));
    let (mut idn, mut vendor) =
        (engine.create_soe_request(SubDeviceId(0), 100), engine.create_voe_handler(SubDeviceId(0), 100));
    let mut out = [0; 100];
    let used = counted(|| {
        for _ in 0..CYCLES {
            let timeout = Duration::from_millis(5);
            let _ = (object.set_object(0x2000, 1, false), object.set_timeout(timeout), object.write(&[1; 100]));
            let _ = (register.set_timeout(timeout), register.read(RegisterAddress(0), 100));
            let _ = (idn.set_idn(0, Idn(1)), idn.set_timeout(timeout), idn.write(&[1; 100]));
            let _ = (vendor.set_send_header(1, 2), vendor.write(&[1; 100]), vendor.execute());
            object.cancel();
            let states = [object.state(), register.state(), idn.state(), vendor.state()];
            assert_eq!(states, [RequestState::Busy; 4]);
            assert_eq!((object.data(&mut out), register.data(&mut out), idn.failure()), (0, 0, None));
            assert_eq!((vendor.received_header(), vendor.read()), (None, Err(RequestRefused::Busy)));
        }
    });
    assert_eq!(used, (0, 0));
}

/// Links that report their own memory.
struct Apart {
    links: SharedSegment,
    own: Cell<(u64, u64)>,
}

impl Apart {
    fn apart<R>(own: &Cell<(u64, u64)>, work: impl FnOnce() -> R) -> R {
        let mut result = None;
        let used = counted(|| result = Some(work()));
        own.set((own.get().0 + used.0, own.get().1 + used.1));
        result.expect("it ran")
    }
}

impl Links for Apart {
    fn now(&self) -> Instant {
        self.links.now()
    }

    fn addresses(&self) -> ringcat::PerLink<MacAddress> {
        self.links.addresses()
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        Apart::apart(&self.own, || self.links.send(link, frame));
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        // The work of the exchange within this is counted twice: as its own and as that of the links.
        let mut inner = (0, 0);
        let any = Apart::apart(&self.own, || {
            self.links.receive(&mut |link, frame| {
                let used = counted(|| take(link, frame));
                inner = (inner.0 + used.0, inner.1 + used.1);
            })
        });
        self.own.set((self.own.get().0 - inner.0, self.own.get().1 - inner.1));
        any
    }

    fn wait(&mut self, until: Instant) {
        Apart::apart(&self.own, || self.links.wait(until));
    }
}

// covers: threads, cycles, no-allocation
#[test]
fn snapshots_and_probes_take_no_memory_in_the_cyclic_thread() {
    let (cyclic, acyclic) = SharedSegment::halves(ring_of_16(Duration::from_micros(10)));
    let supervisor = ringcat::SupervisorThread::start(acyclic, &ringcat::Options::default(), || ()).expect("a thread");
    let scan = supervisor.scan().expect("a scan");
    let declaration = ringcat::automatic(&scan.subdevices, Duration::from_millis(2));
    let links = Apart { links: cyclic, own: Cell::new((0, 0)) };
    let mut application = supervisor.activate(declaration, links).map_err(|refused| refused.error).expect("it fits");
    let observer = application.observer();
    let (returns, mut taken) = (Cell::new(0), 0);
    let mut probe = (ringcat::JobProbe::default(), ringcat::FramesIn::new(|_| returns.set(returns.get() + 1)));
    for _ in 0..200 {
        let before = application.links().own.get();
        let mut request = None;
        let (allocated, freed) = counted(|| {
            request = Some(observer.request());
            for _ in 0..2 {
                application.cycle_probed(&mut probe, |data| data.fill_outputs(1));
            }
        });
        let own = application.links().own.get();
        assert_eq!((allocated, freed), (own.0 - before.0, own.1 - before.1));
        taken += u64::from(request.and_then(|request| observer.take(request)).is_some());
    }
    assert_eq!(taken, 200);
    assert!(returns.get() > 100 && probe.0.times().of(ringcat::CycleJob::Send).histogram().count() == 400);
}

/// Changes the responses, in a different way for each of ten cycles.
fn disturb(load: &mut CyclicLoad, cycle: u64) {
    let CyclicLoad { exchange, links, board, double, now, .. } = load;
    match cycle % 10 {
        // All frames are lost.
        0 => while links.sent.pop().is_some() {},
        // One copy, or frame, is lost.
        1 => {
            links.sent.pop();
            double.answer(&mut links.sent, &mut links.arriving);
        }
        // The first frame arrives three times.
        2 => {
            double.answer(&mut links.sent, &mut links.arriving);
            let mut first = [0; 1514];
            let (link, length) = copy_first(links, &mut first);
            for _ in 0..3 {
                exchange.receive(link, &first[..length], *now);
            }
        }
        // A working counter, Idx, source address or protocol is wrong.
        3..=6 => {
            double.answer(&mut links.sent, &mut links.arriving);
            let mut first = [0; 1514];
            let (link, length) = copy_first(links, &mut first);
            let at = [length - 1, 17, 11, 12][cycle as usize % 10 - 3];
            first[at] ^= 0x41;
            exchange.receive(link, &first[..length], *now);
            if cycle % 20 > 10 {
                exchange.pop_foreign();
            }
        }
        // A datagram differs from the sent one.
        7 => {
            double.answer(&mut links.sent, &mut links.arriving);
            let mut first = [0; 1514];
            let (link, length) = copy_first(links, &mut first);
            first[16] ^= 0x01;
            assert_eq!(exchange.receive(link, &first[..length], *now), Received::Corrupt);
        }
        // The application is early: its domains are skipped.
        8 => {
            let early = *now + Duration::from_micros(1);
            for domain in (0..3).map(DomainId) {
                assert!(exchange.process(domain, early).pending);
                assert!(!exchange.queue(domain, early));
            }
            exchange.send(early, &mut |_, _| panic!("nothing was queued"));
            double.answer(&mut links.sent, &mut links.arriving);
        }
        // A SubDevice stops taking part, or takes part again; frames arrive after the next cycle has begun.
        _ => {
            let subdevice = cycle as usize % SUBDEVICES;
            board.set_taking_part(subdevice, !board.takes_part(subdevice));
            exchange.process(DomainId(0), *now + PERIOD);
            assert_ne!(exchange.freshness(DomainId(0), SubDeviceId(0)), Freshness::Never);
            double.answer(&mut links.sent, &mut links.arriving);
        }
    }
}

/// Takes the first frame that arrives and copies it.
fn copy_first(links: &mut MemoryLinks, first: &mut [u8; 1514]) -> (Link, usize) {
    let (link, frame) = links.arriving.pop().expect("there is one");
    first[..frame.len()].copy_from_slice(frame);
    (link, frame.len())
}

/// The image of an ENI is copied bit by bit where its SubDevices share bytes.
// covers: eni-run
#[test]
fn the_image_of_an_eni_does_not_allocate_in_a_cycle() {
    let file = EniFile::from_bytes(include_bytes!("../../ringcat/examples/machine.eni.xml")).expect("it is writable");
    let segment = SimulatedSegment::new(file.simulated(false).expect("cables fit"));
    let mut main_device = ringcat::MainDevice::request(segment, &ringcat::Options::default());
    main_device.scan().expect("a scan");
    let mut application = main_device.activate(file.declaration(false)).expect("it fits");
    let mut image = EniImage::new(&file.configuration, application.directory()).expect("it fits");
    while !application.all_settled() {
        application.cycle(|_| ());
    }
    let lamp = image.variable("Lamps.Channel 2").cloned().expect("it is there");
    let (exchange, mut values) = (application.exchange_mut(), 0);
    let used = counted(|| {
        for cycle in 0..CYCLES {
            image.take_inputs_of(exchange);
            image.write(&lamp, cycle);
            image.give_outputs_to(exchange);
            values += image.read(&lamp) + u64::from(image.value(&lamp).is_some());
        }
    });
    assert_eq!((used, values), ((0, 0), CYCLES / 2 + CYCLES));
    assert!(application.exchange_mut().image(DomainId(0)).iter().any(|byte| byte & 2 != 0));
}

#[test]
fn typed_process_data_does_not_allocate_in_a_cycle() {
    let segment = "[segment]\nring = true\n[[device]]\ntype = \"servo\"\n[[device]]\ntype = \"digital-output-8\"\n";
    let links = SimulatedSegment::from_toml(segment).expect("a good segment");
    let mut main_device = ringcat::MainDevice::request(links, &ringcat::Options::default());
    main_device.scan().expect("a scan");
    let mut declaration = ringcat::Declaration::new(PERIOD);
    let [drive, lamps] = [0, 1].map(|at| declaration.add(ringcat::SubDeviceConfig::at_position(at)));
    let mut application = main_device.activate(declaration).expect("it fits");
    let target = application.output::<i32>(drive, 0x607A, 0).expect("it is mapped");
    let actual = application.input_named::<i32>(drive, "Position").expect("it is mapped");
    let lamp = application.output_bits(lamps, 0x7000, 1).expect("it is mapped");
    application.wait_until_op(Duration::from_secs(10)).expect("OP");
    for value in 0..CYCLES {
        application.cycle(|data| {
            let memory = counted(|| {
                data.set(target, data.get(actual).wrapping_add(1));
                assert_eq!(data.set_bits(lamp, value % 2), Ok(()));
                assert!(data.set_bits(lamp, 2).is_err());
                let area = data.area_mut(lamps, 0).map(|area| area[0] |= 0x80);
                assert!(area.is_some() && data.area(lamps, 0).is_some_and(|area| area[0] & 0x80 != 0));
            });
            assert_eq!(memory, (0, 0));
        });
    }
}

// covers: threads, no-allocation
#[test]
fn the_live_status_is_read_and_posted_without_allocation() {
    let world = World::in_op(1, ring_of_16(Duration::from_micros(10)));
    let live = world.application().live_status();
    let mut operational = 0;
    let used = counted(|| {
        for _ in 0..CYCLES {
            let copy = live.clone();
            let all = (0..copy.subdevice_count()).filter_map(|number| copy.subdevice(SubDeviceId(number)));
            operational += all.filter(|status| status.operational && status.wkc.is_complete()).count();
            operational += usize::from(copy.segment().responding == 16 && copy.link(Link::Main).answering == 16);
        }
    });
    assert_eq!((used, operational), ((0, 0), CYCLES as usize * 17));
}
