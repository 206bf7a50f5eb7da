//! The MainDevice: scan, activation, and its two halves.
//!
//! [`MainDevice::new`] starts with the acyclic half alone. A scan runs as its first procedure. [`MainDevice::activate`]
//! takes the application's declaration, lays out process data, starts the configuration of all SubDevices and the
//! supervision, and returns the [`Exchange`](crate::exchange::Exchange) for the application's cyclic thread.

mod activate;
mod active;
mod bus_control;
mod clients;
mod clocks;
mod declaration;
mod found;
mod function;
mod handover;
mod idle;
mod live_status;
mod options;
mod pending;
mod sampling;
mod scanning;
mod services;
pub mod snapshot;
#[cfg(feature = "standby")]
mod standby;
mod state_of_all;
mod states;
mod steps;
mod turns;

use alloc::collections::BTreeMap;
use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::future::Future;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::al::AlState;

pub use activate::activate_error::ActivateError;
pub use activate::obstacles::{obstacles, replaced_reference};
pub use activate::sent_once::SentOnce;
pub use active::Active;
pub use declaration::areas::{AreaEntries, Directory, ObjectOf, PlacedEntry};
pub use declaration::image_memory::ImageMemory;
#[cfg(feature = "standby")]
pub use declaration::partner_memory::PartnerMemoryError;
pub use declaration::register_error::RegisterError;
pub use declaration::registered_area::{EntryPlace, RegisteredArea};
pub use declaration::{Declaration, DeclaredGroup, DomainConfig, DomainMember, ExplicitLrw, MAX_UNDER_WAY, Required};
pub use found::DeclaredSubDevice;
pub use live_status::{LiveStatus, LostCopies, SegmentStatus, SubDeviceStatus, WkcShare};
pub use options::Options;
pub use pending::Pending;
pub use services::datagrams::{MAX_DATAGRAMS, RawDatagram};
pub use services::ethernet::EthernetSubDevice;
#[cfg(feature = "standby")]
pub use standby::listener::{Listener, PartnerDiagnosis, PartnerStatus};
#[cfg(feature = "standby")]
pub use standby::standby_options::StandbyOptions;
pub use states::{GroupState, SubDeviceState};

pub use crate::declared::{Address, GroupId, SubDeviceId};
pub use crate::role::{Denial, Function, MainDevicePhase, MainDeviceRole, NotPermitted, Permission};
pub use crate::segment::Retries;
pub use crate::segment::clocks::{ClockStatus, HiddenDelay};

use crate::event::{CyclicEvent, EventLog, EventsSince, TimedEvent};
use crate::knowledge::KnownMailbox;
use crate::link::{Link, LinkOrder, LinkSet};
use crate::mail::eoe::EthernetPort;
use crate::mail::relay::GatewayQueue;
use crate::mail::{EmergencyRings, InUse};
use crate::procedures::error_statistics::ErrorStatistics;
use crate::procedures::loops::restore_within;
use crate::procedures::own_objects::OwnObjects;
use crate::procedures::reconcile::{Companions, reconcile_without_application};
use crate::procedures::scan::ScanError;
use crate::procedures::serve_requests::Requests;
use crate::procedures::shared_segment::SharedSegment;
use crate::procedures::sii::SiiCache;
use crate::procedures::sii::images::SiiImages;
use crate::procedures::stop::{StopError, all_known, stop};
use crate::procedures::undeclared::UndeclaredMailboxes;
use crate::queue::Consumer;
use crate::ring::Identity;
use crate::ring_status::{CableReport, LinkStatus, Redundancy, RingStatus};
use crate::role::RoleControl;
use crate::segment::member::Phase;
use crate::segment::{Choices, LinkObservation, Observation, Segment, counts};
use crate::supervisor::{AcyclicCounters, Bus, Received, Supervisor, UnderWay};
use crate::time::Instant;
use declaration::loaded::Loaded;
use declaration::memories::Memories;

type StopSlot = Rc<RefCell<Option<Result<(), StopError>>>>;

/// The MainDevice without its cyclic half.
#[derive(Debug)]
pub struct MainDevice {
    options: Options,
    supervisor: Supervisor,
    /// Counts of earlier supervisors.
    counted: AcyclicCounters,
    /// Activations so far.
    activations: u32,
    identity: Identity,
    cache: SiiCache,
    /// EEPROMs that were read whole.
    sii_images: SiiImages,
    /// Why the last scan failed.
    scan_error: Rc<RefCell<Option<ScanError>>>,
    stopped: StopSlot,
    segment: SharedSegment,
    cyclic_events: Option<Consumer>,
    /// Number of cyclic events that did not fit into their queue and have got numbers.
    cyclic_events_lost: u64,
    requests: Requests,
    /// Emergencies of all SubDevices.
    emergencies: Rc<RefCell<EmergencyRings>>,
    /// Error counters, once active.
    statistics: Option<ErrorStatistics>,
    statistics_period: Option<Duration>,
    loaded: Option<Loaded>,
    /// Ethernet of SubDevices whose port was requested, by station address.
    ports: BTreeMap<StationAddress, EthernetPort>,
    /// Memory of the loaded declaration.
    memories: Memories,
    /// Messages of a gateway's clients.
    gateway_queue: Option<GatewayQueue>,
    /// The objects that a gateway client reads at address 0.
    own_objects: OwnObjects,
    /// Mailboxes that were in use when the role became INACTIVE.
    left_mailboxes: Vec<(InUse, KnownMailbox)>,
    /// Its role.
    roles: RoleControl,
    /// Changes of the role that this half has followed.
    role_followed: u32,
    #[cfg(feature = "standby")]
    standby: Option<standby::Standby>,
}

impl MainDevice {
    /// A MainDevice that has not sent anything.
    pub fn new(options: Options, now: Instant) -> MainDevice {
        let identity = Identity::new(options.codec, options.main, options.redundant);
        let mut supervisor = supervisor(identity, &options, now);
        supervisor.set_events(EventLog::new(now.0));
        let roles = RoleControl::new(options.first_role());
        supervisor.attach_role(roles.clone());
        let cache = SiiCache::new(options.sii_cache);
        let emergencies: Rc<RefCell<EmergencyRings>> = Rc::default();
        let undeclared = UndeclaredMailboxes::new(&supervisor.bus(), emergencies.clone());
        let segment = Segment::new(choices(&options));
        let segment = SharedSegment::idle(&supervisor.bus(), segment, cache.clone(), undeclared);
        #[cfg(feature = "standby")]
        let standby =
            options.standby.map(|standby| standby::Standby::new(standby, &identity, (options.links(), &roles), now));
        let mut main_device = MainDevice {
            supervisor,
            activations: 0,
            counted: AcyclicCounters::default(),
            identity,
            cache,
            sii_images: SiiImages::default(),
            scan_error: Rc::default(),
            stopped: StopSlot::default(),
            segment,
            cyclic_events: None,
            cyclic_events_lost: 0,
            requests: Requests::default(),
            emergencies,
            statistics: None,
            statistics_period: None,
            loaded: None,
            memories: Memories::default(),
            ports: BTreeMap::new(),
            gateway_queue: None,
            own_objects: OwnObjects::default(),
            left_mailboxes: Vec::new(),
            roles,
            role_followed: 0,
            #[cfg(feature = "standby")]
            standby,
            options,
        };
        main_device.start_reconciler();
        main_device.begin_idle();
        main_device
    }

    /// The shared model, while an application is active.
    fn active(&self) -> Option<&SharedSegment> {
        self.segment.view().is_active().then_some(&self.segment)
    }

    /// Ends supervision and all other procedures, and brings all SubDevices down to a state; SubDevices in a lower
    /// state stay there. The exchange must not send any more. Afterwards a new scan may start.
    pub fn start_stop(&mut self, state: AlState, limit: Duration, now: Instant) {
        if let Err(denied) = self.permit(Function::Stop) {
            *self.stopped.borrow_mut() = Some(Err(denied.into()));
            return;
        }
        let to_stop = all_known(&self.segment.view());
        self.end_application(now);
        let (bus, segment, slot) = (self.supervisor.bus(), self.segment.clone(), self.stopped.clone());
        self.supervisor.spawn(async move {
            let left = restore_within(&bus, &segment, limit).await;
            let result = stop(&bus, to_stop, state, left).await;
            *slot.borrow_mut() = Some(result);
        });
    }

    /// Ends all procedures; what the last scan found stays. A link that one of them has taken down comes back at once,
    /// ports that were changed for a moment by the first steps of what follows ([`restore`]).
    fn end_application(&mut self, now: Instant) {
        self.counted = self.counters();
        self.segment.observe_written_pdos();
        self.number_cyclic_events(now);
        let events = self.supervisor.take_events().end_session();
        self.renew_supervisor(events, now);
        self.segment = self.segment.without_application(&self.supervisor.bus());
        self.segment.observe(Observation::Deactivated);
        self.start_reconciler();
        self.begin_command_reports();
        self.requests.end();
        *self.emergencies.borrow_mut() = EmergencyRings::default();
        self.ports.clear();
        self.gateway_queue = None;
        self.own_objects = OwnObjects::default();
        self.statistics = None;
        self.cyclic_events = None;
        self.cyclic_events_lost = 0;
        *self.stopped.borrow_mut() = None;
    }

    /// Starts procedures that the model requests without an application.
    fn start_reconciler(&mut self) {
        let (bus, companions) = (self.supervisor.bus(), self.companions());
        self.supervisor.spawn(reconcile_without_application(bus, self.segment.clone(), companions));
    }

    /// What the procedures of the model need beside it.
    fn companions(&self) -> Companions {
        Companions { options: self.own_scan_options(), requests: self.requests.clone() }
    }

    /// The result of [`MainDevice::start_stop`], once it has ended.
    pub fn stop_result(&self) -> Option<Result<(), StopError>> {
        *self.stopped.borrow()
    }

    /// Events of both halves that were dropped because they were not fetched in time. The number only grows.
    pub fn events_dropped(&self) -> u64 {
        let in_queue = self.cyclic_events.as_ref().map_or(0, Consumer::dropped);
        self.supervisor.events_dropped() + in_queue.saturating_sub(self.cyclic_events_lost)
    }

    /// The events of both halves from a number on, also those that were fetched: for a client that was disconnected.
    /// The last 4,096 events are kept; events of the cyclic half beyond the last 1,024 are dropped before others.
    pub fn events_since(&mut self, number: u64) -> EventsSince {
        self.number_cyclic_events(self.supervisor.bus().now());
        self.supervisor.events_since(number)
    }

    /// Moves the events of the cyclic half into the log. Events that did not fit into its queue get numbers as well.
    fn number_cyclic_events(&mut self, now: Instant) {
        let Some(cyclic) = self.cyclic_events.as_mut() else { return };
        self.supervisor.with_events(|log| {
            while let Some(words) = cyclic.pop() {
                let Some(event) = CyclicEvent::unpack(words) else { continue };
                #[cfg(feature = "standby")]
                let event = standby::named(&self.standby, event);
                #[cfg(not(feature = "standby"))]
                let event = event.event();
                log.push_cyclic(now, event);
            }
            // They occurred after the events that had filled the queue.
            let lost = cyclic.dropped();
            log.skip(lost.saturating_sub(self.cyclic_events_lost));
            self.cyclic_events_lost = lost;
        });
    }

    /// The present state of each declared SubDevice.
    pub fn states(&self) -> Vec<SubDeviceState> {
        self.segment.view().members().map(|member| self.known_state(member.phase)).collect()
    }

    /// Status of each clock of the segment, by position; empty without distributed clocks.
    pub fn clocks(&self) -> Vec<ClockStatus> {
        self.segment.view().clocks().status()
    }

    /// Whether all required clocks are locked ([`ClockStatus::is_required`], protocol 7.2).
    pub fn clocks_locked(&self) -> bool {
        self.segment.view().clocks().are_locked()
    }

    /// Station addresses of the declared SubDevices.
    pub fn stations(&self) -> Vec<StationAddress> {
        self.segment.view().members().map(|member| member.station).collect()
    }

    /// Whether every declared SubDevice is in its target state.
    pub fn all_settled(&self) -> bool {
        let access = self.segment.view();
        access.is_active()
            && self.are_states_known()
            && access
                .members()
                .all(|m| matches!(m.phase, Phase::Settled(_)) || (m.config.optional && m.phase == Phase::Absent))
    }

    /// Whether every declared SubDevice that is not optional is in its target state.
    pub fn mandatory_settled(&self) -> bool {
        let access = self.segment.view();
        access.is_active()
            && self.are_states_known()
            && access.members().all(|member| member.config.optional || matches!(member.phase, Phase::Settled(_)))
    }

    /// The present state of each hot connect group, by its number. An INACTIVE without an ACTIVE reports no group as
    /// present.
    pub fn groups(&self) -> Vec<GroupState> {
        let (counts, is_known) = (counts(self.segment.view().subdevices()), self.are_states_known());
        let group = |(present, settled, members)| match is_known {
            true => GroupState { present, settled, members },
            false => GroupState { present: 0, settled: 0, members },
        };
        counts.into_iter().map(group).collect()
    }

    /// Takes the oldest event of either half.
    pub fn pop_event(&mut self, now: Instant) -> Option<TimedEvent> {
        self.number_cyclic_events(now);
        self.supervisor.pop_event()
    }

    /// Receives a frame of the acyclic half.
    pub fn receive(&mut self, arrived_on: Link, bytes: &[u8], now: Instant) -> Received {
        #[cfg(feature = "standby")]
        if self.take_ethernet(bytes, now) {
            return Received::Taken;
        }
        self.supervisor.receive(arrived_on, bytes, now)
    }

    /// Sends acyclic frames within a byte budget; see [`Supervisor::transmit`].
    pub fn transmit(&mut self, now: Instant, budget: usize, transmit: &mut impl FnMut(Link, &[u8])) -> usize {
        #[cfg(feature = "standby")]
        if self.has_ethernet() {
            return self.transmit_with_ethernet(now, budget, transmit);
        }
        self.supervisor.transmit(now, budget, transmit)
    }

    /// Order to the link layer: a link, and whether to disconnect it. Answer it with
    /// [`MainDevice::answer_link_order`].
    #[inline]
    pub fn take_link_order(&mut self) -> Option<(Link, bool)> {
        let LinkOrder { link, disconnect } = self.supervisor.take_link_order()?;
        self.segment.observe(Observation::Link(LinkObservation::Fetched));
        Some((link, disconnect))
    }

    /// Whether that order was carried out.
    pub fn answer_link_order(&mut self, done: bool) {
        self.segment.observe(Observation::Link(LinkObservation::Answered(done)));
    }

    /// Whether acyclic datagrams wait to be sent.
    pub fn wants_to_send(&self) -> bool {
        self.supervisor.wants_to_send()
    }

    /// Counters of the acyclic half, from the first scan on.
    pub fn counters(&self) -> AcyclicCounters {
        self.counted.plus(self.supervisor.counters())
    }

    /// Datagrams and procedures under way in the acyclic half.
    pub fn under_way(&self) -> UnderWay {
        self.supervisor.under_way()
    }

    /// The handle for procedures of the application's own.
    pub fn bus(&self) -> Bus {
        self.supervisor.bus()
    }

    /// Starts a procedure of the application's own.
    pub fn spawn(&mut self, procedure: impl Future<Output = ()> + 'static) {
        self.supervisor.spawn(procedure);
    }

    /// Carrier state of the links, by [`Link::index`]; `None` if a link does not report it. To be called regularly.
    #[inline]
    pub fn set_carriers(&mut self, carriers: [Option<bool>; 2]) {
        self.supervisor.set_carriers(carriers);
    }

    /// State of the ring and of both links. Values derived from frames need the supervision datagram.
    pub fn ring_status(&self) -> RingStatus {
        let mut status = match self.active() {
            Some(segment) => segment.view().ring_status(),
            None => RingStatus { state: self.ring(), ..self.first_ring_status() },
        };
        if self.role() == MainDeviceRole::Inactive {
            // What the ACTIVE has sent last.
            status.state = self.ring();
        }
        let seen = self.segment.board.supervision().map(|(_, seen)| seen).unwrap_or_default();
        let carriers = self.supervisor.bus().carriers();
        let positions = status.place.map_or([None; 2], |cable| cable.positions());
        status.place_ends = self.supervisor.bus().occupants(positions);
        for (at, answering) in [seen.main.0, seen.redundant.0].into_iter().enumerate() {
            let al_states = seen.al_status[at] & 0x0F;
            status.links[at] = LinkStatus { carrier: carriers[at], answering, al_states };
        }
        status
    }

    /// Every cable of the scan with the error counts of the ports at its ends since activation, read once a second.
    pub fn cable_errors(&self) -> Vec<CableReport> {
        let view = self.segment.view();
        view.cabling().cables.iter().map(|(cable, errors)| CableReport::new(*cable, *errors)).collect()
    }

    fn first_ring_status(&self) -> RingStatus {
        let redundancy = match self.options.links() {
            LinkSet::Single => Redundancy::None,
            LinkSet::Ring => Redundancy::Unknown,
        };
        RingStatus { redundancy, ..RingStatus::default() }
    }

    /// State of the ring: the exchange's view once it runs, before that the acyclic half's.
    pub fn ring(&self) -> crate::ring::RingState {
        self.supervisor.bus().ring()
    }
}

fn choices(options: &Options) -> Choices {
    Choices {
        // A link that is taken down looks like a MainDevice that fails (protocol 9.16).
        enhanced_line_crossed: options.enhanced_line_crossed && options.first_role() == MainDeviceRole::Active,
        junctions: options.junctions,
        idle_operation: options.idle_operation,
        supervision: options.supervision,
        retries: options.retries,
        pdos: options.pdos_in_preop(),
        dictionaries: options.dictionaries,
        alias_source: options.alias_source,
        sii_assignment: options.sii_assignment,
        // Without supervision unassigned SubDevices are not identified as members.
        follow_groups: options.follow_groups && options.supervision,
    }
}

/// The acyclic half without procedures.
fn supervisor(identity: Identity, options: &Options, now: Instant) -> Supervisor {
    let mut supervisor = Supervisor::new(identity, options.links(), now);
    if let Some(most) = options.most_datagrams() {
        supervisor.set_max_datagrams(most);
    }
    supervisor
}
