//! The exchange of the INACTIVE: what it takes from the frames that it forwards, and what its images show.

use ringcat_wire::master_frame::{Diagnosis, DomainRecord, NotReady, SubDeviceRecord, is_master_frame};

use super::Exchange;
use super::state::State;
use crate::board::Supervision;
use crate::board::live::{Life, Presence};
use crate::board::{Board, RingWord};
use crate::domain::{DomainState, DomainStatus};
use crate::exchange::domain::Domain;
use crate::exchange::following::Unusable;
use crate::link::Link;
use crate::ring::{Class, RingState, Sequence, foreign_frame, identity::class_of};
use crate::role::MainDeviceRole;
use crate::time::Instant;
use ringcat_wire::address::Wkc;

/// Periods without a whole cycle after which this MainDevice does not count as one that follows.
const WHOLE_WITHIN: u64 = 4;

impl Exchange {
    /// Works on a received frame of another MainDevice before it is forwarded: takes and fills master frames (protocol
    /// FR-08). Any bytes are allowed. As ACTIVE nothing happens. Frames of the acyclic class are for
    /// [`MainDevice::fill`](crate::main_device::MainDevice::fill).
    pub fn fill(&mut self, arrived_on: Link, frame: &mut [u8], now: Instant) {
        if let Some(state) = self.standby.0.as_deref_mut()
            && state.role == MainDeviceRole::Inactive
        {
            state.words.post_partner_frame(now);
            state.following.fill(arrived_on, frame, now, state.data.outgoing(MainDeviceRole::Inactive));
            if state.following.take_anew() {
                state.outputs.forget();
            }
        }
    }

    /// Works on the same frame after it was forwarded: takes outputs (protocol FR-05).
    pub fn take_forwarded(&mut self, frame: &[u8]) {
        let Some(state) = self.standby.0.as_deref_mut().filter(|it| it.role == MainDeviceRole::Inactive) else {
            return;
        };
        if class_of(frame) != Some(Class::Cyclic) {
            return;
        }
        let Some((sender, sequence)) = foreign_frame(frame) else { return };
        // Before the first master frame nothing is known of the sender.
        if state.following.sender().is_some_and(|followed| followed != sender) {
            return;
        }
        if !is_master_frame(frame) {
            state.outputs.take(frame, sequence);
        } else if let Some((cycle, _)) = state.following.newest()
            && let Some((header, _)) = state.following.header_of(cycle)
        {
            state.outputs.end_cycle(Sequence::of_frame(header.first.into()), header.frames);
        }
    }

    /// A cycle of the INACTIVE begins: its images and words show the last whole cycle of the ACTIVE.
    pub(super) fn follow_cycle(&mut self, now: Instant) {
        let left = self.cycle + 1;
        let Some(state) = self.standby.0.as_deref_mut() else { return };
        state.note_readiness(&self.board, now, &mut self.events);
        state.noticed = state.following.newest().map(|(cycle, _)| cycle);
        for (number, domain) in self.domains.iter_mut().enumerate() {
            state.outputs.show(number, domain.image_mut());
        }
        if state.following.whole().is_some_and(|whole| state.shown != Some(whole.cycle)) {
            state.show_whole(&mut self.domains, left);
            state.post_whole(&self.board);
        }
        self.board.traffic.post_departure(self.cycle);
        self.cycle += 1;
        self.board.post_cycle(self.cycle, self.tally.counters.sent);
    }
}

impl State {
    /// Whether this MainDevice could take over, for the answer.
    fn note_readiness(&mut self, board: &Board, now: Instant, events: &mut crate::queue::Producer) {
        let limit = self.period_ns.saturating_mul(WHOLE_WITHIN);
        let whole = self.following.whole();
        let is_late = whole.is_none_or(|whole| now.since(whole.at).as_nanos() > u128::from(limit));
        if is_late {
            board.post_no_active();
        }
        let header = whole.map(|whole| whole.header);
        let is_down = |link: &Link| board.live.carrier(*link) == Some(false);
        let is_other = header.is_some_and(|header| !self.items.is_same(header.identity));
        let is_elsewhere = header.is_some_and(|header| header.session != self.frames.header.session)
            || matches!(self.following.unusable, Some(Unusable::Lengths(_)));
        let not_ready = NotReady(self.control.not_ready())
            .with(NotReady::NO_CYCLE, is_late)
            .with(NotReady::IDENTITY, is_other)
            .with(NotReady::LAYOUT, is_elsewhere)
            .with(NotReady::LINK, Link::ALL.iter().any(is_down));
        let of_version = self.note_version(events);
        let not_ready = not_ready.with(NotReady::VERSION, of_version);
        self.following.answer.not_ready = not_ready;
        self.post_readiness(not_ready, events);
        self.following.answer.item = self.items.next();
        let newest = self.following.newest().and_then(|(cycle, _)| self.following.header_of(cycle));
        if let Some((header, _)) = newest {
            super::active::compare(&mut self.items, (header.identity, header.item), events);
        }
    }

    /// Whether one of both MainDevices cannot read the master frames of the other one, which is reported once.
    fn note_version(&mut self, events: &mut crate::queue::Producer) -> bool {
        let newest = self.following.newest().and_then(|(cycle, _)| self.following.header_of(cycle));
        let own = self.following.answer.least;
        let found = match (self.following.unusable, newest) {
            (Some(Unusable::Version { least, got }), _) => Some((got, least)),
            (_, Some((header, _))) => (header.version < own).then_some((header.version, own)),
            _ => return self.other_version.is_some(),
        };
        self.report_version(found, events)
    }

    /// Puts inputs and states of domains of the last whole cycle into the images.
    pub(super) fn show_whole(&mut self, domains: &mut [Domain], left: u64) {
        let Some(whole) = self.following.whole() else { return };
        self.shown = Some(whole.cycle);
        for run in &self.runs {
            let from = whole.content.inputs.get(run.offset..run.offset + run.length);
            let image = domains.get_mut(run.domain.0).map(Domain::image_mut);
            let to = image.and_then(|image| image.get_mut(run.image_offset..run.image_offset + run.length));
            if let (Some(from), Some(to)) = (from, to) {
                to.copy_from_slice(from);
            }
        }
        let from_partner = self.data.incoming_mut(MainDeviceRole::Inactive);
        from_partner.iter_mut().zip(&whole.content.to_inactive).for_each(|(to, from)| *to = *from);
        let records = whole.content.diagnosis.get(Diagnosis::LEN..).unwrap_or_default();
        let has_inputs = !self.runs.is_empty();
        let is_fresh = |subdevice: usize| has_inputs && record(&whole.content.subdevices, subdevice).is_fresh();
        for (domain, bytes) in domains.iter_mut().zip(records.chunks_exact(DomainRecord::LEN)) {
            let DomainRecord { state, wkc, expected } = DomainRecord::decode(bytes).unwrap_or_default();
            let state = match state {
                0 => DomainState::Zero,
                1 => DomainState::Incomplete,
                _ => DomainState::Complete,
            };
            let returned = state != DomainState::Zero;
            domain.follow(DomainStatus { wkc, expected, state, returned, ..DomainStatus::default() }, left, is_fresh);
        }
    }

    /// Posts what the last whole cycle contains about SubDevices, ring and links.
    pub(super) fn post_whole(&self, board: &Board) {
        let Some(whole) = self.following.whole() else { return };
        for (subdevice, byte) in whole.content.subdevices.iter().enumerate() {
            let record = SubDeviceRecord(*byte);
            let presence = match (record.answers(), record.is_settled()) {
                (false, _) => Presence::Offline,
                (true, false) => Presence::Configuring,
                (true, true) => Presence::Settled,
            };
            board.live.post_life(subdevice, Life { presence, al_status: record.al_status(), code: 0 });
        }
        let Ok(diagnosis) = Diagnosis::decode(&whole.content.diagnosis) else { return };
        let state = match diagnosis.ring {
            1 => RingState::Closed,
            2 => RingState::Open,
            _ => RingState::Unknown,
        };
        board.post_ring(RingWord { state, ..RingWord::default() });
        let [main, redundant] = diagnosis.answering.map(Wkc);
        let seen = Supervision { main, redundant, al_status: diagnosis.al_states, irq: 0, returned: true };
        board.post_supervision(seen.pack());
    }

    /// Which SubDevices take part in process data when this MainDevice goes on; their number.
    pub(super) fn take_part(&self, board: &Board) -> u16 {
        let Some(whole) = self.following.whole() else { return 0 };
        let mut count = 0;
        for (subdevice, lowest) in self.exchanges_from.iter().enumerate() {
            let record = record(&whole.content.subdevices, subdevice);
            let state = record.al_status() & 0x0F;
            let takes_part = record.answers() && *lowest != 0 && state >= *lowest;
            board.set_unproven(subdevice, false);
            board.set_taking_part(subdevice, takes_part);
            count += u16::from(record.answers() && record.is_settled());
        }
        count
    }
}

/// The state of a SubDevice; absent if there is none.
fn record(records: &[u8], subdevice: usize) -> SubDeviceRecord {
    SubDeviceRecord(records.get(subdevice).copied().unwrap_or_default())
}
