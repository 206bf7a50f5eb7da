//! State of the ring and of the links: opened and closed with the counts of both sides, redundancy lost and restored,
//! carrier lost and back. Each edge is reported once, at a limited rate ([`Damper`]); the status is always up to date.
//!
//! All inputs are words posted by the exchange: nothing here waits for a frame, so the event comes in the cycle whose
//! frames showed the change.

use super::damper::Damper;
use super::disturbance::Disturbance;
use super::effect::{Effect, Effects};
use super::wake::Wake;
use crate::board::{RingWord, Supervision};
use crate::event::Event;
use crate::link::{Link, LinkSet};
use crate::ring::RingState;
use crate::ring_status::{Cable, CableErrors, LinkCounts, LinkStatus, Redundancy, RedundancyLoss, RingStatus};
use crate::time::Instant;
use crate::topology::{Topology, are_doubtful};

/// If the counts before the change are not known: supervision results after which two equal counts in a row are
/// required. At the moment of a cut one copy may be processed by fewer SubDevices than are connected to its side.
const SETTLING_RESULTS: u32 = 20;

/// Words posted by the exchange, or without an application the answer to a broadcast, and the carriers of the links.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Words {
    /// The links in use.
    pub links: LinkSet,
    /// By [`Link::index`].
    pub carriers: [Option<bool>; 2],
    /// The state of the ring.
    pub ring: RingWord,
    /// The latest supervision result and its number; without an application a new one, or none.
    pub supervision: Option<(u32, Supervision)>,
    /// Cycles that the exchange has sent.
    pub cycles: u64,
}

impl Words {
    /// No link has a carrier.
    pub fn is_unplugged(&self) -> bool {
        let links = if self.links == LinkSet::Ring { 2 } else { 1 };
        self.carriers.iter().take(links).all(|carrier| *carrier == Some(false))
    }
}

/// State of the ring, and what was reported of it.
#[derive(Debug)]
pub(super) struct Ring {
    /// The state that was reported last.
    reported: RingState,
    /// Detected changes of the ring.
    changes: u32,
    damper: Damper,
    /// The direction in which frames were lost last.
    dead_way: Option<Link>,
    ways: Damper,
    carriers: [Option<bool>; 2],
    reported_carriers: [Option<bool>; 2],
    cables: [Damper; 2],
    /// Number and counts of the last supervision result that was evaluated.
    last: Option<(u32, (u16, u16))>,
    /// Results since the ring changed.
    settling: u32,
    /// SubDevices that answered twice in a row while the ring did not change.
    steady: u16,
    /// Status for the application.
    pub status: RingStatus,
}

/// Data that locates a break.
pub(super) struct Cabled<'a> {
    pub topology: &'a Topology,
    pub cables: &'a [(Cable, CableErrors)],
}

impl Ring {
    /// A ring without observations, on links with these carriers.
    pub fn new(status: RingStatus, carriers: [Option<bool>; 2]) -> Ring {
        Ring {
            reported: RingState::Unknown,
            changes: 0,
            damper: Damper::default(),
            dead_way: None,
            ways: Damper::default(),
            carriers,
            reported_carriers: carriers,
            cables: [Damper::default(); 2],
            last: None,
            settling: 0,
            steady: 0,
            status,
        }
    }

    /// The state that was reported last.
    pub fn reported(&self) -> RingState {
        self.reported
    }

    /// Processes posted words. Returns when to evaluate again though no other words are posted.
    pub fn observe(
        &mut self,
        words: &Words,
        disturbance: Option<Disturbance>,
        cabled: &Cabled<'_>,
        now: Instant,
        effects: &mut Effects,
    ) -> Wake {
        match disturbance {
            // The redundant link is down by our own command: not reported.
            Some(Disturbance::OpenByLink) => {
                (self.changes, self.dead_way) = (words.ring.changes, words.ring.dead_way);
                self.carriers = words.carriers;
                return Wake::NEVER;
            }
            // While the ring is open on purpose by a port, the carrier of the interface does not change.
            Some(Disturbance::OpenByPort) => {
                let again = self.observe_carriers(words.carriers, now, effects);
                self.changes = words.ring.changes;
                return again;
            }
            Some(Disturbance::IsolateRings | Disturbance::Readdress | Disturbance::Rescan) | None => {}
        }
        let again = self.observe_carriers(words.carriers, now, effects);
        // A single link is always in the state "ring of one": not reported.
        if words.links == LinkSet::Single {
            return again;
        }
        again.or(self.observe_ring(words, cabled, now, effects))
    }

    /// Reports changes of carriers. Returns when a change that is held back may be reported.
    pub fn observe_carriers(&mut self, carriers: [Option<bool>; 2], now: Instant, effects: &mut Effects) -> Wake {
        let mut again = Wake::NEVER;
        for link in Link::ALL {
            let at = link.index();
            if carriers[at] != self.carriers[at] {
                self.cables[at].changed(now);
                self.carriers[at] = carriers[at];
            }
            if carriers[at] == self.reported_carriers[at] {
                continue;
            }
            if !self.cables[at].may_report(now) {
                again = again.or(Wake::at(self.cables[at].due()));
                continue;
            }
            let before = core::mem::replace(&mut self.reported_carriers[at], carriers[at]);
            match carriers[at] {
                Some(false) => effects.report(Event::LinkDown { link }),
                Some(true) if before == Some(false) => effects.report(Event::LinkUp { link }),
                Some(true) | None => continue,
            }
            self.cables[at].count_report(now);
        }
        again
    }

    /// Returns when to evaluate again while a change is not yet reported or counts settle.
    fn observe_ring(&mut self, words: &Words, cabled: &Cabled<'_>, now: Instant, effects: &mut Effects) -> Wake {
        let word = words.ring;
        if word.changes != self.changes {
            self.damper.changed(now);
            self.changes = word.changes;
        }
        if word.dead_way != self.dead_way {
            self.ways.changed(now);
            self.dead_way = word.dead_way;
        }
        let settles = self.report_ring(words, cabled, now, effects);
        let is_reported = self.report_redundancy(word, now, effects);
        self.status.state = word.state;
        self.status.changes = word.changes;
        self.status.unsteady = self.damper.is_unsteady(now);
        let reported = if is_reported { Wake::NEVER } else { Wake::at(self.ways.due()) };
        let steady = self.damper.steady_at(now).map_or(Wake::NEVER, Wake::at);
        settles.or(reported).or(steady)
    }

    /// Returns when to evaluate again until the state is reported with steady counts.
    fn report_ring(&mut self, words: &Words, cabled: &Cabled<'_>, now: Instant, effects: &mut Effects) -> Wake {
        let word = words.ring;
        let Some((number, supervision)) = words.supervision else { return Wake::NEVER };
        let counts = (supervision.main.0, supervision.redundant.0);
        if word.state == self.reported {
            if self.last.is_some_and(|(before, same)| before != number && same == counts) {
                self.steady = supervision.total().0;
            }
            self.last = Some((number, counts));
            self.settling = 0;
            return if self.steady == supervision.total().0 { Wake::NEVER } else { Wake::RESULT };
        }
        if !self.damper.may_report(now) {
            return Wake::at(self.damper.due());
        }
        let Some((main, redundant)) = self.counts(word, number, supervision) else { return Wake::RESULT };
        if !self.report_edge(word.state, (main, redundant), effects) {
            return Wake::RESULT;
        }
        effects.0.push(Effect::MainCount(main));
        self.place_at_host(word, (main, redundant), cabled, effects);
        if self.damper.count_report(now) {
            effects.report(Event::RingUnsteady { changes: word.changes });
        }
        Wake::RESULT
    }

    /// Reports another state of the ring; false if there is nothing to report.
    fn report_edge(&mut self, state: RingState, (main, redundant): (u16, u16), effects: &mut Effects) -> bool {
        let place = self.status.place;
        effects.report(match (core::mem::replace(&mut self.reported, state), state) {
            (_, RingState::Open) => Event::RingOpened { main, redundant },
            (RingState::Open, RingState::Closed) => Event::RingClosed { main, redundant, place },
            (_, RingState::Closed | RingState::Unknown) => return false,
        });
        true
    }

    /// Begins to follow a ring without an application: its present state is not reported.
    pub fn begin_idle(&mut self, carriers: [Option<bool>; 2], state: RingState) {
        *self = Ring { reported: state, ..Ring::new(RingStatus { state, ..self.status }, carriers) };
    }

    /// Processes a broadcast without an application. Its counts are those of one frame: nothing has to settle.
    pub fn observe_broadcast(&mut self, state: RingState, counts: LinkCounts, now: Instant, effects: &mut Effects) {
        if core::mem::replace(&mut self.status.state, state) != state {
            self.damper.changed(now);
            self.changes = self.changes.wrapping_add(1);
        }
        if state == self.reported || !self.damper.may_report(now) {
            return;
        }
        if self.report_edge(state, (counts.main, counts.redundant), effects) && self.damper.count_report(now) {
            effects.report(Event::RingUnsteady { changes: self.changes });
        }
    }

    /// If all SubDevices answer on one side, the break is at the cable of the other interface; no SubDevice has to be
    /// read.
    fn place_at_host(
        &mut self,
        word: RingWord,
        (main, redundant): (u16, u16),
        cabled: &Cabled<'_>,
        effects: &mut Effects,
    ) {
        let Cabled { topology, cables } = cabled;
        // Which cable leads to an interface is certain only if the neighbours are known.
        let all = self.steady > 0 && main + redundant == self.steady && !are_doubtful(topology);
        let is_end_known = !topology.open_ports.is_empty() || topology.main_end.is_some();
        let cable = match (word.state, main, redundant) {
            (RingState::Open, 0, _) if all => cables.first().filter(|(cable, _)| cable.near.is_none()),
            (RingState::Open, _, 0) if all && is_end_known => cables.last().filter(|(cable, _)| cable.far.is_none()),
            _ => None,
        };
        let place = cable.map(|(cable, _)| *cable);
        self.status.place = place;
        self.status.links = [main, redundant].map(|answering| LinkStatus { answering, ..LinkStatus::default() });
        if let Some(cable) = place {
            effects.report(Event::BreakLocated { cable });
        }
    }

    /// SubDevices on each link, as soon as the counts are certain.
    fn counts(&mut self, word: RingWord, number: u32, supervision: Supervision) -> Option<(u16, u16)> {
        let counts = (supervision.main.0, supervision.redundant.0);
        match (word.state, word.returned) {
            // A copy that returned on its own link was processed by all SubDevices on its side. All others are on the
            // other side, also if the other copy is late or lost.
            (RingState::Open, Some((link, count))) if self.steady > 0 => {
                let other = self.steady.saturating_sub(count);
                let (seen, derived) = match link {
                    Link::Main => (supervision.main.0, (count, other)),
                    Link::Redundant => (supervision.redundant.0, (other, count)),
                };
                let is_of_both = seen == count && counts.0 > 0 && counts.1 > 0;
                Some(if is_of_both { counts } else { derived })
            }
            // Another frame may have shown the change; these are then counts from before it.
            (RingState::Open, _) if !supervision.returned => None,
            (RingState::Closed, _) if supervision.returned => None,
            (RingState::Closed, _) if supervision.total().0 == self.steady => Some(counts),
            _ => self.settled(number, counts),
        }
    }

    fn settled(&mut self, number: u32, counts: (u16, u16)) -> Option<(u16, u16)> {
        match self.last {
            Some((before, _)) if before == number => return None,
            Some((_, before)) if self.settling > 0 && (before == counts || self.settling >= SETTLING_RESULTS) => {
                return Some(counts);
            }
            _ => {}
        }
        self.settling += 1;
        self.last = Some((number, counts));
        None
    }

    /// True if the present state was reported.
    fn report_redundancy(&mut self, word: RingWord, now: Instant, effects: &mut Effects) -> bool {
        let before = self.status.redundancy;
        let cause = match (self.reported, word.dead_way) {
            (RingState::Open, _) => Some(RedundancyLoss::Open),
            (RingState::Closed, Some(link)) => Some(RedundancyLoss::OneWay(link)),
            (RingState::Closed, None) => None,
            (RingState::Unknown, _) => return true,
        };
        let is_reported = match (before, cause) {
            (Redundancy::Lost { cause: before, .. }, Some(cause)) => before == cause,
            (Redundancy::Ready, None) => true,
            _ => false,
        };
        let by_way = matches!(cause, Some(RedundancyLoss::OneWay(_)))
            || matches!(before, Redundancy::Lost { cause: RedundancyLoss::OneWay(_), .. });
        if is_reported || (by_way && !self.ways.may_report(now)) {
            return is_reported;
        }
        let was_lost = matches!(before, Redundancy::Lost { .. });
        match cause {
            Some(cause) => {
                self.status.redundancy = Redundancy::Lost { cause, since: now };
                effects.report(Event::RedundancyLost { cause });
            }
            None => {
                self.status.redundancy = Redundancy::Ready;
                if was_lost {
                    effects.report(Event::RedundancyRegained);
                }
            }
        }
        if by_way {
            self.ways.count_report(now);
        }
        true
    }
}
