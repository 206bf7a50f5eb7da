//! MainDevice redundancy: the role, what has arrived from the other MainDevice, and what it needs of this one.

use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::al::AlState;
use ringcat_wire::frame::MAX_FRAME;
use ringcat_wire::master_frame::NotReady;

use super::identity::Configuration;
use crate::board::standby::KNOWLEDGE_ROOM;
use crate::declared::SubDeviceId;
use crate::direction::Direction;
use crate::event::{Event, StandbyEvent};
use crate::exchange::{Exchange, StandbySetup};
use crate::knowledge::Knowledge;
use crate::layout::{Layout, LayoutError, LrwPolicy, PlannedMasterFrames};
use crate::link::LinkSet;
use crate::main_device::MainDevice;
use crate::main_device::activate::activate_error::ActivateError;
use crate::main_device::activate::prepare::watchdog_of;
use crate::main_device::declaration::Declaration;
use crate::main_device::standby::Marks;
use crate::role::{MainDeviceRole, RoleControl};
use crate::segment::SubDevices;
use crate::segment::member::MemberView;
use crate::time::Instant;

/// Shortest time between two publications of the knowledge.
const PUBLISHED_EACH: Duration = Duration::from_millis(200);
/// Knowledge that has not changed in what is compared is made again after this time.
const PUBLISHED_AGAIN: Duration = Duration::from_secs(5);

impl MainDevice {
    /// The role, and requests for another one: for any thread.
    pub fn role_control(&self) -> RoleControl {
        self.roles.clone()
    }

    /// Session and digest of the configuration of the ACTIVE; `None` before a frame of it.
    pub fn partner_configuration(&self) -> Option<(u16, u64)> {
        self.standby.as_ref()?.words.header()
    }

    /// LRW is not allowed: the INACTIVE takes outputs from frames that have passed SubDevices (protocol REQ047).
    pub(in crate::main_device) fn is_lrw_refused(&self, lrw: LrwPolicy) -> bool {
        self.standby.is_some() && lrw == LrwPolicy::PerSubDevice
    }

    /// Checks memory of the application for process data between both MainDevices.
    pub(in crate::main_device) fn check_partner_memory(&self) -> Result<(), ActivateError> {
        let Some(standby) = self.standby.as_ref().filter(|_| self.options.links() == LinkSet::Ring) else {
            return Ok(());
        };
        let sizes = standby.options.sizes;
        self.memories.check_partner(sizes.to_inactive.max(sizes.to_active).into())
    }

    /// Sets up the exchange for a ring of two MainDevices.
    pub(in crate::main_device) fn set_up_standby(
        &mut self,
        exchange: &mut Exchange,
        (declaration, layout, session): (&Declaration, &Layout, u32),
        subdevices: &SubDevices,
    ) -> Result<(), LayoutError> {
        if self.options.links() != LinkSet::Ring {
            return Ok(());
        }
        let configuration = Configuration::of(declaration, &self.options);
        self.set_ethernet_period(layout.home().map_or(Duration::ZERO, |home| layout.domains[home].period));
        let Some(standby) = &mut self.standby else { return Ok(()) };
        let planned = PlannedMasterFrames::new(standby.options.sizes, layout, subdevices.member_count())?;
        planned.check_time(layout, if standby.options.max_acyclic > 0 { MAX_FRAME } else { 0 })?;
        (standby.configuration, standby.session) = (configuration, Some(session));
        standby.cycles_at = (0, self.supervisor.bus().now());
        (standby.publish_at, standby.published) = ((Instant(0), Instant(0)), None);
        let lowest = |is_op_only: bool| if is_op_only { AlState::Op } else { AlState::SafeOp };
        let exchanges_from: Vec<u8> = subdevices
            .members()
            .map(|member| member.setup.as_ref().map_or(0, |setup| lowest(setup.plan.is_op_only()) as u8))
            .collect();
        exchange.set_up_standby(
            layout,
            StandbySetup {
                planned,
                items: standby.configuration.items(),
                identity: standby.configuration.digest(),
                session: (session % crate::layout::SESSIONS) as u16,
                exchanges_from: exchanges_from.into(),
                yields_without_links: standby.options.yields_without_links,
                goes_through_init: standby.options.goes_through_init,
                control: self.roles.clone(),
                words: standby.words.clone(),
                memory: self.memories.partner.take(),
            },
        );
        Ok(())
    }

    /// Reports what a policy has found before there is an application.
    pub fn report_standby(&mut self, event: StandbyEvent, now: Instant) {
        self.supervisor.append_event(now, Event::Standby(event));
    }

    /// SubDevices with outputs whose watchdog, as declared, is not longer than process data may be missing in a
    /// takeover: each with the time of its watchdog and the time that is needed. `gap`: how long cycles of the period
    /// `cycle` may be missing; in a domain with a longer period outputs may be missing longer, by the difference of the
    /// periods. Empty before there is an application.
    pub fn watchdogs_within(&self, gap: Duration, cycle: Duration) -> Vec<(SubDeviceId, Duration, Duration)> {
        let view = self.segment.view();
        let short = |(index, member): (usize, MemberView<'_>)| {
            let plan = &member.setup.as_ref()?.plan;
            let watched = plan
                .process_data
                .iter()
                .filter(|it| it.direction == Direction::Outputs && it.length > 0 && it.register.control.watchdog);
            let periods = watched.filter_map(|it| {
                let (domain, _) = view.layout().area(index, it.sync_manager)?;
                Some(view.layout().domains.get(domain.0)?.period)
            });
            let needed = gap.saturating_add(periods.max()?.saturating_sub(cycle));
            let watchdog = watchdog_of(&member).filter(|watchdog| *watchdog <= needed)?;
            Some((SubDeviceId(index), watchdog, needed))
        };
        view.members().enumerate().filter_map(short).collect()
    }

    /// Reports each of these SubDevices.
    pub fn report_watchdogs_within(&mut self, gap: Duration, cycle: Duration, now: Instant) {
        let short = self.watchdogs_within(gap, cycle);
        self.roles.set_not_ready(NotReady::WATCHDOG.0, !short.is_empty());
        for (subdevice, watchdog, needed) in short {
            self.report_standby(StandbyEvent::WatchdogTooShort { subdevice, watchdog, needed }, now);
        }
    }

    /// Publishes the knowledge of the segment for the other MainDevice, if it is time.
    pub(in crate::main_device) fn publish_knowledge(&mut self, now: Instant) {
        let Some(standby) = &self.standby else { return };
        let (earliest, latest) = standby.publish_at;
        if now < earliest || self.role() != MainDeviceRole::Active || self.active().is_none() {
            return;
        }
        let marks = self.marks();
        if standby.published == Some(marks) && now < latest {
            return;
        }
        // The INACTIVE needs neither descriptions of objects nor sequence numbers, which change with each frame.
        let knowledge = self.knowledge_without_dictionaries();
        let bytes = knowledge.map(|knowledge| Knowledge { sequence: 0, ..knowledge }.to_bytes()).unwrap_or_default();
        let Some(standby) = &mut self.standby else { return };
        standby.published = Some(marks);
        standby.publish_at = (now + PUBLISHED_EACH, now + PUBLISHED_AGAIN);
        let is_same = standby.words.knowledge.copy().is_some_and(|(_, before)| before == bytes);
        let is_written = is_same || standby.words.knowledge.write(&bytes);
        let was_written = core::mem::replace(&mut standby.fits, is_written);
        if was_written && !is_written {
            let event = StandbyEvent::KnowledgeTooLong { bytes: bytes.len(), room: KNOWLEDGE_ROOM };
            self.supervisor.append_event(now, Event::Standby(event));
        }
    }

    fn marks(&self) -> Marks {
        let view = self.segment.view();
        let is_settled = |member: &MemberView<'_>| matches!(member.phase, crate::segment::member::Phase::Settled(_));
        Marks {
            cabling: view.versions().cabling,
            adoptions: view.adoptions(),
            settled: view.members().filter(is_settled).count(),
            known: view.subdevices().all().iter().filter(|it| it.knowledge.info().is_some()).count(),
            clocks: view.clocks().are_locked(),
        }
    }
}
