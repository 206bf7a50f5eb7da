//! The exchange of the ACTIVE: master frames out and back, and frames of others.

use ringcat_wire::frame::MacAddress;
use ringcat_wire::master_frame::{NotReady, Phase, Stage, header_of_frame};

use super::Exchange;
use super::partner::{Difference, Items};
use super::state::{Offers, State};
use crate::board::Board;
use crate::event::CyclicStandbyEvent;
use crate::exchange::Received;
use crate::exchange::flight::Step;
use crate::exchange::master_frames::{Returned, Sources};
use crate::link::Link;
use crate::queue::Producer;
use crate::ring::{FrameCopy, Sequence};
use crate::role::{MainDeviceRole, Partner};

/// Ids of master frames count on from here: no frame with process data has such an index.
pub(super) const INDEX: u16 = 0x4000;
/// Cycles in which the role is offered before that is given up.
const PATIENCE: u8 = 50;
/// Cycles without a frame of another MainDevice after which the next one is another collision.
const APART: u64 = 100;

impl Exchange {
    /// Sends the master frames of this cycle, whose frames with process data followed the one with number `before`.
    #[inline(never)]
    pub(in crate::exchange) fn send_master_frames(&mut self, before: Sequence, transmit: &mut impl FnMut(Link, &[u8])) {
        let Some(state) = self.standby.0.as_deref_mut() else { return };
        if state.frames.cycle != 0 {
            let lost = state.frames.lost();
            if lost > 0 {
                self.tally.disturbed().lost += lost;
                self.board.post_lost(self.tally.counters.lost);
            }
            state.evaluate(&self.board, &mut self.events);
        }
        let header = &mut state.frames.header;
        header.first = before.next().number();
        header.frames = self.sequence.since(before) as u16;
        header.item = state.items.next();
        header.write = state.words.write();
        let (board, domains, counters) = (&*self.board, &self.domains[..], &self.tally.counters);
        let ring = self.evidence.monitor.state();
        let to_inactive = state.data.outgoing(state.role);
        state.frames.load(&Sources { board, words: &state.words, domains, counters, ring, to_inactive });
        let (sequence, by_id) = (&mut self.sequence, &mut self.by_id);
        let next = |number: usize| {
            *sequence = sequence.next();
            by_id[usize::from(sequence.frame_id())] = INDEX + number as u16;
            *sequence
        };
        let bytes = state.frames.send(&self.identity, self.links, next, transmit);
        self.tally.counters.sent += state.frames.count() as u64;
        self.tally.counters.bytes += bytes;
    }

    /// Takes a copy of a frame with this index, if it is a master frame.
    #[inline(never)]
    pub(in crate::exchange) fn receive_master(
        &mut self,
        index: u16,
        copy: FrameCopy,
        bytes: &[u8],
    ) -> Option<Received> {
        let state = self.standby.0.as_deref_mut()?;
        let number = usize::from(index.checked_sub(INDEX)?);
        if number >= state.frames.count() {
            return None;
        }
        Some(match state.frames.receive(number, copy, bytes, state.data.incoming_mut(MainDeviceRole::Active)) {
            Step::Waiting => {
                self.board.traffic.post_half_home(copy.sent_on, copy.sequence);
                Received::Taken
            }
            Step::Finished => {
                self.board.traffic.post_home(copy.sequence);
                self.tally.counters.received += 1;
                Received::Taken
            }
            Step::Late => {
                self.tally.disturbed().late += 1;
                Received::Late
            }
            Step::Corrupt => {
                self.tally.disturbed().corrupt += 1;
                Received::Corrupt
            }
        })
    }

    /// A frame of another MainDevice has come: as ACTIVE a collision (protocol MR-10), reported once for frames that
    /// follow each other. Out of line: it would cost the reception of own frames registers.
    #[cold]
    #[inline(never)]
    pub(in crate::exchange) fn note_foreign(&mut self, arrived_on: Link, bytes: &[u8]) {
        if let Some(source) = bytes.get(6..).and_then(<[u8]>::first_chunk) {
            self.note_collision(arrived_on, MacAddress(*source));
        }
        if let (Some(state), Some(header)) = (self.standby.0.as_deref_mut(), header_of_frame(bytes)) {
            state.collided_write = header.write;
        }
    }

    /// As [`Exchange::note_foreign`], for a frame that the acyclic half has received.
    pub(super) fn note_acyclic_collision(&mut self) {
        let Some(state) = self.standby.0.as_deref() else { return };
        if let Some((arrived_on, source)) = state.words.take_collision()
            && self.cycle >= state.acyclic_counts_from
        {
            self.note_collision(arrived_on, source);
        }
    }

    fn note_collision(&mut self, arrived_on: Link, source: MacAddress) {
        let now = self.cycle + 1;
        let Some(state) = self.standby.0.as_deref_mut().filter(|it| it.role == MainDeviceRole::Active) else { return };
        let last = core::mem::replace(&mut state.foreign_in, now);
        state.collided_with = Some(source);
        if last == 0 || now - last > APART {
            state.collided_write = None;
            self.events.push(CyclicStandbyEvent::Collision { arrived_on, source }.pack());
        }
    }
}

impl State {
    /// Evaluates what the last cycle has brought back.
    fn evaluate(&mut self, board: &Board, events: &mut Producer) {
        let returned = self.frames.returned();
        let own = self.frames.header.least;
        match returned.answer {
            Some(answer) => {
                let found = (answer.version < own).then_some((answer.version, own));
                self.report_version(found, events);
            }
            None if returned.unreadable.is_some() => {
                self.report_version(returned.unreadable, events);
            }
            None => {}
        }
        if let Some(partner) = self.watch.note(&returned) {
            events.push(CyclicStandbyEvent::Partner(partner).pack());
        }
        if let Some(answer) = returned.answer {
            compare(&mut self.items, (answer.identity, answer.item), events);
        }
        if self.frames.header.phase == Phase::Offers {
            self.offer(&returned, events);
        }
        self.post_readiness(self.reasons_of_active(board), events);
    }

    /// `found`: version of the other MainDevice, and the oldest one that could read the newer of both; `None` if each
    /// reads the other. A version that was found is reported once; true if there is one.
    pub(super) fn report_version(&mut self, found: Option<(u8, u8)>, events: &mut Producer) -> bool {
        let version = found.map(|(got, _)| got);
        let is_new = core::mem::replace(&mut self.other_version, version) != version;
        if let Some((got, least)) = found.filter(|_| is_new) {
            events.push(CyclicStandbyEvent::OtherVersion { got, least }.pack());
        }
        found.is_some()
    }

    /// The role is offered: the next cycle is the last one if the other MainDevice takes it.
    fn offer(&mut self, returned: &Returned, events: &mut Producer) {
        let is_accepted = returned.is_taken && returned.answer.is_some_and(|answer| answer.stage == Stage::Accepts);
        self.offered = self.offered.saturating_add(1);
        if let Some(write) = self.words.write().filter(|_| !self.is_forced) {
            // It has begun since the request.
            self.frames.header.phase = Phase::Goes;
            events.push(CyclicStandbyEvent::RoleRefused(write).pack());
        } else if is_accepted {
            self.frames.header.phase = Phase::Ends;
        } else if self.offered >= PATIENCE {
            self.frames.header.phase = Phase::Goes;
            events.push(CyclicStandbyEvent::HandOverRefused(self.watch.partner()).pack());
        }
    }

    /// Begins to offer the role. An offer that was made stays as it is: after its last cycle this MainDevice yields.
    pub(super) fn begin_offer(&mut self, events: &mut Producer) {
        if self.frames.header.phase != Phase::Goes {
            return;
        }
        let partner = self.watch.partner();
        if self.offers == Offers::Possible && matches!(partner, Partner::Alive { .. }) && partner.is_ready() {
            (self.offered, self.frames.header.phase) = (0, Phase::Offers);
        } else {
            events.push(CyclicStandbyEvent::HandOverRefused(partner).pack());
        }
    }

    /// The role is not offered any more, unless the last cycle of this MainDevice has gone.
    pub(super) fn withdraw_offer(&mut self) {
        if self.frames.header.phase == Phase::Offers {
            self.frames.header.phase = Phase::Goes;
        }
    }
}

impl State {
    /// Posts the reasons of this cycle, and reports them when they have changed.
    pub(super) fn post_readiness(&mut self, reasons: NotReady, events: &mut Producer) {
        self.control.post_readiness(reasons);
        if let Some(reasons) = self.readiness.note(reasons) {
            events.push(CyclicStandbyEvent::Readiness(reasons).pack());
        }
    }

    /// The reasons that the ACTIVE knows: its own, and those of the other MainDevice.
    pub(super) fn reasons_of_active(&self, board: &Board) -> NotReady {
        let is_down = |link: &Link| board.live.carrier(*link) == Some(false);
        // A MainDevice that is to stay INACTIVE may be ACTIVE on request: its own role is no reason.
        let own = NotReady(self.control.not_ready()).with(NotReady::HELD, false);
        let own = own.with(NotReady::LINK, Link::ALL.iter().any(is_down) || own.has(NotReady::LINK));
        let own = own.with(NotReady::VERSION, self.other_version.is_some());
        let of_other = match self.watch.partner() {
            Partner::Absent => NotReady::ABSENT,
            Partner::Forwards => NotReady::NO_ANSWER,
            Partner::Alive { not_ready, .. } => not_ready,
        };
        NotReady(own.0 | of_other.0)
    }
}

/// Compares the configuration of the other MainDevice with the own one.
pub(super) fn compare(
    items: &mut Items,
    (identity, item): (u64, ringcat_wire::master_frame::Item),
    events: &mut Producer,
) {
    match items.compare(identity, item) {
        Some(Difference::Item(number)) => {
            events.push(CyclicStandbyEvent::Item(number).pack());
        }
        Some(Difference::Count { here, there }) => {
            events.push(CyclicStandbyEvent::Count { here, there }.pack());
        }
        None => {}
    }
}
