//! Data of one of two MainDevices in a ring: options, what both halves share, and the state of the other MainDevice.

pub(super) mod follow;
pub(super) mod identity;
pub(super) mod listen;
pub(super) mod listener;
pub(super) mod partner_ethernet;
pub(super) mod redundancy;
pub(super) mod standby_options;
pub(super) mod take_over;

use alloc::sync::Arc;

use ringcat_wire::frame::MacAddress;
use ringcat_wire::master_frame::NotReady;
use ringcat_wire::memory_write::MemoryWrite;

use crate::board::standby::StandbyWords;
use crate::event::{CyclicEvent, Event};
use crate::link::LinkSet;
use crate::ring::Identity;
use crate::role::RoleControl;
use crate::standby::PartnerEndpoint;
use crate::standby::ethernet::PartnerEthernet;
use crate::time::Instant;
use identity::Configuration;
use listener::Listener;
use standby_options::StandbyOptions;

/// What a MainDevice has for redundancy.
#[derive(Debug)]
pub(super) struct Standby {
    pub options: StandbyOptions,
    pub words: Arc<StandbyWords>,
    /// The configuration of the application.
    pub configuration: Configuration,
    /// Session of the process data.
    pub session: Option<u32>,
    /// Takes what arrives from the ACTIVE without an application, unless another thread does.
    pub listener: Option<Listener>,
    /// A version of the ACTIVE that cannot be read, and was reported.
    pub other_version: Option<u8>,
    /// The last collision while there was no application.
    pub collision: Option<Collision>,
    /// A SubDevice in BOOT, and when it is searched next.
    pub in_boot: Option<MemoryWrite>,
    pub boot_at: Instant,
    /// Cycles of the application so far, and when there was another one.
    pub cycles_at: (u64, Instant),
    /// When the knowledge is made next, at the earliest and if nothing has changed.
    pub publish_at: (Instant, Instant),
    /// The knowledge fits into its room.
    pub fits: bool,
    /// What the published knowledge was made from.
    pub published: Option<Marks>,
    /// Ethernet between both MainDevices.
    pub ethernet: Option<PartnerEthernet>,
    /// Its endpoint for the application, until that takes it.
    pub endpoint: Option<PartnerEndpoint>,
}

/// Frames of another ACTIVE that have come.
#[derive(Clone, Copy, Debug)]
pub(super) struct Collision {
    /// When the last one came.
    pub at: Instant,
    /// The sender of the last one, until it is taken.
    pub source: Option<MacAddress>,
}

/// Numbers that change with most changes of the knowledge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Marks {
    pub cabling: u32,
    pub adoptions: u32,
    pub settled: usize,
    pub known: usize,
    /// Measurements of the clocks that are valid.
    pub clocks: bool,
}

impl Standby {
    pub fn new(
        options: StandbyOptions,
        identity: &Identity,
        (links, control): (LinkSet, &RoleControl),
        now: Instant,
    ) -> Standby {
        control.set_not_ready(NotReady::GUARD.0, options.needs_guard);
        let words: Arc<StandbyWords> = Arc::default();
        let has_ethernet = options.max_acyclic > 0 && links == LinkSet::Ring;
        let ethernet = has_ethernet.then(|| PartnerEthernet::new(*identity, options.max_acyclic, now));
        let (ethernet, endpoint) = ethernet.unzip();
        Standby {
            options,
            listener: Some(Listener::new(words.clone(), control.clone())),
            words,
            configuration: Configuration::default(),
            session: None,
            other_version: None,
            collision: None,
            in_boot: None,
            boot_at: Instant(0),
            cycles_at: (0, now),
            publish_at: (Instant(0), Instant(0)),
            fits: true,
            published: None,
            ethernet,
            endpoint,
        }
    }

    /// Whether Ethernet frames for the other MainDevice wait since it was determined last what is due. Cheap.
    #[inline]
    pub fn has_frames(&self) -> bool {
        self.ethernet.as_ref().is_some_and(PartnerEthernet::has_frames)
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
