//! The MainDevice: scan, activation, and the two halves that come out of it.
//!
//! [`MainDevice::new`] starts with the acyclic half alone. A scan runs as its first procedure. [`MainDevice::activate`]
//! takes the application's declaration, lays out process data, starts the configuration of all SubDevices and the
//! supervision, and hands out the [`Exchange`] for the application's cyclic thread.

use alloc::rc::Rc;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::fmt;
use core::future::Future;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::al::AlState;
use ringcat_wire::frame::MacAddress;
use ringcat_wire::source_address::MacCodec;

use crate::board::Board;
use crate::config::{ConfigError, Resolution, SubDeviceConfig, resolve};
use crate::domain::DomainId;
use crate::event::{CyclicEvent, Event, TimedEvent};
use crate::exchange::{Entry, Exchange};
use crate::info::{Direction, SubDeviceInfo};
use crate::layout::{AreaSpec, DomainSpec, Layout, LayoutError, PlacedArea};
use crate::link::{Link, LinkSet};
use crate::plan::{SubDevicePlan, plan};
use crate::procedures::configure::Start;
use crate::procedures::fleet::{Fleet, Member, Phase, Setup, SetupError, SharedFleet, declared_areas, planned_areas};
use crate::procedures::recover::start_all;
use crate::procedures::scan::{Scan, ScanError, ScanOptions, scan, station_at};
use crate::procedures::sii::SiiCache;
use crate::procedures::supervise::supervise;
use crate::queue::{Consumer, queue};
use crate::ring::Identity;
use crate::supervisor::{AcyclicCounters, Bus, Received, Supervisor};
use crate::time::Instant;

/// Messages of the exchange that may wait until somebody fetches events.
const CYCLIC_EVENTS: usize = 1024;

/// What a MainDevice needs to know before it sends its first frame.
#[derive(Clone, Debug)]
pub struct Options {
    /// Address of the main interface.
    pub main: MacAddress,
    /// Address of the redundant interface; `None` for a single link.
    pub redundant: Option<MacAddress>,
    /// How marks are written into source addresses.
    pub codec: MacCodec,
    /// Whether SII contents are kept and used for SubDevices with the same first 64 words.
    pub sii_cache: bool,
    /// Whether a supervision datagram rides with the process data. Without it nothing is noticed by itself.
    pub supervision: bool,
    /// For so long the number of SubDevices must not change at the beginning of a scan.
    pub settle: Duration,
    /// So long a scan waits for the first SubDevice.
    pub patience: Duration,
}

impl Options {
    /// Usual options for these interfaces.
    pub fn new(main: MacAddress, redundant: Option<MacAddress>) -> Options {
        Options {
            main,
            redundant,
            codec: MacCodec::FlagsFirst,
            sii_cache: true,
            supervision: true,
            settle: Duration::from_millis(5),
            patience: Duration::from_secs(5),
        }
    }

    fn links(&self) -> LinkSet {
        if self.redundant.is_some() { LinkSet::Ring } else { LinkSet::Single }
    }
}

/// A domain as the application declares it.
#[derive(Clone, Debug)]
pub struct DomainConfig {
    /// How often the application will exchange it.
    pub period: Duration,
    /// What belongs to it.
    pub members: Vec<DomainMember>,
}

/// A SubDevice's part in a domain.
#[derive(Clone, Debug)]
pub struct DomainMember {
    /// Index of the SubDevice in the declaration.
    pub subdevice: usize,
    /// SyncManagers whose process data belongs to the domain; `None` for all.
    pub sync_managers: Option<Vec<u8>>,
}

/// What the application declares.
#[derive(Clone, Debug, Default)]
pub struct Declaration {
    /// The SubDevices that are expected.
    pub subdevices: Vec<SubDeviceConfig>,
    /// The domains.
    pub domains: Vec<DomainConfig>,
}

/// Why a declaration cannot be activated.
#[derive(Clone, Debug, PartialEq)]
pub enum ActivateError {
    /// There is no scan result.
    NoScan,
    /// The MainDevice is active.
    Active,
    /// A declared SubDevice is not there, or another one is.
    Config {
        /// Index in the declaration.
        subdevice: usize,
        /// What is wrong.
        error: ConfigError,
    },
    /// A SubDevice cannot be configured as declared.
    Setup {
        /// Index in the declaration.
        subdevice: usize,
        /// What is wrong.
        error: SetupError,
    },
    /// Process data does not fit.
    Layout(LayoutError),
    /// A domain names a SubDevice that was not declared.
    UnknownMember {
        /// Number of the domain.
        domain: usize,
        /// Index that was given.
        subdevice: usize,
    },
}

impl fmt::Display for ActivateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ActivateError::NoScan => f.write_str("no scan result: scan before activating"),
            ActivateError::Active => f.write_str("the MainDevice is active already"),
            ActivateError::Config { subdevice, error } => write!(f, "declaration {subdevice}: {error}"),
            ActivateError::Setup { subdevice, error } => write!(f, "declaration {subdevice}: {error}"),
            ActivateError::Layout(error) => error.fmt(f),
            ActivateError::UnknownMember { domain, subdevice } => {
                write!(f, "domain {domain} names declaration {subdevice}, which does not exist")
            }
        }
    }
}

impl core::error::Error for ActivateError {}

/// How far a declared SubDevice is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SubDeviceState {
    /// It does not answer.
    Absent,
    /// It is being configured, or waits for the next attempt.
    Configuring,
    /// It is in its target state.
    Settled(AlState),
}

type ScanSlot = Rc<RefCell<Option<Result<Scan, ScanError>>>>;

/// The MainDevice without its cyclic half.
#[derive(Debug)]
pub struct MainDevice {
    options: Options,
    supervisor: Supervisor,
    identity: Identity,
    cache: SiiCache,
    scan: ScanSlot,
    fleet: Option<SharedFleet>,
    cyclic_events: Option<Consumer>,
}

impl MainDevice {
    /// A MainDevice that has not sent anything.
    pub fn new(options: Options, now: Instant) -> MainDevice {
        let identity = Identity::new(options.codec, options.main, options.redundant);
        MainDevice {
            supervisor: Supervisor::new(identity, options.links(), now),
            identity,
            cache: SiiCache::new(options.sii_cache),
            scan: ScanSlot::default(),
            fleet: None,
            cyclic_events: None,
            options,
        }
    }

    /// Starts a scan, which puts all SubDevices into INIT. Refused while active.
    pub fn start_scan(&mut self) -> Result<(), ActivateError> {
        if self.fleet.is_some() {
            return Err(ActivateError::Active);
        }
        *self.scan.borrow_mut() = None;
        let (bus, slot) = (self.supervisor.bus(), self.scan.clone());
        let options =
            ScanOptions { settle: self.options.settle, patience: self.options.patience, cache: self.cache.clone() };
        self.supervisor.spawn(async move {
            let result = scan(&bus, &options).await;
            if let Err(error) = &result {
                bus.report(Event::ScanFailed { reason: alloc::string::ToString::to_string(error) });
            }
            *slot.borrow_mut() = Some(result);
        });
        Ok(())
    }

    /// The result of the last scan, once it has ended.
    pub fn scan_result(&self) -> Option<Result<Scan, ScanError>> {
        self.scan.borrow().clone()
    }

    /// What the last scan found; empty before it has ended well.
    pub fn subdevices(&self) -> Vec<SubDeviceInfo> {
        match &*self.scan.borrow() {
            Some(Ok(scan)) => scan.subdevices.clone(),
            Some(Err(_)) | None => Vec::new(),
        }
    }

    /// Lays out process data, starts configuration and supervision, and hands out the cyclic half.
    pub fn activate(&mut self, declaration: Declaration) -> Result<Active, ActivateError> {
        if self.fleet.is_some() {
            return Err(ActivateError::Active);
        }
        let scan = match &*self.scan.borrow() {
            Some(Ok(scan)) => scan.clone(),
            Some(Err(_)) | None => return Err(ActivateError::NoScan),
        };
        let bus = self.supervisor.bus();
        let found = match_declaration(&bus, &declaration, &scan)?;
        let plans = plan_all(&declaration, &found)?;
        let specs = domain_specs(&declaration, &plans)?;
        let layout =
            Layout::new(&specs, self.options.links(), self.options.supervision).map_err(ActivateError::Layout)?;
        let members = members(declaration, found, &layout)?;
        let directory = Directory::new(&plans, &layout);
        let board = Arc::new(Board::new(members.len()));
        let (producer, consumer) = queue(CYCLIC_EVENTS);
        let exchange = Exchange::new(self.identity, self.options.links(), &layout, board.clone(), producer);
        let fleet =
            Fleet { members, strangers: Vec::new(), layout, topology: scan.topology, cache: self.cache.clone() };
        let fleet = SharedFleet::new(fleet, board.clone());
        self.supervisor.attach(board);
        start_all(&bus, &fleet, Start::Cleared);
        if self.options.supervision {
            self.supervisor.spawn(supervise(bus, fleet.clone()));
        }
        self.fleet = Some(fleet);
        self.cyclic_events = Some(consumer);
        Ok(Active { exchange, directory })
    }

    /// How far each declared SubDevice is.
    pub fn states(&self) -> Vec<SubDeviceState> {
        let Some(fleet) = &self.fleet else { return Vec::new() };
        fleet.access().members.iter().map(|member| member.phase.into()).collect()
    }

    /// Station addresses of the declared SubDevices.
    pub fn stations(&self) -> Vec<StationAddress> {
        let Some(fleet) = &self.fleet else { return Vec::new() };
        fleet.access().members.iter().map(|member| member.station).collect()
    }

    /// Whether every declared SubDevice is in its target state.
    pub fn all_settled(&self) -> bool {
        let Some(fleet) = &self.fleet else { return false };
        let access = fleet.access();
        access
            .members
            .iter()
            .all(|m| matches!(m.phase, Phase::Settled(_)) || (m.config.optional && m.phase == Phase::Absent))
    }

    /// Takes the oldest event of either half.
    pub fn pop_event(&mut self, now: Instant) -> Option<TimedEvent> {
        if let Some(event) = self.supervisor.pop_event() {
            return Some(event);
        }
        let words = self.cyclic_events.as_mut()?.pop()?;
        CyclicEvent::unpack(words).map(|event| TimedEvent { at: now, event: event.event() })
    }

    /// Takes in a frame of the acyclic half.
    pub fn receive(&mut self, arrived_on: Link, bytes: &[u8], now: Instant) -> Received {
        self.supervisor.receive(arrived_on, bytes, now)
    }

    /// Lets procedures go on.
    pub fn poll(&mut self, now: Instant) {
        self.supervisor.poll(now);
    }

    /// Sends acyclic frames within a byte budget; see [`Supervisor::transmit`].
    pub fn transmit(&mut self, now: Instant, budget: usize, transmit: &mut impl FnMut(Link, &[u8])) -> usize {
        self.supervisor.transmit(now, budget, transmit)
    }

    /// When [`MainDevice::poll`] has something to do at the latest.
    pub fn next_deadline(&self) -> Option<Instant> {
        self.supervisor.next_deadline()
    }

    /// Whether acyclic datagrams wait to be sent.
    pub fn wants_to_send(&self) -> bool {
        self.supervisor.wants_to_send()
    }

    /// Counters of the acyclic half.
    pub fn counters(&self) -> AcyclicCounters {
        self.supervisor.counters()
    }

    /// The handle for procedures of the application's own.
    pub fn bus(&self) -> Bus {
        self.supervisor.bus()
    }

    /// Starts a procedure of the application's own.
    pub fn spawn(&mut self, procedure: impl Future<Output = ()> + 'static) {
        self.supervisor.spawn(procedure);
    }

    /// State of the ring: the exchange's view once it runs, before that the acyclic half's.
    pub fn ring(&self) -> crate::ring::RingState {
        self.supervisor.bus().ring()
    }
}

impl From<Phase> for SubDeviceState {
    fn from(phase: Phase) -> SubDeviceState {
        match phase {
            Phase::Absent => SubDeviceState::Absent,
            Phase::Configuring => SubDeviceState::Configuring,
            Phase::Settled(state) => SubDeviceState::Settled(state),
        }
    }
}

/// What activation hands out.
#[derive(Debug)]
pub struct Active {
    /// The cyclic half.
    pub exchange: Exchange,
    /// Where PDO entries lie.
    pub directory: Directory,
}

/// Where the PDO entries of all declared SubDevices lie in the domains' images.
#[derive(Clone, Debug, Default)]
pub struct Directory {
    subdevices: Vec<Vec<AreaEntries>>,
    /// What each SubDevice adds to the working counters of all domains.
    contributions: Vec<u32>,
}

/// An area with the entries in it.
#[derive(Clone, Debug)]
pub struct AreaEntries {
    /// The domain.
    pub domain: DomainId,
    /// Place in the image.
    pub placed: PlacedArea,
    /// Direction.
    pub direction: Direction,
    /// Index, subindex, place; gaps are left out.
    pub entries: Vec<(u16, u8, Entry)>,
}

impl Directory {
    fn new(plans: &[Areas], layout: &Layout) -> Directory {
        let subdevices = plans.iter().enumerate().map(|(index, areas)| areas.directory(index, layout)).collect();
        let mut contributions = alloc::vec![0; plans.len()];
        let frames = layout.domains.iter().flat_map(|domain| &domain.frames);
        for (subdevice, wkc) in frames.flat_map(|f| &f.datagrams).flat_map(|datagram| &datagram.contributions) {
            if let Some(sum) = contributions.get_mut(*subdevice) {
                *sum += u32::from(wkc.0);
            }
        }
        Directory { subdevices, contributions }
    }

    /// What a SubDevice adds to the working counters of its domains when it takes part.
    pub fn contribution(&self, subdevice: usize) -> u32 {
        self.contributions.get(subdevice).copied().unwrap_or(0)
    }

    /// All areas of a SubDevice.
    pub fn areas(&self, subdevice: usize) -> &[AreaEntries] {
        self.subdevices.get(subdevice).map_or(&[], Vec::as_slice)
    }

    /// The place of a PDO entry; the first one where it is mapped more than once.
    pub fn entry(&self, subdevice: usize, index: u16, sub_index: u8) -> Option<Entry> {
        let entries = self.areas(subdevice).iter().flat_map(|area| &area.entries);
        entries.into_iter().find(|(i, s, _)| (*i, *s) == (index, sub_index)).map(|(_, _, entry)| *entry)
    }
}

/// Process data of a declared SubDevice: planned from what it is, or from the declaration while it is not there.
enum Areas {
    Planned(SubDevicePlan),
    Declared(Vec<(u8, Direction, u16)>),
}

impl Areas {
    fn list(&self) -> Vec<(u8, Direction, u16)> {
        match self {
            Areas::Planned(plan) => planned_areas(plan),
            Areas::Declared(areas) => areas.clone(),
        }
    }

    fn lrw(&self) -> bool {
        match self {
            Areas::Planned(plan) => plan.lrw_supported,
            Areas::Declared(_) => false,
        }
    }

    fn directory(&self, index: usize, layout: &Layout) -> Vec<AreaEntries> {
        let mut found = Vec::new();
        for (sync_manager, direction, _) in self.list() {
            let Some((domain, placed)) = layout.area(index, sync_manager) else { continue };
            let mut entries = Vec::new();
            if let Areas::Planned(plan) = self {
                let area = plan.process_data.iter().find(|area| area.sync_manager == sync_manager);
                let mapped = area.into_iter().flat_map(|area| &area.pdos).flat_map(|pdo| &pdo.entries);
                entries.extend(mapped.filter(|entry| entry.index != 0).map(|entry| {
                    let bit_offset = placed.image_offset * 8 + entry.bit_offset;
                    let place = Entry { domain, bit_offset, bit_length: entry.bit_length.into() };
                    (entry.index, entry.sub_index, place)
                }));
            }
            found.push(AreaEntries { domain, placed, direction, entries });
        }
        found
    }
}

/// Who is whom: by declaration, the SubDevice that was found.
fn match_declaration(
    bus: &Bus,
    declaration: &Declaration,
    scan: &Scan,
) -> Result<Vec<Option<SubDeviceInfo>>, ActivateError> {
    let mut found = alloc::vec![None; declaration.subdevices.len()];
    for resolution in resolve(&declaration.subdevices, &scan.subdevices) {
        match resolution {
            Resolution::Found { config, info } => found[config] = Some(scan.subdevices[info].clone()),
            Resolution::Absent { config } => bus.report(Event::Missing { subdevice: config, optional: true }),
            Resolution::Failed { config, error } => {
                return Err(ActivateError::Config { subdevice: config, error });
            }
            Resolution::Extra { info } => {
                let info = &scan.subdevices[info];
                bus.report(Event::Unexpected { position: info.position, identity: info.identity });
            }
        }
    }
    Ok(found)
}

fn plan_all(declaration: &Declaration, found: &[Option<SubDeviceInfo>]) -> Result<Vec<Areas>, ActivateError> {
    let pairs = declaration.subdevices.iter().zip(found).enumerate();
    pairs
        .map(|(subdevice, (config, info))| match info {
            Some(info) => plan(config, info)
                .map(Areas::Planned)
                .map_err(|error| ActivateError::Setup { subdevice, error: SetupError::Plan(error) }),
            None => Ok(Areas::Declared(declared_areas(config).unwrap_or_default())),
        })
        .collect()
}

fn domain_specs(declaration: &Declaration, plans: &[Areas]) -> Result<Vec<DomainSpec>, ActivateError> {
    let mut specs = Vec::new();
    for (domain, config) in declaration.domains.iter().enumerate() {
        let mut spec = DomainSpec { period: config.period, lrw: true, areas: Vec::new() };
        for member in &config.members {
            let subdevice = member.subdevice;
            let Some(areas) = plans.get(subdevice) else {
                return Err(ActivateError::UnknownMember { domain, subdevice });
            };
            spec.lrw &= areas.lrw();
            for (sync_manager, direction, length) in areas.list() {
                if member.sync_managers.as_ref().is_none_or(|wanted| wanted.contains(&sync_manager)) {
                    spec.areas.push(AreaSpec { subdevice, sync_manager, direction, length });
                }
            }
        }
        specs.push(spec);
    }
    Ok(specs)
}

fn members(
    declaration: Declaration,
    found: Vec<Option<SubDeviceInfo>>,
    layout: &Layout,
) -> Result<Vec<Member>, ActivateError> {
    let count = found.len();
    let mut members = Vec::with_capacity(count);
    for (index, (config, info)) in declaration.subdevices.into_iter().zip(found).enumerate() {
        let setup = match &info {
            Some(info) => Some(Rc::new(
                Setup::new(index, &config, info, layout)
                    .map_err(|error| ActivateError::Setup { subdevice: index, error })?,
            )),
            None => None,
        };
        // One that is not there yet gets an address behind those of the scan.
        let absent = station_at(ringcat_wire::address::Position((0x4000 + index) as u16));
        let station = info.as_ref().map_or(absent, |info| info.station);
        members.push(Member { config, info, station, phase: Phase::Absent, setup });
    }
    Ok(members)
}
