//! State of the ring and of the links: opened and closed with the counts of both sides, redundancy lost and restored,
//! carrier lost and back. Each edge is reported once, at a limited rate ([`Damper`]); the status is always up to date.
//!
//! All inputs are words posted by the exchange: nothing here waits for a frame, so the event comes in the cycle whose
//! frames showed the change.

use super::damper::Damper;
use super::disturbance::Disturbance;
use super::effect::{Effect, Effects};
use super::wake::Wake;
use super::words::{Reader, Words};
use crate::event::Event;
use crate::link::{Link, LinkSet};
use crate::ring::RingState;
use crate::ring_status::{Cable, CableErrors, LinkCounts, LinkStatus, Redundancy, RedundancyLoss, RingStatus};
use crate::time::Instant;
use crate::topology::{Topology, are_doubtful};

/// State of the ring, and what was reported of it.
#[derive(Debug)]
pub(super) struct Ring {
    /// The state that was reported last.
    reported: RingState,
    /// Changes that broadcasts have shown.
    broadcast_changes: u32,
    damper: Damper,
    ways: Damper,
    carriers: [Option<bool>; 2],
    reported_carriers: [Option<bool>; 2],
    cables: [Damper; 2],
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
            broadcast_changes: 0,
            damper: Damper::default(),
            ways: Damper::default(),
            carriers,
            reported_carriers: carriers,
            cables: [Damper::default(); 2],
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
        (reader, words): (&mut Reader, &Words),
        disturbance: Option<Disturbance>,
        cabled: &Cabled<'_>,
        now: Instant,
        effects: &mut Effects,
    ) -> Wake {
        match disturbance {
            // The redundant link is down by our own command: not reported.
            Some(Disturbance::OpenByLink) => {
                reader.ring.skip(words);
                self.carriers = words.carriers();
                return Wake::NEVER;
            }
            // While the ring is open on purpose by a port, the carrier of the interface does not change.
            Some(Disturbance::OpenByPort) => {
                let again = self.observe_carriers(words.carriers(), now, effects);
                reader.ring.skip_ring(words);
                return again;
            }
            Some(Disturbance::IsolateRings | Disturbance::Readdress | Disturbance::Rescan) | None => {}
        }
        let again = self.observe_carriers(words.carriers(), now, effects);
        // A single link is always in the state "ring of one": not reported.
        if words.links() == LinkSet::Single {
            return again;
        }
        again.or(self.observe_ring((reader, words), cabled, now, effects))
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
    fn observe_ring(
        &mut self,
        (reader, words): (&mut Reader, &Words),
        cabled: &Cabled<'_>,
        now: Instant,
        effects: &mut Effects,
    ) -> Wake {
        let change = reader.ring.observe(words);
        if change.ring {
            self.damper.changed(now);
        }
        if change.way {
            self.ways.changed(now);
        }
        let settles = self.report_ring((reader, words), cabled, now, effects);
        let is_reported = self.report_redundancy(words.dead_way(), now, effects);
        self.status.state = words.ring_state();
        self.status.changes = words.ring_changes();
        self.status.unsteady = self.damper.is_unsteady(now);
        let reported = if is_reported { Wake::NEVER } else { Wake::at(self.ways.due()) };
        let steady = self.damper.steady_at(now).map_or(Wake::NEVER, Wake::at);
        settles.or(reported).or(steady)
    }

    /// Returns when to evaluate again until the state is reported with steady counts.
    fn report_ring(
        &mut self,
        (reader, words): (&mut Reader, &Words),
        cabled: &Cabled<'_>,
        now: Instant,
        effects: &mut Effects,
    ) -> Wake {
        if words.number().is_none() {
            return Wake::NEVER;
        }
        if words.ring_state() == self.reported {
            return if reader.counts.observe(words) { Wake::NEVER } else { Wake::RESULT };
        }
        if !self.damper.may_report(now) {
            return Wake::at(self.damper.due());
        }
        let Some(counts) = reader.counts.after_change(words) else { return Wake::RESULT };
        if !self.report_edge(words.ring_state(), counts, effects) {
            return Wake::RESULT;
        }
        effects.0.push(Effect::MainCount(counts.main));
        self.place_at_host((words.ring_state(), reader.counts.steady()), counts, cabled, effects);
        if self.damper.count_report(now) {
            effects.report(Event::RingUnsteady { changes: words.ring_changes() });
        }
        Wake::RESULT
    }

    /// Reports another state of the ring; false if there is nothing to report.
    fn report_edge(&mut self, state: RingState, counts: LinkCounts, effects: &mut Effects) -> bool {
        let LinkCounts { main, redundant } = counts;
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
            self.broadcast_changes = self.broadcast_changes.wrapping_add(1);
        }
        if state == self.reported || !self.damper.may_report(now) {
            return;
        }
        if self.report_edge(state, counts, effects) && self.damper.count_report(now) {
            effects.report(Event::RingUnsteady { changes: self.broadcast_changes });
        }
    }

    /// If all SubDevices answer on one side, the break is at the cable of the other interface; no SubDevice has to be
    /// read. `steady`: SubDevices that answered before the change.
    fn place_at_host(
        &mut self,
        (state, steady): (RingState, u16),
        LinkCounts { main, redundant }: LinkCounts,
        cabled: &Cabled<'_>,
        effects: &mut Effects,
    ) {
        let Cabled { topology, cables } = cabled;
        // Which cable leads to an interface is certain only if the neighbours are known.
        let all = steady > 0 && main + redundant == steady && !are_doubtful(topology);
        let is_end_known = !topology.open_ports.is_empty() || topology.main_end.is_some();
        let cable = match (state, main, redundant) {
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

    /// True if the present state was reported.
    fn report_redundancy(&mut self, dead_way: Option<Link>, now: Instant, effects: &mut Effects) -> bool {
        let before = self.status.redundancy;
        let cause = match (self.reported, dead_way) {
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
