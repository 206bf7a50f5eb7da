//! Telling of the ring and the links: opened and closed with the counts of both sides, redundancy lost and regained, a
//! carrier gone and back. Each edge once, and not too often ([`damper`]); what is asked for is always up to date.
//!
//! All of it comes from words that the exchange posts: nothing here waits for a frame, so that the event comes in the
//! cycle whose frames showed the change.

mod damper;

use alloc::rc::Rc;
use core::cell::Cell;
use core::time::Duration;

use damper::Damper;

use super::fleet::SharedFleet;
use crate::board::{RingWord, Supervision};
use crate::event::Event;
use crate::link::{Link, LinkSet};
use crate::ring::RingState;
use crate::ring_status::{LinkStatus, Redundancy, RedundancyLoss};
use crate::supervisor::Bus;
use crate::topology::are_doubtful;

/// Pause between two looks at the board.
const PAUSE: Duration = Duration::from_micros(500);
/// Where the counts are not known from before: supervision results until they must be the same twice in a row. At the
/// edge of a cut one copy may meet fewer SubDevices than live on its side.
const SETTLING_RESULTS: u32 = 20;

/// Runs for ever. `reported` is the state of the ring that was told last.
pub(super) async fn watch_ring(bus: Bus, fleet: SharedFleet, reported: Rc<Cell<RingState>>) {
    let mut watch = RingWatch {
        reported,
        changes: 0,
        ring: Damper::default(),
        dead_way: None,
        ways: Damper::default(),
        carriers: bus.carriers(),
        told_carriers: bus.carriers(),
        cables: [Damper::default(); 2],
        last: None,
        settling: 0,
        steady: 0,
        fleet,
        bus,
    };
    loop {
        watch.bus.sleep(PAUSE).await;
        if watch.fleet.is_controlled_break() {
            watch.look_away();
            continue;
        }
        watch.look_at_carriers();
        // One link is a ring of one, which is no news.
        if watch.bus.links() == LinkSet::Ring {
            watch.look_at_ring();
        }
    }
}

struct RingWatch {
    bus: Bus,
    fleet: SharedFleet,
    reported: Rc<Cell<RingState>>,
    /// Changes of the ring that were seen.
    changes: u32,
    ring: Damper,
    /// The way that was seen dead last.
    dead_way: Option<Link>,
    ways: Damper,
    carriers: [Option<bool>; 2],
    told_carriers: [Option<bool>; 2],
    cables: [Damper; 2],
    /// Number and counts of the last supervision result.
    last: Option<(u32, (u16, u16))>,
    /// Results since the ring changed.
    settling: u32,
    /// SubDevices that answered twice in a row while the ring did not change.
    steady: u16,
}

impl RingWatch {
    /// The redundant link is down on our own order: that is nothing to tell.
    fn look_away(&mut self) {
        let word = self.fleet.board.ring();
        (self.changes, self.dead_way) = (word.changes, word.dead_way);
        self.carriers = self.bus.carriers();
    }

    fn look_at_carriers(&mut self) {
        let now = self.bus.now();
        let carriers = self.bus.carriers();
        for link in Link::ALL {
            let at = link.index();
            if carriers[at] != self.carriers[at] {
                self.cables[at].changed(now);
                self.carriers[at] = carriers[at];
            }
            if carriers[at] == self.told_carriers[at] || !self.cables[at].may_tell(now) {
                continue;
            }
            let before = core::mem::replace(&mut self.told_carriers[at], carriers[at]);
            match carriers[at] {
                Some(false) => self.bus.report(Event::LinkDown { link }),
                Some(true) if before == Some(false) => self.bus.report(Event::LinkUp { link }),
                Some(true) | None => continue,
            }
            self.cables[at].tell(now);
        }
    }

    fn look_at_ring(&mut self) {
        let now = self.bus.now();
        let word = self.fleet.board.ring();
        if self.fleet.clocks.are_measuring() {
            // Open on purpose.
            self.changes = word.changes;
            return;
        }
        if word.changes != self.changes {
            self.ring.changed(now);
            self.changes = word.changes;
        }
        if word.dead_way != self.dead_way {
            self.ways.changed(now);
            self.dead_way = word.dead_way;
        }
        self.tell_ring(word);
        self.tell_redundancy(word);
        let mut access = self.fleet.access();
        access.ring.state = word.state;
        access.ring.changes = word.changes;
        access.ring.unsteady = self.ring.is_unsteady(now);
    }

    fn tell_ring(&mut self, word: RingWord) {
        let Some((number, supervision)) = self.fleet.board.supervision() else { return };
        let counts = (supervision.main.0, supervision.redundant.0);
        if word.state == self.reported.get() {
            if self.last.is_some_and(|(before, same)| before != number && same == counts) {
                self.steady = supervision.total().0;
            }
            self.last = Some((number, counts));
            self.settling = 0;
            return;
        }
        let now = self.bus.now();
        if !self.ring.may_tell(now) {
            return;
        }
        let Some((main, redundant)) = self.counts(word, number, supervision) else { return };
        let place = self.fleet.access().ring.place;
        let event = match (self.reported.replace(word.state), word.state) {
            (_, RingState::Open) => Event::RingOpened { main, redundant },
            (RingState::Open, RingState::Closed) => Event::RingClosed { main, redundant, place },
            (_, RingState::Closed | RingState::Unknown) => return,
        };
        self.bus.report(event);
        self.bus.set_main_count(main);
        self.place_at_host(word, main, redundant);
        if self.ring.tell(now) {
            self.bus.report(Event::RingUnsteady { changes: word.changes });
        }
    }

    /// Where all answer on one side it is the other interface's cable, which nobody needs to be asked for.
    fn place_at_host(&self, word: RingWord, main: u16, redundant: u16) {
        let mut access = self.fleet.access();
        // Which cable leads to an interface is certain only where neighbours are.
        let all = self.steady > 0 && main + redundant == self.steady && !are_doubtful(&access.topology);
        let is_end_known = !access.topology.open_ports.is_empty() || access.topology.main_end.is_some();
        let cable = match (word.state, main, redundant) {
            (RingState::Open, 0, _) if all => access.cables.first().filter(|(cable, _)| cable.near.is_none()),
            (RingState::Open, _, 0) if all && is_end_known => {
                access.cables.last().filter(|(cable, _)| cable.far.is_none())
            }
            _ => None,
        };
        let place = cable.map(|(cable, _)| *cable);
        access.ring.place = place;
        access.ring.links = [main, redundant].map(|answering| LinkStatus { answering, ..LinkStatus::default() });
        if let Some(cable) = place {
            self.bus.report(Event::BreakLocated { cable });
        }
    }

    /// SubDevices on each link, as soon as they are certain.
    fn counts(&mut self, word: RingWord, number: u32, supervision: Supervision) -> Option<(u16, u16)> {
        let counts = (supervision.main.0, supervision.redundant.0);
        match (word.state, word.returned) {
            // A copy that came back on its own link has met all who live there. The others are on the other side, also
            // where the other copy is still out or was lost.
            (RingState::Open, Some((link, count))) if self.steady > 0 => {
                let other = self.steady.saturating_sub(count);
                let (seen, derived) = match link {
                    Link::Main => (supervision.main.0, (count, other)),
                    Link::Redundant => (supervision.redundant.0, (other, count)),
                };
                let is_of_both = seen == count && counts.0 > 0 && counts.1 > 0;
                Some(if is_of_both { counts } else { derived })
            }
            // Another frame may have shown the change, and these are still counts of the open ring.
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

    fn tell_redundancy(&mut self, word: RingWord) {
        let now = self.bus.now();
        let before = self.fleet.access().ring.redundancy;
        let cause = match (self.reported.get(), word.dead_way) {
            (RingState::Open, _) => Some(RedundancyLoss::Open),
            (RingState::Closed, Some(link)) => Some(RedundancyLoss::OneWay(link)),
            (RingState::Closed, None) => None,
            (RingState::Unknown, _) => return,
        };
        let is_told = match (before, cause) {
            (Redundancy::Lost { cause: before, .. }, Some(cause)) => before == cause,
            (Redundancy::Ready, None) => true,
            _ => false,
        };
        let by_way = matches!(cause, Some(RedundancyLoss::OneWay(_)))
            || matches!(before, Redundancy::Lost { cause: RedundancyLoss::OneWay(_), .. });
        if is_told || (by_way && !self.ways.may_tell(now)) {
            return;
        }
        let was_lost = matches!(before, Redundancy::Lost { .. });
        match cause {
            Some(cause) => {
                self.fleet.access().ring.redundancy = Redundancy::Lost { cause, since: now };
                self.bus.report(Event::RedundancyLost { cause });
            }
            None => {
                self.fleet.access().ring.redundancy = Redundancy::Ready;
                if was_lost {
                    self.bus.report(Event::RedundancyRegained);
                }
            }
        }
        if by_way {
            self.ways.tell(now);
        }
    }
}
