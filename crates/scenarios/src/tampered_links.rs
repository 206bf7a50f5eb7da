//! Links into a simulated segment that tamper with returned frames: responses are changed, dropped or forged. Virtual
//! time has a limit, so that an engine that hangs fails its test.

use ringcat::simulated::SimulatedSegment;
use ringcat::{Instant, Link, Links};
use ringcat_sim::network::Network;
use ringcat_wire::frame::MacAddress;

/// Limit of consecutive receives and waits without progress of time; far more than an engine needs between two events.
const IDLE_CALLS: u64 = 200_000;

/// Handling of a returned frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It arrives, possibly changed.
    Arrives,
    /// It arrives twice.
    ArrivesTwice,
    /// It is lost.
    IsLost,
}

/// Links with a function that receives every returned frame and may change it.
pub struct TamperedLinks<F> {
    segment: SimulatedSegment,
    meddle: F,
    again: Option<(Link, Vec<u8>)>,
    limit: Instant,
    idle: u64,
}

impl<F: FnMut(&mut Vec<u8>) -> Verdict> TamperedLinks<F> {
    /// Links into a network. Reaching the limit is a failure.
    pub fn new(network: Network, limit: Instant, meddle: F) -> TamperedLinks<F> {
        TamperedLinks { segment: SimulatedSegment::new(network), meddle, again: None, limit, idle: 0 }
    }

    /// The segment.
    pub fn network(&self) -> &Network {
        self.segment.network()
    }

    fn count_idle(&mut self) {
        self.idle += 1;
        assert!(self.idle < IDLE_CALLS, "the engine lets no time pass, at {} ns", self.segment.now().0);
    }
}

impl<F: FnMut(&mut Vec<u8>) -> Verdict> Links for TamperedLinks<F> {
    fn now(&self) -> Instant {
        self.segment.now()
    }

    fn addresses(&self) -> ringcat::PerLink<MacAddress> {
        self.segment.addresses()
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        self.segment.send(link, frame);
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        if let Some((link, frame)) = self.again.take() {
            take(link, &frame);
            return true;
        }
        let mut received = None;
        if !self.segment.receive(&mut |link, frame| received = Some((link, frame.to_vec()))) {
            self.count_idle();
            return false;
        }
        if let Some((link, mut frame)) = received {
            match (self.meddle)(&mut frame) {
                Verdict::Arrives => take(link, &frame),
                Verdict::ArrivesTwice => {
                    take(link, &frame);
                    self.again = Some((link, frame));
                }
                Verdict::IsLost => {}
            }
        }
        true
    }

    fn wait(&mut self, until: Instant) {
        if self.again.is_some() {
            return;
        }
        let before = self.segment.now();
        self.segment.wait(until.min(self.limit));
        let now = self.segment.now();
        assert!(now < self.limit, "virtual time reached its limit of {} ms", self.limit.0 / 1_000_000);
        if now > before {
            self.idle = 0;
        } else {
            self.count_idle();
        }
    }
}
