//! Applications that run the steps of a cycle themselves, by the times at which they receive.

use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::{Application, DomainId, DomainState, Instant, MainDevice, Options, automatic};
use ringcat_sim::cable::{CableId, Direction};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_sim::time::SimTime;
use scenarios::segments::{descriptions, line, ring};

use super::{LEARNING, MS, US, kinds};

const DOMAIN: DomainId = DomainId(0);
const DETECTION: Duration = US.saturating_mul(10);
/// From one edge to the next: the ring state has settled.
const REST: u64 = 40;

/// When the loop receives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Receives {
    /// When frames usually are back, at `receive_again_at`, and before it processes.
    ThreeTimes,
    /// With `receive_until`, and before it processes.
    Until,
    /// Before it processes.
    Once,
}

/// Whether the domain has a period, or the application says when it sends next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sends {
    Period,
    Expected,
}

struct OwnLoop {
    application: Application<SimulatedSegment>,
    receives: Receives,
    /// From a send until frames usually are back.
    usual: Duration,
    sent_at: Instant,
    next: Instant,
    incomplete: u64,
}

impl OwnLoop {
    fn start(network: Network, receives: Receives, sends: Sends) -> OwnLoop {
        let mut main_device = MainDevice::request(SimulatedSegment::new(network), &Options::default());
        let scan = main_device.scan().expect("it is scanned");
        let period = if sends == Sends::Period { MS } else { Duration::ZERO };
        let declaration = automatic(&scan.subdevices, period).with_sends_again(true);
        let mut application = main_device.activate(declaration).map_err(|refused| refused.error).expect("it fits");
        if sends == Sends::Expected {
            application.expect_sends_every(MS);
        }
        let (sent_at, next) = (application.now(), application.now() + MS);
        let mut own = OwnLoop { application, receives, usual: MS / 2, sent_at, next, incomplete: 0 };
        own.run(5_000, |own| own.application.all_settled());
        // How long frames take, on time or 2 us later.
        own.application.receive_until(own.next);
        own.usual = own.application.now().since(own.sent_at) + 2 * US;
        own.run(LEARNING, |_| false);
        own.incomplete = 0;
        own
    }

    fn run(&mut self, most: u64, is_done: impl Fn(&OwnLoop) -> bool) {
        for _ in 0..most {
            self.cycle();
            if is_done(self) {
                return;
            }
        }
    }

    /// Time passes; frames that arrive wait until they are received.
    fn pass_until(&mut self, at: Instant) {
        self.application.links_mut().network_mut().advance(SimTime(at.0));
    }

    fn cycle(&mut self) {
        match self.receives {
            Receives::ThreeTimes => {
                self.pass_until(self.sent_at + self.usual);
                self.application.receive();
                while self.application.receive_again_at() < self.next {
                    self.pass_until(self.application.receive_again_at());
                    self.application.receive();
                }
            }
            Receives::Until => {
                self.application.receive_until(self.next);
            }
            Receives::Once => (),
        }
        self.pass_until(self.next);
        self.next += MS;
        self.application.receive();
        let status = self.application.process(DOMAIN);
        self.incomplete += u64::from(status.state != DomainState::Complete || status.pending);
        self.application.queue(DOMAIN);
        self.sent_at = self.application.now();
        self.application.send();
    }

    /// These faults come in all phases of a flight, and in three of the rest of the cycle.
    fn disturb(&mut self, faults: &[Fault]) {
        const FLIGHT_PHASES: u32 = 12;
        let flight = self.usual * 5 / 4;
        let phases = (0..FLIGHT_PHASES).map(|phase| flight * phase / FLIGHT_PHASES);
        for after in phases.chain([MS / 3, MS / 2, MS * 9 / 10]) {
            for fault in faults {
                let at = self.application.now() + after;
                self.application.links_mut().network_mut().schedule(SimTime(at.0), fault.clone());
                self.run(REST, |_| false);
            }
        }
    }

    /// Incomplete cycles, and cycles that are complete because a frame was sent again.
    fn outcome(&self) -> (u64, u64) {
        (self.incomplete, self.application.cyclic_counters().saved)
    }
}

/// The outcome for a ring with this many SubDevices whose cables are cut and repaired.
fn in_a_ring(count: usize, receives: Receives, sends: Sends) -> (u64, u64) {
    let network = ring(descriptions(&kinds(count)), NetworkOptions::default().with_detection_delay(DETECTION));
    let mut own = OwnLoop::start(network, receives, sends);
    for cable in [1, count / 2, count] {
        own.disturb(&[Fault::Cut(CableId(cable)), Fault::Heal(CableId(cable))]);
    }
    own.outcome()
}

/// The outcome for a line in which single frames are lost.
fn in_a_line(receives: Receives, sends: Sends) -> (u64, u64) {
    let mut own = OwnLoop::start(line(descriptions(&kinds(10)), NetworkOptions::default()), receives, sends);
    let drop = |cable| Fault::Drop { cable: CableId(cable), direction: Some(Direction::AToB), count: 1 };
    own.disturb(&[1, 5].map(drop));
    own.outcome()
}

fn compare(receives: Receives, holds: impl Fn(u64, u64) -> bool) {
    for sends in [Sends::Period, Sends::Expected] {
        let rings = [4, 10, 33].map(|count| (format!("ring of {count}"), in_a_ring(count, receives, sends)));
        let line = ("line of 10".to_owned(), in_a_line(receives, sends));
        for (what, (incomplete, saved)) in rings.into_iter().chain([line]) {
            println!("{what}, {receives:?}, {sends:?}: {incomplete} incomplete, {saved} saved");
            assert!(
                holds(incomplete, saved),
                "{what}, {receives:?}, {sends:?}: {incomplete} incomplete, {saved} saved"
            );
        }
    }
}

// covers: lost-frames, cycles
#[test]
fn a_loop_that_receives_three_times_in_a_cycle_loses_none() {
    compare(Receives::ThreeTimes, |incomplete, saved| incomplete == 0 && saved > 0);
}

// covers: lost-frames, cycles
#[test]
fn a_loop_that_receives_until_the_next_cycle_loses_none() {
    compare(Receives::Until, |incomplete, saved| incomplete == 0 && saved > 0);
}

/// The measured round trip is as long as the cycle.
// covers: lost-frames, cycles
#[test]
fn a_loop_that_receives_once_in_a_cycle_sends_nothing_again() {
    compare(Receives::Once, |incomplete, saved| incomplete > 0 && saved == 0);
}
