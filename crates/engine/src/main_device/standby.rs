//! MainDevice redundancy: options, what both halves share of it, and the other MainDevice as this one knows it.

use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::al::AlState;
use ringcat_wire::master_frame::{Lengths, NotReady};

use super::MainDevice;
use super::declaration::Declaration;
use super::identity::Configuration;
use crate::board::standby::StandbyWords;
use crate::event::{CyclicEvent, Event};
use crate::exchange::following::Following;
use crate::exchange::{Exchange, StandbySetup};
use crate::knowledge::Knowledge;
use crate::layout::{Layout, LayoutError, LrwPolicy, MasterSizes, PlannedMasterFrames};
use crate::link::LinkSet;
use crate::role::{MainDeviceRole, RoleControl};
use crate::segment::SubDevices;
use crate::time::Instant;

/// Shortest time between two publications of the knowledge.
const PUBLISHED_EACH: Duration = Duration::from_millis(200);
/// Knowledge that has not changed in what is compared is made again after this time.
const PUBLISHED_AGAIN: Duration = Duration::from_secs(5);

/// Options of MainDevice redundancy. Both MainDevices of a ring have the same (protocol REQ010).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct StandbyOptions {
    /// Sizes of the areas in master frames.
    pub sizes: MasterSizes,
    /// Whether the ACTIVE becomes INACTIVE when both links have lost their carriers (protocol MR-25). On by default:
    /// the other MainDevice has taken over when the links are back.
    pub yields_without_links: bool,
    /// Whether all SubDevices are configured again from INIT on after a takeover (warm standby, protocol MR-18). Off by
    /// default: they go on as they are.
    pub goes_through_init: bool,
}

impl Default for StandbyOptions {
    fn default() -> StandbyOptions {
        StandbyOptions { sizes: MasterSizes::default(), yields_without_links: true, goes_through_init: false }
    }
}

impl StandbyOptions {
    /// Sets [`StandbyOptions::sizes`].
    #[must_use]
    pub const fn with_sizes(mut self, sizes: MasterSizes) -> StandbyOptions {
        self.sizes = sizes;
        self
    }

    /// Sets [`StandbyOptions::goes_through_init`].
    #[must_use]
    pub const fn with_goes_through_init(mut self, goes: bool) -> StandbyOptions {
        self.goes_through_init = goes;
        self
    }

    /// Sets [`StandbyOptions::yields_without_links`].
    #[must_use]
    pub const fn with_yields_without_links(mut self, yields: bool) -> StandbyOptions {
        self.yields_without_links = yields;
        self
    }
}

/// What a MainDevice has for redundancy.
#[derive(Debug)]
pub(super) struct Standby {
    pub options: StandbyOptions,
    pub words: Arc<StandbyWords>,
    /// The configuration of the application.
    pub configuration: Configuration,
    /// Session of the process data.
    pub session: Option<u32>,
    /// What is heard of the ACTIVE without an application.
    pub listening: Following,
    /// When.
    pub heard_at: Option<Instant>,
    /// A version of the ACTIVE that cannot be read, and was reported.
    pub other_version: Option<u8>,
    /// When the knowledge is made next, at the earliest and if nothing has changed.
    publish_at: (Instant, Instant),
    /// What the published knowledge was made from.
    published: Option<Marks>,
}

/// Numbers that change with most changes of the knowledge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Marks {
    cabling: u32,
    adoptions: u32,
    settled: usize,
    known: usize,
    /// Measurements of the clocks that are valid.
    clocks: bool,
}

impl Standby {
    pub fn new(options: StandbyOptions) -> Standby {
        let words: Arc<StandbyWords> = Arc::default();
        let mut listening = Following::new(Lengths::default(), words.clone());
        listening.answer.not_ready = NotReady::NO_APPLICATION;
        Standby {
            options,
            words,
            configuration: Configuration::default(),
            session: None,
            listening,
            heard_at: None,
            other_version: None,
            publish_at: (Instant(0), Instant(0)),
            published: None,
        }
    }
}

impl MainDevice {
    /// The role, and requests for another one: for any thread.
    pub fn role_control(&self) -> RoleControl {
        self.roles.clone()
    }

    /// Knowledge of the segment that the ACTIVE has sent, with which an application can follow it
    /// ([`MainDevice::follow`]); `None` before all of it has arrived.
    pub fn heard_knowledge(&self) -> Option<Knowledge> {
        let (_, bytes) = self.standby.as_ref()?.words.heard.copy()?;
        Knowledge::from_bytes(&bytes).ok()
    }

    /// Session and digest of the configuration of the ACTIVE; `None` before a frame of it.
    pub fn heard_configuration(&self) -> Option<(u16, u64)> {
        self.standby.as_ref()?.words.header()
    }

    /// Digest of the configuration of the active application; `None` without one.
    pub fn configuration_digest(&self) -> Option<u64> {
        self.active()?;
        Some(self.standby.as_ref()?.configuration.digest())
    }

    /// LRW is not allowed: the INACTIVE takes outputs from frames that have passed SubDevices (protocol REQ047).
    pub(super) fn is_lrw_refused(&self, lrw: LrwPolicy) -> bool {
        self.standby.is_some() && lrw == LrwPolicy::PerSubDevice
    }

    /// Sets up the exchange for a ring of two MainDevices.
    pub(super) fn set_up_standby(
        &mut self,
        exchange: &mut Exchange,
        (declaration, layout, session): (&Declaration, &Layout, u32),
        subdevices: &SubDevices,
    ) -> Result<(), LayoutError> {
        if self.options.links() != LinkSet::Ring {
            return Ok(());
        }
        let configuration = Configuration::of(declaration, &self.options);
        let Some(standby) = &mut self.standby else { return Ok(()) };
        let planned = PlannedMasterFrames::new(standby.options.sizes, layout, subdevices.member_count())?;
        (standby.configuration, standby.session) = (configuration, Some(session));
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
            },
        );
        Ok(())
    }

    /// Publishes the knowledge of the segment for the other MainDevice, if it is time.
    pub(super) fn publish_knowledge(&mut self, now: Instant) {
        let Some(standby) = &self.standby else { return };
        let (earliest, latest) = standby.publish_at;
        if now < earliest || self.role() != MainDeviceRole::Active || self.active().is_none() {
            return;
        }
        let marks = self.marks();
        if standby.published == Some(marks) && now < latest {
            return;
        }
        let bytes = self.knowledge().map(|knowledge| knowledge.to_bytes()).unwrap_or_default();
        let Some(standby) = &mut self.standby else { return };
        standby.published = Some(marks);
        standby.publish_at = (now + PUBLISHED_EACH, now + PUBLISHED_AGAIN);
        let is_same = standby.words.knowledge.copy().is_some_and(|(_, before)| before == bytes);
        if !is_same {
            standby.words.knowledge.write(&bytes);
        }
    }

    fn marks(&self) -> Marks {
        let view = self.segment.view();
        let is_settled = |member: &crate::segment::member::MemberView<'_>| {
            matches!(member.phase, crate::segment::member::Phase::Settled(_))
        };
        Marks {
            cabling: view.versions().cabling,
            adoptions: view.adoptions(),
            settled: view.members().filter(is_settled).count(),
            known: view.subdevices().all().iter().filter(|it| it.knowledge.info().is_some()).count(),
            clocks: view.clocks().are_locked(),
        }
    }
}

/// Names what an event of the cyclic half has found to differ.
pub(super) fn named(standby: &Option<Standby>, event: CyclicEvent) -> Event {
    match (event, standby) {
        (CyclicEvent::Standby(event), Some(standby)) => {
            Event::Standby(event.event(|number| standby.configuration.name_of(number)))
        }
        (event, _) => event.event(),
    }
}

/// A name of an item of the configuration that is not known.
pub(super) fn unknown_item(number: u16) -> String {
    alloc::format!("item {number}")
}
