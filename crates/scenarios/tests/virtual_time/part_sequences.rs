//! Random sequences of the parts of a cycle: receive, process, queue, send, in any order and number, with domains of
//! several periods and without, received in another thread than the one that configured, cables cut meanwhile.
//!
//! Checked at all times: the wire has what was queued and nothing else, SubDevices take only what left and nothing
//! older after something newer ([`scenarios::parts`]); fresh inputs are what the SubDevice put into the frame
//! ([`scenarios::truth`]). Without faults also: each cycle that came back is complete, and each that did not leave is
//! without an answer.
//!
//! `SEED=17 cargo test -p scenarios --test virtual_time part_sequences::seeds -- --nocapture` runs one seed,
//! `SEED=0..10000` many.

use std::collections::VecDeque;
use std::fmt::Display;
use std::ops::Range;
use std::time::Duration;

use ringcat::{
    Application, Declaration, DomainId, DomainState, DomainStatus, Instant, MainDevice, Options, SubDeviceConfig,
    SubDeviceId,
};
use ringcat_sim::application::behaviours::{Behaviour, InputSource};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_sim::time::SimTime;
use scenarios::areas::areas_of;
use scenarios::dice::Dice;
use scenarios::once::Declared;
use scenarios::parts::{OutputsInParts, PartLinks, marks};
use scenarios::seeds;
use scenarios::segments::{descriptions, line, ring};
use scenarios::truth::Truth;

const KINDS: [&str; 7] = [
    "digital-input-8",
    "digital-output-8",
    "digital-output-16",
    "emulated-output-8",
    "analog-input-4",
    "analog-output-4",
    "block",
];
const PERIODS_US: [u64; 7] = [0, 250, 500, 1_000, 1_000, 2_000, 3_000];
/// Deadline of a domain without a period.
const WITHOUT_PERIOD_US: u64 = 500;
const SYNC_MANAGERS: u8 = 4;
/// Most devices with 800 bytes of process data.
const MOST_BLOCKS: usize = 1;
/// All frames are back after this time at the latest.
const BACK: Duration = Duration::from_micros(600);
/// Limit of the virtual time of a start.
const START: Duration = Duration::from_secs(5);
const MOST_STEPS: u64 = 80;
/// Steps that a failure prints.
const LOGGED: usize = 60;

/// Inputs are the time at which they were computed.
fn stamp(now: SimTime, _outputs: &[u8], inputs: &mut [u8]) {
    inputs.fill((now.0 / 10_000) as u8);
}

/// What is known of a domain's last cycle that left.
#[derive(Clone, Copy, Debug)]
enum Flight {
    /// Nothing: before the first send, and after faults.
    Unknown,
    /// It left, and no frame was taken when it could be back.
    Out(Instant),
    /// It is back.
    Back,
    /// It was given up.
    GivenUp,
}

#[derive(Clone, Copy, Debug)]
struct Known {
    flight: Flight,
    is_queued: bool,
    timeout: Duration,
}

/// What a seed has shown.
#[derive(Clone, Copy, Debug, Default)]
struct Shown {
    steps: u64,
    processed: u64,
    complete: u64,
    compared: u64,
    found: u64,
    proven: u64,
    elsewhere: u64,
}

/// An application whose cycles run in parts, with its checks.
struct Parts {
    application: Application<PartLinks>,
    outputs: OutputsInParts,
    truth: Truth,
    known: Vec<Known>,
    cut: Option<CableId>,
    /// No cable was cut so far.
    is_calm: bool,
    has_sent: Vec<bool>,
    shown: Shown,
    /// The last steps, printed where one fails.
    log: VecDeque<String>,
}

impl Drop for Parts {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.log.iter().for_each(|line| println!("{line}"));
        }
    }
}

fn network(dice: &mut Dice, seed: u64) -> (Network, usize) {
    let mut kinds: Vec<&str> = (0..1 + dice.below(5)).map(|_| *dice.pick(&KINDS)).collect();
    // More would not be back within the shortest period.
    kinds.iter_mut().filter(|kind| **kind == "block").skip(MOST_BLOCKS).for_each(|kind| *kind = KINDS[0]);
    let mut described = descriptions(&kinds);
    for it in described.iter_mut().filter(|_| dice.one_in(2)) {
        if let Behaviour::Terminal(source) = &mut it.behaviour {
            *source = InputSource::Function(stamp);
        }
    }
    let options = NetworkOptions::default().with_seed(seed);
    let options = options.with_detection_delay(Duration::from_micros(*dice.pick(&[10, 100, 1_000])));
    let is_ring = dice.one_in(2);
    (if is_ring { ring(described, options) } else { line(described, options) }, if is_ring { 2 } else { 1 })
}

/// Some domains, with the process data packed by the MainDevice or registered in any order.
fn declare(dice: &mut Dice, main_device: &MainDevice<PartLinks>) -> Declaration {
    let found = main_device.subdevices();
    let mut declaration = Declaration::default();
    for info in &found {
        declaration.add_without_domain(SubDeviceConfig::from_info(info));
    }
    let domains: Vec<DomainId> = (0..1 + dice.below(4))
        .map(|_| declaration.add_domain(Duration::from_micros(*dice.pick(&PERIODS_US))))
        .collect();
    let mut areas: Vec<(usize, u8)> =
        (0..found.len()).flat_map(|subdevice| (0..SYNC_MANAGERS).map(move |manager| (subdevice, manager))).collect();
    for at in (1..areas.len()).rev() {
        areas.swap(at, dice.below(at as u64 + 1) as usize);
    }
    let registers = dice.one_in(2);
    for (subdevice, manager) in areas {
        let (subdevice, domain) = (SubDeviceId(subdevice), *dice.pick(&domains));
        if !registers {
            declaration.assign(domain, subdevice, manager);
            continue;
        }
        let info = declaration.found(&found, subdevice);
        let _ = declaration.register_sync_manager(domain, subdevice, manager, info);
        if dice.one_in(6) {
            let _ = declaration.register_sync_manager(*dice.pick(&domains), subdevice, manager, info);
        }
    }
    declaration
}

impl Parts {
    fn new(seed: u64, dice: &mut Dice) -> Parts {
        let (mut network, links) = network(dice, seed);
        let devices = network.devices().len();
        (0..devices).map(DeviceIndex).for_each(|device| network.device_mut(device).controller.log_logical());
        let mut main_device = MainDevice::request(PartLinks::new(network), &Options::default());
        main_device.scan().expect("all are there");
        let declaration = declare(dice, &main_device).with_sends_again(seeds::sends_again(seed));
        let timeout = |period: Duration| if period.is_zero() { micros(WITHOUT_PERIOD_US) } else { period * 3 / 4 };
        let known: Vec<Known> = declaration
            .domains
            .iter()
            .map(|domain| Known { flight: Flight::Unknown, is_queued: false, timeout: timeout(domain.period) })
            .collect();
        let once = declaration.subdevices.iter().map(Declared::of).collect();
        let mut application =
            main_device.activate(declaration).map_err(|refused| refused.error).expect("the declaration fits");
        let end = application.now() + START;
        while !is_settled(&application) {
            assert!(application.now() < end, "not in OP: {:?}", application.states());
            application.cycle(|_| ());
        }
        application.links_mut().take_sent();
        let all: Vec<Option<DeviceIndex>> = (0..devices).map(|device| Some(DeviceIndex(device))).collect();
        let directory = application.directory();
        let areas = (0..devices).flat_map(|device| areas_of(directory, device, DeviceIndex(device)));
        let outputs = OutputsInParts::new(known.len(), areas, links);
        let mut truth = Truth::new(once, known.len(), 1);
        truth.follow(directory, &all);
        let has_sent = vec![false; known.len()];
        let shown = Shown::default();
        Parts { application, outputs, truth, known, cut: None, is_calm: true, has_sent, shown, log: VecDeque::new() }
    }

    fn now(&self) -> Instant {
        self.application.now()
    }

    fn note(&mut self, what: impl Display) {
        if self.log.len() == LOGGED {
            self.log.pop_front();
        }
        self.log.push_back(format!("{:>12} us: {what}", self.now().0 / 1_000));
    }

    fn advance(&mut self, time: Duration) {
        self.application.links_mut().network_mut().advance_by(time);
        self.outputs.check_devices(self.application.links().network());
    }

    /// Frames that have left without a send.
    fn check_tries(&mut self) {
        let sent = self.application.links_mut().take_sent();
        let allowed = self.application.exchange().sends_again();
        self.outputs.send_again(&sent, allowed);
        self.truth.send_again(&marks(&sent));
    }

    fn receive(&mut self) {
        self.note("receive");
        self.application.receive();
        self.note_received();
    }

    /// Receives cyclic frames in another thread.
    fn receive_elsewhere(&mut self) {
        self.note("receive in another thread");
        self.application.links_mut().hold(true);
        self.application.receive();
        self.application.links_mut().hold(false);
        let now = self.now();
        let held = self.application.links_mut().take_held();
        let exchange = self.application.exchange_mut();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                for (link, frame) in &held {
                    match exchange.sends_again() {
                        true => exchange.receive_and_follow(*link, frame, now),
                        false => exchange.receive(*link, frame, now),
                    };
                }
            });
        });
        self.shown.elsewhere += 1;
        self.note_received();
    }

    fn note_received(&mut self) {
        self.check_tries();
        let now = self.now();
        for known in &mut self.known {
            if let Flight::Out(at) = known.flight {
                known.flight = match now.since(at) {
                    time if time >= BACK => Flight::Back,
                    time if time.is_zero() => known.flight,
                    _ => Flight::Unknown,
                };
            }
        }
    }

    /// Frames of a domain that are overdue now are given up.
    fn note_overdue(&mut self, domain: usize) {
        let now = self.now();
        let known = &mut self.known[domain];
        if let Flight::Out(at) = known.flight
            && now.since(at) >= known.timeout
        {
            known.flight = Flight::GivenUp;
        }
    }

    fn process(&mut self, domain: usize) -> DomainStatus {
        let id = DomainId(domain);
        self.note_overdue(domain);
        let status = self.application.process(id);
        self.note(format!("process {domain}: {status:?}, {:?}", self.known[domain]));
        self.check_tries();
        self.shown.processed += 1;
        if self.has_sent[domain] {
            self.truth.evaluate(status, id, self.application.exchange(), self.application.links().network());
        }
        let known = self.known[domain];
        let has_data = status.expected > 0;
        if self.is_calm && has_data {
            match (known.is_queued, known.flight) {
                (true, _) => assert_eq!((status.state, status.pending), (DomainState::Zero, false), "{known:?}"),
                (false, Flight::Back) => {
                    assert_eq!((status.state, status.pending), (DomainState::Complete, false), "{known:?}: {status:?}");
                    self.shown.complete += 1;
                }
                (false, Flight::GivenUp) => assert_eq!(status.state, DomainState::Zero, "{known:?}"),
                (false, Flight::Out(_) | Flight::Unknown) => {}
            }
        }
        let again = self.application.process(id);
        assert_eq!(again, status, "processed twice");
        status
    }

    fn process_all(&mut self) {
        for domain in 0..self.known.len() {
            self.process(domain);
        }
    }

    fn queue(&mut self, domain: usize) {
        self.note_overdue(domain);
        let is_queued = self.application.queue(DomainId(domain));
        self.note(format!("queue {domain}: {is_queued}"));
        self.check_tries();
        if is_queued {
            self.outputs.queue(DomainId(domain));
            self.known[domain].is_queued = true;
        } else {
            let out = matches!(self.known[domain].flight, Flight::Out(_) | Flight::Unknown);
            assert!(!self.is_calm || out, "refused though nothing is on the wire: {:?}", self.known[domain]);
        }
    }

    fn send(&mut self) {
        self.application.send();
        let now = self.now();
        let sent = self.application.links_mut().take_sent();
        let marks = marks(&sent);
        self.note(format!("send {marks:02x?}"));
        for domain in self.outputs.send(&sent) {
            self.known[domain.0].flight = Flight::Out(now);
            self.known[domain.0].is_queued = false;
            self.has_sent[domain.0] = true;
            self.truth.depart(domain, &marks);
        }
    }

    fn write(&mut self, domain: usize) {
        let image = self.application.exchange_mut().image_mut(DomainId(domain));
        self.outputs.write(DomainId(domain), image);
    }

    fn change_cables(&mut self, dice: &mut Dice) {
        self.is_calm = false;
        self.note(format!("cut {:?} changes", self.cut));
        let network = self.application.links_mut().network_mut();
        match self.cut.take() {
            Some(cable) => network.apply(Fault::Heal(cable)),
            None => {
                let cable = CableId(dice.below(network.cables().len() as u64) as usize);
                network.apply(Fault::Cut(cable));
                self.cut = Some(cable);
            }
        }
    }

    fn step(&mut self, dice: &mut Dice, cuts: bool) {
        let domains = self.known.len();
        let domain = dice.below(domains as u64) as usize;
        self.shown.steps += 1;
        match dice.below(20) {
            0..3 => self.receive(),
            3 => self.receive_elsewhere(),
            4 | 5 => {
                self.process(domain);
            }
            6 => self.process_all(),
            7..10 => self.queue(domain),
            10 => (0..domains).for_each(|domain| self.queue(domain)),
            11..14 => self.send(),
            14 | 15 => self.write(domain),
            16 if cuts => self.change_cables(dice),
            16..19 => {
                let time = *dice.pick(&[1, 20, 100, 250, 600, 700, 1_000, 3_000]);
                self.advance(micros(time));
            }
            // A whole cycle.
            _ => {
                self.advance(BACK);
                self.receive();
                for domain in 0..domains {
                    self.process(domain);
                    self.write(domain);
                    self.queue(domain);
                }
                self.send();
            }
        }
        while self.application.pop_event().is_some() {}
    }
}

impl Parts {
    /// Each frame that was sent ends as one of these: all its copies came, none, one of two without which it is
    /// incomplete, or one of two with which it is complete.
    fn check_counters(&mut self) {
        if let Some(cable) = self.cut.take() {
            self.application.links_mut().network_mut().apply(Fault::Heal(cable));
        }
        let domains = self.known.len();
        for _ in 0..4 {
            self.advance(micros(5_000));
            self.receive();
            self.process_all();
            (0..domains).for_each(|domain| self.queue(domain));
            self.send();
        }
        self.advance(BACK);
        self.receive();
        self.process_all();
        // A separate frame of supervision that is lost ends with the next one.
        self.send();
        self.advance(BACK);
        self.receive();
        let counters = self.application.cyclic_counters();
        let ended = counters.received + counters.lost + counters.half + counters.copies_lost;
        assert_eq!(counters.sent, ended, "{counters:?}");
    }
}

fn micros(time: u64) -> Duration {
    Duration::from_micros(time)
}

/// All are in OP, and each domain with process data is complete.
fn is_settled(application: &Application<PartLinks>) -> bool {
    let exchange = application.exchange();
    let mut states = (0..exchange.domain_count()).filter_map(|domain| exchange.status(DomainId(domain)));
    application.all_settled() && states.all(|status| status.expected == 0 || status.state == DomainState::Complete)
}

/// Names the seed of a failure.
struct Named(u64);

impl Drop for Named {
    fn drop(&mut self) {
        if std::thread::panicking() {
            println!("seed {} failed: SEED={} repeats it", self.0, self.0);
        }
    }
}

fn run(seed: u64) -> Shown {
    let _named = Named(seed);
    let mut dice = Dice::new(seed);
    let mut parts = Parts::new(seed, &mut dice);
    let cuts = dice.one_in(2);
    for _ in 0..20 + dice.below(MOST_STEPS - 20) {
        parts.step(&mut dice, cuts);
    }
    if !seeds::sends_again(seed) {
        parts.check_counters();
    }
    let (compared, found, proven) = (parts.outputs.compared, parts.outputs.found, parts.truth.proven());
    Shown { compared, found, proven, ..parts.shown }
}

fn runs(seeds: Range<u64>) {
    let mut all = Shown::default();
    for seed in seeds.clone() {
        let Shown { steps, processed, complete, compared, found, proven, elsewhere } = run(seed);
        all.steps += steps;
        all.processed += processed;
        all.complete += complete;
        all.compared += compared;
        all.found += found;
        all.proven += proven;
        all.elsewhere += elsewhere;
    }
    println!("seeds {seeds:?}, {} with lost frames sent again: {all:?}", seeds::sending_again(&seeds));
    let count = seeds.end - seeds.start;
    assert!(count < 20 || (all.compared > count && all.complete > count && all.proven > count && all.found > count));
}

// covers: cycles, freshness, lost-frames
#[test]
fn parts_of_a_cycle_in_any_order_move_only_what_was_queued() {
    runs(0..150);
}

#[test]
fn seeds_from_the_environment() {
    crate::explorer::from_environment(|seed| println!("{:?}", run(seed)), runs);
}
