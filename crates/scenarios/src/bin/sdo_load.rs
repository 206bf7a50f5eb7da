//! Cost of 1,000 SDO requests per second for a cyclic task of 1 kHz: instructions of the cyclic half per
//! cycle, counted by callgrind within this half alone, and the delay of its frames in virtual time.
//!
//! Four drives are connected to one link. Both halves have links of their own, as in two threads; here they run
//! alternately in one thread, in virtual time. Each millisecond one SDO is requested, from one drive after the other.
//! The bar is for requests of another thread; the cost of requests by the cyclic task itself is printed without a bar.
//! Run without arguments it prints the table; `run KIND CYCLES` is the work that callgrind measures.

use std::collections::VecDeque;
use std::hint::black_box;
use std::io;
use std::process::ExitCode;
use std::time::Duration;

use ringcat::links::Links;
use ringcat::memory::MemoryLinks;
use ringcat::simulated::SimulatedSegment;
use ringcat::window::{Half, Window};
use ringcat::{Instant, Limits, Link, SdoAddress, SubDeviceId, automatic};
use ringcat_engine::domain::DomainId;
use ringcat_engine::exchange::Exchange;
use ringcat_engine::mail::coe::SdoError;
use ringcat_engine::main_device::{MainDevice, Options, Pending};
use ringcat_engine::request::{RequestState, SdoRequest};
use ringcat_engine::{Class, class_of};
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::frame::wire_time_ns;
use scenarios::callgrind::{is_installed, profile_self_within};
use scenarios::figures::{Figures, skipped, verdict};
use scenarios::segments::{descriptions, line};
use scenarios::uploads::start_upload;

const PERIOD: Duration = Duration::from_millis(1);
const DRIVES: usize = 4;
const SHORT: u64 = 200;
const LONG: u64 = 600;
/// Cycles in which departure times are checked.
const LOOKED_AT: u64 = 3_000;
/// Cycles until all are in OP.
const START: u64 = 5_000;
/// Maximum increase of the instructions of the cyclic half by requests, in percent.
const BAR: f64 = 1.0;
const LIMITS: Limits = Limits::new(Duration::from_millis(100), Duration::from_millis(500));
const OBJECT: SdoAddress = SdoAddress::new(0x1018, 1);

/// Source of the SDO requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Load {
    None,
    AnotherThread,
    CyclicTask,
}

const KINDS: [(&str, Load); 3] =
    [("none", Load::None), ("another-thread", Load::AnotherThread), ("cyclic-task", Load::CyclicTask)];

/// Both halves, the segment, and the results.
struct Plant {
    segment: SimulatedSegment,
    engine: MainDevice,
    window: Window,
    /// Frames of the cyclic half.
    links: MemoryLinks,
    /// Time at which the sent frames will have left the interface.
    free_at: u64,
    /// Longest wait of a cyclic frame behind an acyclic one.
    longest_wait: u64,
    waiting: VecDeque<Pending<Result<Vec<u8>, SdoError>>>,
    answered: u64,
}

impl Plant {
    fn new() -> Result<(Plant, Exchange), io::Error> {
        let mut kinds = vec!["coupler"];
        kinds.extend(["servo"; DRIVES]);
        let segment = SimulatedSegment::new(line(descriptions(&kinds), NetworkOptions::default()));
        let main = segment.addresses().main;
        let engine = MainDevice::new(Options::new(main, None), segment.now());
        let links = MemoryLinks::new(main, None, 64);
        let (waiting, window) = (VecDeque::new(), Window::default());
        let mut plant = Plant { segment, engine, window, links, free_at: 0, longest_wait: 0, waiting, answered: 0 };
        plant.engine.start_scan().map_err(io::Error::other)?;
        let scan = loop {
            plant.acyclic_until(plant.segment.now() + PERIOD);
            if let Some(scan) = plant.engine.scan_result() {
                break scan.map_err(io::Error::other)?;
            }
        };
        let active = plant.engine.activate(automatic(&scan.subdevices, PERIOD)).map_err(io::Error::other)?;
        plant.window.expect_cycle(plant.segment.now() + PERIOD);
        Ok((plant, active.exchange))
    }

    fn send(&mut self, half: Half, link: Link, frame: &[u8]) {
        let now = self.segment.now();
        let leaves = self.free_at.max(now.0);
        if half == Half::Cyclic {
            self.longest_wait = self.longest_wait.max(leaves - now.0);
        }
        self.free_at = leaves + wire_time_ns(frame.len());
        self.segment.send(link, frame);
    }

    /// Runs the acyclic half until this time; frames of the cyclic half are kept for it.
    fn acyclic_until(&mut self, until: Instant) {
        loop {
            let now = self.segment.now();
            let Plant { segment, engine, links, .. } = self;
            while segment.receive(&mut |link, frame| match class_of(frame) {
                Some(Class::Acyclic) => {
                    engine.receive(link, frame, now);
                }
                Some(Class::Cyclic) | None => {
                    links.arriving.push(link, frame);
                }
            }) {}
            engine.poll(now);
            let mut frames = Vec::new();
            let budget = self.window.bytes(now);
            if engine.wants_to_send() && budget > 0 {
                let window = &self.window;
                engine.transmit(now, budget, &mut |link, frame| {
                    window.occupy(Half::Acyclic, now, frame.len());
                    frames.push((link, frame.to_vec()));
                });
            }
            let blocked = engine.wants_to_send();
            let deadline = engine.next_deadline().unwrap_or(Instant::NEVER);
            frames.iter().for_each(|(link, frame)| self.send(Half::Acyclic, *link, frame));
            while let Some(mut pending) = self.waiting.pop_front() {
                match pending.take() {
                    Some(result) => self.answered += u64::from(result.is_ok()),
                    None => {
                        self.waiting.push_front(pending);
                        break;
                    }
                }
            }
            if now >= until {
                return;
            }
            let wake = if blocked { deadline.min(self.window.look_again(now)) } else { deadline };
            self.segment.wait(wake.max(now).min(until));
        }
    }

    /// One cycle: first the acyclic half until the cycle begins, then the cyclic half.
    fn cycle(&mut self, exchange: &mut Exchange, begin: Instant, requests: &mut [SdoRequest]) {
        self.acyclic_until(begin);
        cyclic_half(exchange, &mut self.links, &self.window, begin, requests);
        let mut frames = Vec::new();
        while let Some((link, frame)) = self.links.sent.pop() {
            frames.push((link, frame.to_vec()));
        }
        frames.iter().for_each(|(link, frame)| self.send(Half::Cyclic, *link, frame));
    }
}

/// The cyclic half's work in a cycle, counted by callgrind.
#[inline(never)]
fn cyclic_half(
    exchange: &mut Exchange,
    links: &mut MemoryLinks,
    window: &Window,
    now: Instant,
    requests: &mut [SdoRequest],
) {
    while links.receive(&mut |link, frame| {
        exchange.receive(link, frame, now);
    }) {}
    let status = exchange.process(DomainId(0), now);
    if let [first, .., last] = exchange.image_mut(DomainId(0)) {
        *first = *last;
    }
    for request in requests {
        if request.state() != RequestState::Busy {
            let mut value = [0; 4];
            black_box(request.data(&mut value));
            let _ = request.read();
        }
    }
    exchange.queue(DomainId(0), now);
    exchange.send(now, &mut |link, frame| {
        window.occupy(Half::Cyclic, now, frame.len());
        links.send(link, frame);
    });
    window.expect_cycle(now + PERIOD);
    black_box(status);
}

/// A run of this many cycles after the start.
fn run(load: Load, cycles: u64) -> io::Result<Plant> {
    let (mut plant, mut exchange) = Plant::new()?;
    let mut begin = plant.segment.now();
    let mut started = 0;
    while !plant.engine.all_settled() || started < 100 {
        begin += PERIOD;
        plant.cycle(&mut exchange, begin, &mut []);
        started += 1;
        if started > START {
            return Err(io::Error::other("not all are in OP"));
        }
    }
    let mut requests: Vec<SdoRequest> = Vec::new();
    if load == Load::CyclicTask {
        // A request takes one or two cycles: with two request objects, one is started in each cycle.
        requests = (0..2).map(|at| plant.engine.create_sdo_request(SubDeviceId(1 + at), 4)).collect();
        for request in &mut requests {
            request
                .set_object(OBJECT.index, OBJECT.sub_index, false)
                .map_err(|error| io::Error::other(format!("{error:?}")))?;
        }
    }
    plant.longest_wait = 0;
    let lost = exchange.counters().lost + exchange.counters().incomplete;
    for cycle in 0..cycles {
        if load == Load::AnotherThread {
            let drive = 1 + cycle as usize % DRIVES;
            let pending = start_upload(&mut plant.engine, SubDeviceId(drive), OBJECT, LIMITS, 4);
            plant.waiting.push_back(pending);
        }
        begin += PERIOD;
        plant.cycle(&mut exchange, begin, &mut requests);
    }
    let counters = exchange.counters();
    if counters.lost + counters.incomplete != lost || counters.skipped != 0 {
        return Err(io::Error::other(format!("{counters:?}")));
    }
    Ok(plant)
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let result = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => measure(),
        ["run", name, cycles] => watched(name, cycles).map(|()| true),
        _ => Err(io::Error::other("usage: sdo_load [run KIND CYCLES]")),
    };
    match result {
        Ok(met) => verdict(met),
        Err(error) => {
            eprintln!("sdo_load: {error}");
            ExitCode::FAILURE
        }
    }
}

/// The work that callgrind measures.
fn watched(name: &str, cycles: &str) -> io::Result<()> {
    let (_, load) = KINDS.iter().find(|(kind, _)| *kind == name).ok_or(io::Error::other("no such kind"))?;
    run(*load, cycles.parse().map_err(io::Error::other)?).map(drop)
}

/// Instructions of the cyclic half per cycle.
fn instructions(name: &str) -> io::Result<f64> {
    let of = |cycles: u64| {
        let arguments = ["run".to_owned(), name.to_owned(), cycles.to_string()];
        profile_self_within("*cyclic_half*", &arguments).map(|profile| profile.instructions as f64)
    };
    Ok((of(LONG)? - of(SHORT)?) / (LONG - SHORT) as f64)
}

fn measure() -> io::Result<bool> {
    let mut figures = Figures::new("1,000 SDO requests per second beside process data at 1 kHz");
    let has_all = is_installed() || skipped("instructions, for valgrind is not installed");
    if is_installed() {
        let alone = instructions("none")?;
        let beside = instructions("another-thread")?;
        figures.show("instructions of the cyclic half per cycle, no SDOs", format!("{alone:.1}"));
        let change = 100.0 * (beside - alone).abs() / alone;
        figures.show("      SDOs of another thread", format!("{beside:.1}"));
        figures.at_most("      change", change, BAR, "%");
        let own = instructions("cyclic-task")?;
        figures.show("      two request objects of the cyclic task, checked in each cycle", format!("{own:.1}"));
    }
    let plant = run(Load::AnotherThread, LOOKED_AT)?;
    figures.at_least("SDOs answered per second", plant.answered as f64 * 1000.0 / LOOKED_AT as f64, 990.0, "");
    // A frame that finds the interface busy is sent outside its window.
    figures.at_most("longest wait of a frame of process data behind another one", plant.longest_wait as f64, 0.0, "ns");
    Ok(figures.print() && has_all)
}
