//! RingCAT: an EtherCAT MainDevice for Linux.
//!
//! An application requests a [`MainDevice`] on a set of [`Links`], scans, declares what it expects, activates, and then
//! runs cycles:
//!
//! ```
//! use std::time::Duration;
//! use ringcat::simulated::SimulatedSegment;
//! use ringcat::{Declaration, MainDevice, Options, SubDeviceConfig};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let segment = SimulatedSegment::from_toml("[segment]\nring = true\n[[device]]\ntype = \"digital-output-8\"\n")?;
//! let mut main_device = MainDevice::request(segment, &Options::default());
//! main_device.scan()?;
//! let mut declaration = Declaration::new(Duration::from_millis(1));
//! let terminal = declaration.add(SubDeviceConfig::at_position(0));
//! let mut application = main_device.activate(declaration)?;
//! let lamp = application.output::<bool>(terminal, 0x7000, 1)?;
//! application.wait_until_op(Duration::from_secs(10))?;
//! for _ in 0..100 {
//!     application.cycle(|data| data.set(lamp, true));
//! }
//! # Ok(())
//! # }
//! ```
//!
//! | for | see |
//! |---|---|
//! | process data with types | [`Application::input`], [`Application::output`], [`ProcessData`] |
//! | objects, files, registers, states of one SubDevice | [`SubDevice`] |
//! | cycles in a thread of their own | [`SupervisorThread`], [`CyclicThread`] |
//! | distributed clocks | [`ClockConfig`], [`SyncSignals`], [`Trigger`] |
//! | state of SubDevices and links in real-time threads | [`LiveStatus`], [`LiveSubDevice`] |
//! | process data and rates of links in other threads | [`Observer`] |
//! | what happened | [`Event`], [`event_log`] |
//!
//! The module `guide` leads from here to a drive with clocks.
//!
//! [`Links`] provide frames, time and waiting; the EtherCAT protocol itself is in [`ringcat_engine`].
//!
//! # Features
//!
//! | feature | what it adds |
//! |---|---|
//! | `packet` (default) | network interfaces ([`packet::PacketLinks`]), captures ([`tee::Tee`]), `realtime` |
//! | `sim` | links into a simulated segment, in virtual or in real time; the simulator itself as `sim` |
//! | `eni` | networks from an ENI, its variables by name; the parsed file as `config` |
//! | `network` | networks from a network file of RingCAT (TOML); includes `eni` |
//! | `esi` | device descriptions from files; with `sim`, simulated devices from them |
//! | `gateway` | the mailbox gateway over UDP and TCP |
//! | `eoe` | network interfaces of the host for SubDevices that support Ethernet over EtherCAT |
//! | `daemon` | applications get their bus from the daemon `ringcatd` |
//! | `serde` | the types of `Snapshot` in any format of serde |
//! | `standby` | one of two MainDevices in a ring, which forwards, follows and takes over ([`MainDevice::join`]) |
//! | `tracing` | events and messages of the acyclic half for a `tracing` subscriber |
//! | `engine` | the engine itself, for own procedures and runtimes; its functions may change with any version |
//!
//! Without these features an application implements [`Links`] itself.

pub mod acyclic;
pub mod application;
mod bring_up;
mod cyclic;
pub mod cyclic_status;
pub mod cyclic_thread;
#[cfg(feature = "daemon")]
pub mod daemon;
mod either_links;
#[cfg(feature = "engine")]
mod engine_access;
#[cfg(feature = "eni")]
pub mod eni;
#[cfg(feature = "eoe")]
pub mod eoe;
mod error;
#[cfg(feature = "esi")]
pub mod esi;
pub mod event_log;
mod exchange_access;
pub mod foreign;
#[cfg(feature = "gateway")]
pub mod gateway;
// The pages of docs/guide, for rustdoc and its tests.
#[cfg(any(doc, doctest))]
pub mod guide;
pub mod histogram;
mod job;
mod limits;
mod link_figures;
pub mod links;
mod live;
pub mod main_device;
mod mapped;
pub mod memory;
#[cfg(feature = "network")]
pub mod network;
mod no_domain;
mod not_ready;
mod observer;
#[cfg(not(feature = "standby"))]
#[path = "alone.rs"]
mod of_two;
#[cfg(feature = "standby")]
mod of_two;
mod options;
mod pace;
#[cfg(feature = "packet")]
pub mod packet;
mod parts;
#[cfg(feature = "packet")]
pub mod piped;
mod probe;
mod process_data;
mod readiness;
#[cfg(feature = "daemon")]
mod record_requests;
#[cfg(any(feature = "eni", feature = "esi"))]
pub mod regular_file;
pub mod services;
#[cfg(feature = "sim")]
pub mod shared_segment;
#[cfg(feature = "sim")]
pub mod simulated;
#[cfg(any(feature = "packet", feature = "sim"))]
mod simulated_addresses;
#[cfg(feature = "standby")]
pub mod standby;
mod states;
mod stop;
mod subdevice;
pub mod supervisor_thread;
pub mod system_time;
#[cfg(feature = "packet")]
pub mod tee;
pub mod text;
#[cfg(feature = "tracing")]
mod trace;
mod value;
pub mod window;
mod words;

pub use acyclic::{AcyclicHalf, Inline};
pub use application::{Application, LastOutputs};
pub use cyclic_thread::{CyclicThread, Panicked};
pub use either_links::EitherLinks;
pub use error::Error;
pub use job::Job;
pub use limits::TransferLimits;
pub use link_figures::{LinkFigures, LinkRate};
pub use links::{Links, PerLink};
pub use live::LiveSubDevice;
pub use main_device::{MainDevice, Options, Refused, automatic};
pub use mapped::{DoesNotFit, Input, MapError, Mapped, MappedObject, ObjectOf, Output, OutputBits, Wanted, WriteError};
pub use no_domain::NoDomain;
pub use not_ready::{NotReady, Reason};
pub use observer::{DomainFmmu, DomainSnapshot, NoSnapshot, Observer, ProcessDataSnapshot, SnapshotRequest};
pub use pace::{Pace, Trigger};
pub use parts::ProbedParts;
pub use probe::{CycleJob, CycleProbe, FramesIn, JobProbe, JobTime, JobTimes};
pub use process_data::ProcessData;
pub use services::{Background, Services};
pub use stop::Deactivated;
pub use subdevice::{ListLengths, MailboxStatus, SubDevice, SubDeviceError, SubDeviceFailure, SubDeviceName};
pub use supervisor_thread::{Ended, SupervisorThread};
pub use value::{Number, ObjectValue};

pub use ringcat_engine::BlockedPort;
pub use ringcat_engine::PortOf;
pub use ringcat_engine::ReadPdos;
pub use ringcat_engine::RingInspection;
pub use ringcat_engine::ServiceError;
pub use ringcat_engine::SiiWritten;
pub use ringcat_engine::StopError;
pub use ringcat_engine::Urgency;
pub use ringcat_engine::config::{
    ClockConfig, ConfigAddress, ConfigError, DeclaredArea, DeclaredSyncManager, Expected, FileRead, FileWrite, Group,
    IdentityField, IdnRead, IdnWrite, IpSettings, MailMessage, ModeError, Passage, PdoAssignment, PdoEntry, PdoMapping,
    PulseGrid, ReferenceClock, RefusedPdos, RegisterAccess, RegisterCommand, SdoDownload, SdoUpload, StartupAction,
    StartupCommand, StateTimeout, SubDeviceConfig, SyncManagerRole, SyncSignals, Timeouts, Transition, Watchdog,
    WhenUnlocked, data_words,
};
pub use ringcat_engine::domain::{DomainId, DomainState, DomainStatus, Freshness};
pub use ringcat_engine::event::{
    ClientEvents, ClientId, Event, EventsSince, LogFilter, LogLevel, Message, MessageContent, MessagesSince, Occupant,
    StartupSource, Subject, Subjects, TimedEvent,
};
pub use ringcat_engine::exchange::{ClockDatagrams, ReferenceTime};
pub use ringcat_engine::exchange::{CopyError, CopyId, CopyRule, CyclicCounters, Entry, WhenStale};
pub use ringcat_engine::info::{AliasSource, DataWord, Direction, SiiAssignment, SiiExtent, SubDeviceInfo};
pub use ringcat_engine::knowledge::{Handover, Knowledge, KnowledgeError, KnownMailbox, KnownProgress, KnownSubDevice};
pub use ringcat_engine::layout::LrwPolicy;
pub use ringcat_engine::link::Link;
pub use ringcat_engine::mail::aoe::{AoeDeviceInfo, AoeError, AoeRoute, AoeStates};
pub use ringcat_engine::mail::coe::history::{History, HistoryMessage};
pub use ringcat_engine::mail::coe::information::{Entry as ObjectEntry, InformationError, Object};
pub use ringcat_engine::mail::coe::pdo_mail::PdoMailError;
pub use ringcat_engine::mail::coe::{SdoAddress, SdoError, SdoFailure};
pub use ringcat_engine::mail::foe::{FoeError, FoeFailure, FoeOptions, FoeProgress};
pub use ringcat_engine::mail::soe::command::CommandState;
pub use ringcat_engine::mail::soe::{SoeAddress, SoeError, SoeFailure};
pub use ringcat_engine::mail::voe::Voe;
pub use ringcat_engine::mail::{
    EmergencyRing, Limits, Mailbox, MailboxError, ReceivedEmergency, Unclaimed, Unsolicited,
};
pub use ringcat_engine::main_device::snapshot::{
    Activity, AcyclicSnapshot, CableSnapshot, ClockSnapshot, GroupSnapshot, LinkSnapshot, Progress, RingSnapshot,
    Snapshot, SubDeviceSnapshot,
};
pub use ringcat_engine::main_device::{
    ActivateError, Address, ClockStatus, Declaration, DeclaredGroup, DeclaredSubDevice, Directory, DomainConfig,
    DomainMember, EntryPlace, ExplicitLrw, Function, GroupId, GroupState, HiddenDelay, ImageMemory, LiveStatus,
    LostCopies, MAX_DATAGRAMS, MAX_UNDER_WAY, MainDevicePhase, Pending, Permission, RawDatagram, RegisterError,
    RegisteredArea, Required, Retries, SegmentStatus, SentOnce, SubDeviceId, SubDeviceState, SubDeviceStatus, WkcShare,
};
pub use ringcat_engine::main_device::{Denial, MainDeviceRole, NotPermitted};
pub use ringcat_engine::request::{
    RegisterRequest, Request, RequestFailure, RequestRefused, RequestState, RetryRequest, SdoRequest, SoeRequest,
    VoeHandler, VoeHeader,
};
pub use ringcat_engine::ring_status::{
    Cable, CableErrors, CableReport, LinkCounts, LinkStatus, Redundancy, RedundancyLoss, RingStatus,
};
pub use ringcat_engine::time::Instant;
pub use ringcat_engine::{Acknowledge, AlRegisters};
pub use ringcat_engine::{AcyclicCounters, BusError, Reply};
pub use ringcat_engine::{AreaPlan, MappedEntry, MappedPdo, PlanError, SubDevicePlan, plan};
pub use ringcat_engine::{Classified, Identity};
pub use ringcat_engine::{ClosingEvidence, JunctionConnection, JunctionError, JunctionMode};
pub use ringcat_engine::{ConfigureError, RegisterCommandError, RegisterFailure, StartupError, WrongValue};
pub use ringcat_engine::{DelayRange, Follower, phase_error};
pub use ringcat_engine::{EepromAssignment, EepromOwner, EepromOwnership};
pub use ringcat_engine::{FIRST_STATION, Scan, ScanError};
pub use ringcat_engine::{Found, Identified, Move, Rescan};
pub use ringcat_engine::{FrameLimit, MIN_DATAGRAMS_PER_FRAME, RingState};
pub use ringcat_engine::{Neighbour, PortRegisters, PortReport, SubDevicePorts};
pub use ringcat_engine::{NotFollowed, NotFollowedReason, StateScope, StatesError};
pub use ringcat_engine::{PortErrors, Statistics};
pub use ringcat_wire::address::{Position, RegisterAddress, StationAddress};
pub use ringcat_wire::al::{AlState, AlStatus, AlStatusCode};
pub use ringcat_wire::mailbox::coe::{DataType, ListType, ObjectCode};
pub use ringcat_wire::mailbox::eoe::AddressFilter;
pub use ringcat_wire::mailbox::soe::Idn;
pub use ringcat_wire::register::LoopControl;
pub use ringcat_wire::source_address::MacCodec;

pub use ringcat_engine::NotLocked;
pub use ringcat_engine::SetupError;
pub use ringcat_engine::StateError;
pub use ringcat_engine::Topology;
pub use ringcat_engine::config::SyncManagerOverride;
pub use ringcat_engine::event::history::Incident;
pub use ringcat_engine::exchange::Exchange;
pub use ringcat_engine::info::{ControllerInfo, InfoWarning, MailboxSyncManagers, PdoInfo, PdoSource};
pub use ringcat_engine::layout::LayoutError;
pub use ringcat_engine::mail::eoe::{EoeError, EoeFailure, EthernetCounters, EthernetRate, EthernetStatus};
pub use ringcat_engine::mail::stream::{Overflow, Sink, Source};
pub use ringcat_engine::mail::{Conversation, Lane, MailCounters, MailboxSizes};
#[cfg(feature = "engine")]
pub use ringcat_engine::main_device::MainDevice as Engine;
pub use ringcat_engine::main_device::{AreaEntries, EthernetSubDevice, PlacedEntry};
pub use ringcat_engine::{PdoPlan, PlanFault, PlanProblem, PlanWarning, SmPlan};
pub use ringcat_engine::{SiiProgramError, SiiReadError};
#[cfg(feature = "packet")]
pub use ringcat_link::pcapng::Direction as FrameDirection;
#[cfg(feature = "packet")]
pub use ringcat_link::recorder::{AlreadyRead, FrameNote, FrameReader, Recorded, Recorder, RecorderError, Tap, Taps};
#[cfg(feature = "engine")]
pub use services::key::EngineKey;

#[cfg(any(feature = "eni", feature = "esi"))]
pub use ringcat_config as config;
#[cfg(feature = "packet")]
pub use ringcat_link::realtime;
#[cfg(feature = "sim")]
pub use ringcat_sim as sim;
pub use ringcat_wire as wire;
