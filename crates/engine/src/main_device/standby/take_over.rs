//! The acyclic half follows the role that the cyclic half has taken: it adopts a running bus, or ends all that runs
//! (protocol MR-16, MR-17).

use alloc::rc::Rc;
use alloc::vec::Vec;

use core::time::Duration;

use ringcat_wire::al::AlState;
use ringcat_wire::frame::MacAddress;
use ringcat_wire::master_frame::NotReady;
use ringcat_wire::memory_write::{MemoryWrite, WriteKind};

use crate::board::live::{Life, Presence};
use crate::board::standby::Takeover;
use crate::declared::{Address, SubDeviceId};
use crate::event::{Event, StandbyEvent};
use crate::knowledge::{Handover, KnownMailbox};
use crate::link::Link;
use crate::mail::InUse;
use crate::main_device::MainDevice;
use crate::main_device::standby::Collision;
use crate::procedures::error_statistics::ErrorStatistics;
use crate::procedures::shared_segment::SegmentData;
use crate::role::{MainDeviceRole, Partner, RoleCause, RoleRequest, Taken};
use crate::segment::clocks::ClockObservation;
use crate::segment::member::{MemberView, Phase};
use crate::segment::setup::Setup;
use crate::segment::unassigned::UnassignedView;
use crate::segment::{Observation, StandbyObservation};
use crate::time::Instant;

/// After this time without frames of another ACTIVE, the next one is a new collision.
const COLLISIONS_APART: Duration = Duration::from_millis(100);
/// Readiness expires after this time and this number of periods without a cycle.
const STOPPED_AFTER: Duration = Duration::from_millis(100);
const STOPPED_CYCLES: u32 = 4;
/// Interval at which SubDevices in BOOT are searched.
const BOOT_EACH: Duration = Duration::from_millis(10);

impl MainDevice {
    /// Follows a change of the role, and publishes what the other MainDevice needs. Without an application, requested
    /// roles take effect here.
    pub(in crate::main_device) fn follow_role(&mut self, now: Instant) {
        if self.standby.is_none() {
            return;
        }
        if let Some((arrived_on, source)) = self.supervisor.take_foreign() {
            self.note_foreign(arrived_on, source, now);
        }
        if self.active().is_none() {
            self.report_version(now);
            self.take_request(now);
        } else if self.role_followed != self.roles.changes() {
            self.role_followed = self.roles.changes();
            match self.role() {
                MainDeviceRole::Active => self.take_over(),
                MainDeviceRole::Inactive => self.yield_bus(now),
            }
            self.supervisor.poll(now);
        }
        self.watch_cycles(now);
        self.post_memory_write(now);
        self.publish_knowledge(now);
    }

    /// Readiness is determined in cycles: without any, for some time, it says so.
    fn watch_cycles(&mut self, now: Instant) {
        let running = self.active().map(|segment| {
            let view = segment.view();
            let period = view.layout().home().map_or(Duration::ZERO, |home| view.layout().domains[home].period);
            (segment.board.cycles(), STOPPED_AFTER + STOPPED_CYCLES * period)
        });
        let Some(standby) = &mut self.standby else { return };
        let Some((cycles, limit)) = running else {
            if !self.roles.readiness().has(NotReady::NO_APPLICATION) {
                self.roles.post_readiness(NotReady::NO_APPLICATION);
            }
            return;
        };
        if standby.cycles_at.0 != cycles {
            standby.cycles_at = (cycles, now);
        } else if now.since(standby.cycles_at.1) >= limit {
            self.roles.post_readiness(NotReady::STOPPED);
        }
    }

    /// Posts a write into the memory of a SubDevice that is under way: the role is not given up meanwhile.
    fn post_memory_write(&mut self, now: Instant) {
        let write = self.supervisor.memory_write();
        let is_due = self.standby.as_ref().is_some_and(|standby| now >= standby.boot_at);
        let in_boot = if is_due { self.in_boot() } else { None };
        let Some(standby) = &mut self.standby else { return };
        if is_due {
            standby.boot_at = now + BOOT_EACH;
            standby.in_boot = in_boot;
        }
        standby.words.post_write(write.or(standby.in_boot));
    }

    /// A write into the memory of a SubDevice that a change of the role would cut off now.
    pub fn memory_write_under_way(&self) -> Option<MemoryWrite> {
        self.supervisor.memory_write().or_else(|| self.in_boot())
    }

    /// A SubDevice that is in BOOT, or is to be.
    fn in_boot(&self) -> Option<MemoryWrite> {
        let (view, live) = (self.segment.view(), &self.segment.board.live);
        let is_in_boot =
            |index: usize| live.life(index).is_some_and(|life| life.al_status & 0x0F == AlState::Boot as u8);
        let boots = |(index, member): &(usize, MemberView<'_>)| {
            (member.target == AlState::Boot && member.phase != Phase::Absent) || is_in_boot(*index)
        };
        if let Some((index, _)) = view.members().enumerate().find(boots) {
            return Some(Address::from(SubDeviceId(index)).memory_write(WriteKind::Boot));
        }
        let boots = |it: &UnassignedView<'_>| it.upkeep.as_ref().is_some_and(|upkeep| upkeep.target == AlState::Boot);
        let undeclared = view.subdevices().unassigned().find(boots)?;
        let position = undeclared.knowledge.info().map(|info| info.position);
        Some(match position {
            Some(position) => Address::from(position).memory_write(WriteKind::Boot),
            None => MemoryWrite::new(WriteKind::Boot, true, usize::MAX),
        })
    }

    /// A requested role takes effect: there is no application whose cycles could take it.
    fn take_request(&mut self, now: Instant) {
        let Some(Taken { request, is_forced, holds }) = self.roles.take_request() else { return };
        let role = match request {
            RoleRequest::Active => MainDeviceRole::Active,
            RoleRequest::Inactive => MainDeviceRole::Inactive,
            // Without an application nothing is offered.
            RoleRequest::Withdraw => return,
            RoleRequest::HandOver => {
                let event = Event::Standby(StandbyEvent::HandOverRefused(Partner::Absent));
                return self.supervisor.append_event(now, event);
            }
        };
        if role == self.role() {
            return self.hold_if(holds);
        }
        let write = match role {
            MainDeviceRole::Inactive => self.memory_write_under_way(),
            // The listener of the other MainDevice's frames, in whatever thread it is, has read it.
            MainDeviceRole::Active => self.standby.as_ref().and_then(|standby| standby.words.partner_write(now)),
        };
        if let Some(write) = write.filter(|_| !is_forced) {
            let event = Event::Standby(StandbyEvent::RoleRefused(write));
            self.supervisor.append_event(now, event);
        } else {
            self.hold_if(holds);
            self.set_role(role);
            let event = StandbyEvent::RoleChanged { role, cause: RoleCause::Requested };
            self.supervisor.append_event(now, Event::Standby(event));
        }
    }

    /// Permanent standby begins with a request that was not refused.
    fn hold_if(&self, holds: bool) {
        if holds {
            self.roles.hold(true);
        }
    }

    /// A frame of another MainDevice has come while this one is ACTIVE: a collision (protocol MR-10). Without an
    /// application it is reported once for frames that follow each other; with one the cyclic half reports it.
    fn note_foreign(&mut self, arrived_on: Link, source: MacAddress, now: Instant) {
        if self.role() != MainDeviceRole::Active {
            return;
        }
        let has_application = self.active().is_some();
        let Some(standby) = &mut self.standby else { return };
        if has_application {
            return standby.words.post_collision(arrived_on, source);
        }
        let last = standby.collision.replace(Collision { at: now, source: Some(source) });
        if last.is_none_or(|last| now.since(last.at) > COLLISIONS_APART) {
            let event = Event::Standby(StandbyEvent::Collision { arrived_on, source });
            self.supervisor.append_event(now, event);
        }
    }

    /// Takes the source address of a frame of another MainDevice that came since the last call, while this one is
    /// ACTIVE without an application. With an application, use
    /// [`Exchange::take_collision`](crate::exchange::Exchange::take_collision). Bytes 3 to 5 are those of the main
    /// interface of the other MainDevice.
    pub fn take_collision(&mut self) -> Option<MacAddress> {
        self.standby.as_mut()?.collision.as_mut()?.source.take()
    }

    /// The exchange goes on with the process data of the other MainDevice, or with its own. After a hot takeover the
    /// SubDevices stay as they are: none goes through INIT, no address and no register of SyncManagers or FMMUs is
    /// written. What was known is compared with the segment meanwhile; the first mail of each mailbox is as after a
    /// crash of its owner.
    fn take_over(&mut self) {
        let events = self.supervisor.take_events();
        // The mirror of the other MainDevice ends.
        self.renew(events);
        let lives = self.lives();
        let takeover = self.standby.as_ref().map_or(Takeover::ThroughInit, |standby| standby.words.takeover());
        self.learn_clocks(takeover);
        self.adopt_mailboxes(&lives);
        let is_hot = takeover != Takeover::ThroughInit;
        let is_of_other = takeover == Takeover::FromOther;
        let took_over = StandbyObservation::TookOver { lives: &lives, is_of_other, is_hot };
        self.segment.observe(Observation::Standby(took_over));
        let segment = self.segment.clone();
        self.start_reconcile(segment);
    }

    /// Another MainDevice controls the bus: all procedures end. What is known of the segment stays.
    fn yield_bus(&mut self, now: Instant) {
        self.counted = self.counters();
        self.number_cyclic_events(now);
        let events = self.supervisor.take_events();
        self.requests.end();
        self.ports.clear();
        self.gateway_queue = None;
        self.renew(events);
        self.segment.observe(Observation::Standby(StandbyObservation::Yielded));
        self.begin_mirror();
    }

    /// Another supervisor with the model as it is.
    fn renew(&mut self, events: crate::event::EventLog) {
        let now = self.supervisor.bus().now();
        self.renew_supervisor(events, now);
        let (bus, board) = (self.supervisor.bus(), self.segment.board.clone());
        let count = self.segment.view().members().count();
        let mailboxes = (0..count).map(|index| self.new_mailbox(SubDeviceId(index))).collect();
        let statistics = ErrorStatistics::new(&bus, count, self.statistics_period);
        self.statistics = Some(statistics.clone());
        let data = SegmentData { mailboxes, cache: self.cache.clone(), statistics };
        self.segment = self.segment.without_application(&bus).with_application(&bus, board.clone(), data);
        self.supervisor.attach(board);
        self.supervisor.attach_request_counter(self.requests.request_counter().clone());
    }

    /// The SubDevices as the previous ACTIVE has seen them last.
    fn lives(&self) -> Vec<Life> {
        let live = &self.segment.board.live;
        (0..live.count()).map(|subdevice| live.life(subdevice).unwrap_or_default()).collect()
    }

    /// The last measurement of the clocks by the previous ACTIVE.
    fn learn_clocks(&self, takeover: Takeover) {
        let knowledge = match takeover {
            Takeover::FromItself => self.published_knowledge(),
            Takeover::FromOther | Takeover::ThroughInit => self.partner_knowledge(),
        };
        let known = knowledge.and_then(|knowledge| knowledge.clocks);
        if let Some(known) = known.filter(|_| self.segment.view().clocks().are_declared()) {
            self.segment.observe_clocks(ClockObservation::Known(Rc::new(known)));
        }
    }

    /// Uses the mailboxes that the other MainDevice has used.
    fn adopt_mailboxes(&self, lives: &[Life]) {
        for (index, life) in lives.iter().enumerate() {
            let is_there = life.presence != Presence::Offline;
            let has_left_init =
                life.al_status & 0x0F >= AlState::PreOp as u8 && life.al_status & 0x0F != AlState::Boot as u8;
            let (station, setup) = {
                let view = self.segment.view();
                let Some(member) = view.member(index) else { continue };
                (member.station, member.setup.clone())
            };
            let Some(setup) = setup.filter(|_| is_there && has_left_init) else { continue };
            if let (Some(in_use), Some(mailbox)) = (in_use(station, &setup), self.segment.mailbox(index)) {
                mailbox.adopt(in_use, &KnownMailbox::default(), Handover::AfterCrash);
            }
        }
    }
}

/// The mailbox of a SubDevice with a configuration. It may have mail.
fn in_use(station: ringcat_wire::address::StationAddress, setup: &Setup) -> Option<InUse> {
    let layout = setup.plan.mailbox_layout()?;
    let [_, send] = &setup.plan.mailbox[..] else { return None };
    Some(InUse { station, layout, send_manager: send.index, is_full: true })
}
