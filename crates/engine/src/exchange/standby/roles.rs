//! Changes of the role, at the beginning of a cycle (protocol MR-02, MR-07).

use ringcat_wire::master_frame::{Answer, Header, Phase};

use super::Exchange;
use super::readiness::ReadinessWatch;
use super::state::State;
use crate::board::Board;
use crate::board::live::Presence;
use crate::board::standby::Takeover;
use crate::domain::DomainStatus;
use crate::event::CyclicStandbyEvent;
use crate::exchange::domain::Domain;
use crate::exchange::flight::CyclicFrame;
use crate::link::Link;
use crate::queue::Producer;
use crate::role::{MainDeviceRole, RoleCause, RoleRequest, Taken};
use crate::time::Instant;

/// Acyclic frames of the ACTIVE before may be read for this time after it has handed its role over.
const LAST_FRAMES_NS: u64 = 100_000_000;

/// What the beginning of a cycle does to the role.
enum Change {
    None,
    ToActive(RoleCause),
    ToInactive(RoleCause),
}

impl Exchange {
    /// A cycle begins: a requested role takes effect. As INACTIVE the images then show the last whole cycle of the
    /// ACTIVE. Returns the role if it has changed. The first step of a cycle, before domains are processed; without
    /// MainDevice redundancy it does nothing.
    #[inline(always)]
    pub fn begin_role(&mut self, now: Instant) -> Option<MainDeviceRole> {
        if self.standby.0.is_some() { self.begin_role_of_two(now) } else { None }
    }

    #[inline(never)]
    fn begin_role_of_two(&mut self, now: Instant) -> Option<MainDeviceRole> {
        self.note_acyclic_collision();
        let state = self.standby.0.as_deref_mut()?;
        let request = if state.control.is_requested() { state.permitted_request(now, &mut self.events) } else { None };
        let change = match state.role {
            MainDeviceRole::Active => {
                match request {
                    Some(RoleRequest::HandOver) => state.begin_offer(&mut self.events),
                    Some(RoleRequest::Active | RoleRequest::Withdraw) => state.withdraw_offer(),
                    Some(RoleRequest::Inactive) | None => {}
                }
                let is_down = |link: &Link| self.board.live.carrier(*link) == Some(false);
                let is_alone = state.yields_without_links && Link::ALL.iter().all(is_down);
                match request {
                    _ if state.frames.header.phase == Phase::Ends => Change::ToInactive(RoleCause::HandedOver),
                    Some(RoleRequest::Inactive) => Change::ToInactive(RoleCause::Requested),
                    _ if is_alone => Change::ToInactive(RoleCause::LinksLost),
                    Some(RoleRequest::Active | RoleRequest::Withdraw | RoleRequest::HandOver) | None => Change::None,
                }
            }
            MainDeviceRole::Inactive => match request {
                _ if state.is_handed_over(now) => Change::ToActive(RoleCause::HandedOver),
                Some(RoleRequest::Active) => Change::ToActive(RoleCause::Requested),
                Some(RoleRequest::Inactive | RoleRequest::HandOver | RoleRequest::Withdraw) | None => Change::None,
            },
        };
        state.begun_at = now;
        let (role, cause) = match change {
            Change::None if state.role == MainDeviceRole::Inactive => {
                self.follow_cycle(now);
                return None;
            }
            Change::None => return None,
            Change::ToActive(cause) => (MainDeviceRole::Active, cause),
            Change::ToInactive(cause) => (MainDeviceRole::Inactive, cause),
        };
        let event = CyclicStandbyEvent::RoleChanged(role, cause);
        self.events.push(event.pack());
        match role {
            MainDeviceRole::Active => self.take_over(now, cause),
            MainDeviceRole::Inactive => self.yield_role(now),
        }
        Some(role)
    }

    /// This MainDevice controls the bus from this cycle on, with the outputs and inputs that the other one had, or with
    /// its own last ones.
    fn take_over(&mut self, now: Instant, cause: RoleCause) {
        let left = self.cycle + 1;
        let Some(state) = self.standby.0.as_deref_mut() else { return };
        let last = state.following.newest();
        state.show_whole(&mut self.domains, left);
        if state.outputs.has_any() {
            let outputs = &state.outputs;
            let images = self.domains.iter_mut().map(Domain::image_mut);
            images.enumerate().for_each(|(domain, image)| outputs.go_on(domain, image));
        }
        let takeover = state.takeover();
        let in_state = match takeover {
            Takeover::ThroughInit => 0,
            Takeover::FromOther => {
                // The role may change before the first cycle as INACTIVE.
                state.post_whole(&self.board);
                state.take_part(&self.board)
            }
            Takeover::FromItself => settled(&self.board),
        };
        self.board.live.end_silence();
        state.words.post_takeover(takeover);
        let silence = last.map(|(_, at)| now.since(at));
        let cut = last.and_then(|(cycle, _)| state.following.header_of(cycle)).and_then(|(header, _)| header.write);
        if let Some((cycle, _)) = last {
            state.frames.cycle = cycle;
        }
        state.frames.header.phase = Phase::Goes;
        let last_frames = if cause == RoleCause::HandedOver { LAST_FRAMES_NS } else { 0 };
        state.acyclic_counts_from = left + last_frames.div_ceil(state.period_ns.max(1));
        state.become_role(MainDeviceRole::Active);
        let is_hot = takeover != Takeover::ThroughInit;
        self.events.push(CyclicStandbyEvent::TookOver { silence, in_state, is_hot, cut }.pack());
    }

    /// The other MainDevice may control the bus from this cycle on: nothing is sent any more.
    fn yield_role(&mut self, now: Instant) {
        let left = self.cycle + 1;
        let Some(state) = self.standby.0.as_deref_mut() else { return };
        self.frames.iter_mut().for_each(CyclicFrame::close);
        self.again.iter_mut().flatten().for_each(|again| again.frame.close());
        for (number, domain) in self.domains.iter_mut().enumerate() {
            let status = DomainStatus { pending: false, ..domain.status(false) };
            domain.follow(status, left, |_| false);
            state.outputs.forget();
            state.outputs.set(number, domain.image());
        }
        self.decide_at = Instant::NEVER;
        state.following.reset();
        state.left_at = Some(now);
        state.frames.end();
        state.become_role(MainDeviceRole::Inactive);
    }
}

impl State {
    fn become_role(&mut self, role: MainDeviceRole) {
        self.role = role;
        self.watch.forget();
        self.readiness = ReadinessWatch::default();
        (self.foreign_in, self.collided_with, self.collided_write) = (0, None, None);
        (self.shown, self.noticed) = (None, None);
        let (identity, item) = (self.following.answer.identity, self.items.first());
        self.following.answer = Answer { identity, item, ..Answer::new() };
        self.control.set(role);
    }

    /// Takes the request. One that would cut off a write into the memory of a SubDevice is refused, if it is not
    /// forced: the own write as ACTIVE, that of an ACTIVE which goes on as INACTIVE.
    #[cold]
    fn permitted_request(&mut self, now: Instant, events: &mut Producer) -> Option<RoleRequest> {
        let Taken { request, is_forced, holds } = self.control.take_request()?;
        let is_offered = self.role == MainDeviceRole::Active && self.frames.header.phase != Phase::Goes;
        if is_offered && request == RoleRequest::HandOver {
            // The hand-over is under way; this request may force it.
            self.is_forced |= is_forced;
            return None;
        }
        self.is_forced = is_forced;
        let write = match (self.role, request) {
            _ if is_forced => None,
            (MainDeviceRole::Active, RoleRequest::Inactive | RoleRequest::HandOver) => self.words.write(),
            (MainDeviceRole::Inactive, RoleRequest::Active) => self.words.partner_write(now),
            (MainDeviceRole::Active, RoleRequest::Active)
            | (_, RoleRequest::Withdraw)
            | (MainDeviceRole::Inactive, RoleRequest::Inactive | RoleRequest::HandOver) => None,
        };
        let Some(write) = write else {
            if holds {
                self.control.hold(true);
            }
            return Some(request);
        };
        events.push(CyclicStandbyEvent::RoleRefused(write).pack());
        None
    }

    /// What this MainDevice goes on with as ACTIVE. SubDevices stay as they are only if their registers are those of
    /// this configuration; otherwise they are configured again from INIT on, which is a warm takeover (protocol MR-18).
    fn takeover(&self) -> Takeover {
        let (own, frame_at) = (&self.frames.header, self.words.partner_frame_at());
        let is_same = |other: &Header| other.identity == own.identity && other.session == own.session;
        match self.following.whole() {
            _ if self.goes_through_init => Takeover::ThroughInit,
            Some(whole) if is_same(&whole.header) => Takeover::FromOther,
            // A frame that arrived at the time of the change counts: it may be a frame of another ACTIVE.
            None if self.left_at.is_some_and(|left| frame_at.is_none_or(|at| at < left)) => Takeover::FromItself,
            _ => Takeover::ThroughInit,
        }
    }

    /// Whether the ACTIVE has ended with the newest cycle, in which this MainDevice has accepted its role.
    pub(super) fn is_handed_over(&self, now: Instant) -> bool {
        let Some((cycle, begun_at)) = self.following.newest() else { return false };
        let is_due = now.since(begun_at).as_nanos() >= u128::from(self.period_ns / 2);
        self.noticed == Some(cycle) && is_due && self.ends_with(cycle)
    }

    /// Whether the ACTIVE ends with a cycle, and hands its role over.
    pub(super) fn ends_with(&self, cycle: u32) -> bool {
        let header = self.following.header_of(cycle);
        header.is_some_and(|(header, _)| header.phase == Phase::Ends) && self.following.has_accepted(cycle)
    }
}

/// Number of SubDevices in their target states.
fn settled(board: &Board) -> u16 {
    let lives = (0..board.live.count()).filter_map(|subdevice| board.live.life(subdevice));
    lives.filter(|life| life.presence == Presence::Settled).count() as u16
}
