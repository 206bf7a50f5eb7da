//! The EtherCAT MainDevice as a pure machine: frames, time and requests go in; frames, deadlines and events come out.
//!
//! No socket, thread, clock or log sink is in here; `now` is always an argument. So the same code runs on a network
//! interface in a real-time thread and in a test with a thousand SubDevices in virtual time.
//!
//! Two halves share nothing but the wire, a few atomics (`board`) and a bounded queue (`queue`):
//!
//! * [`exchange`]: the cyclic half. Process data and one supervision datagram. After activation it neither allocates
//!   nor locks nor waits, and its work per call is bounded.
//! * `supervisor`: everything else, as async `procedures` over an executor with injected time: scan, configuration,
//!   state changes, recovery. Mailboxes have a router each: [`mail`].
//!
//! Both send through `ring`, which marks frames, pairs the copies that travel both ways, and merges them.
#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;
#[cfg(test)]
extern crate std;

pub(crate) mod board;
pub(crate) mod clocks;
pub mod config;
pub mod declared;
pub mod direction;
pub mod domain;
pub mod event;
pub mod exchange;
pub mod info;
pub(crate) mod junction;
pub mod knowledge;
pub mod layout;
pub mod link;
pub mod mail;
pub mod main_device;
mod order;
pub(crate) mod plan;
pub(crate) mod procedures;
pub(crate) mod queue;
pub mod request;
mod request_counter;
pub(crate) mod ring;
pub mod ring_status;
pub mod role;
pub(crate) mod segment;
#[cfg(feature = "standby")]
pub mod standby;
pub(crate) mod supervisor;
pub mod time;
pub(crate) mod topology;

pub use board::Board;
pub use clocks::{DelayRange, Follower, phase_error};
pub use declared::Move;
pub use junction::{ClosingEvidence, HEAD_PORT, JunctionConnection, JunctionError, JunctionMode, START_PORT};
pub use plan::{
    AreaPlan, MappedEntry, MappedPdo, PdoPlan, PlanError, PlanFault, PlanProblem, PlanWarning, SmPlan, SubDevicePlan,
    plan,
};
pub use procedures::al_state::StateError;
pub use procedures::clocks::NotLocked;
pub use procedures::configure::{
    ConfigureError, RegisterCommandError, RegisterFailure, SetupError, StartupError, WrongValue,
};
pub use procedures::inspect_ring::{RingInspection, inspect_ring};
pub use procedures::request_states::{NotFollowed, NotFollowedReason, StateScope, StatesError};
pub use procedures::scan::{FIRST_STATION, Scan, ScanError};
pub use procedures::services::ServiceError;
pub use procedures::services::eeprom_owner::{EepromAssignment, EepromOwner, EepromOwnership};
pub use procedures::services::forced_state::{Acknowledge, AlRegisters};
pub use procedures::services::port_report::{Neighbour, PortRegisters, PortReport, SubDevicePorts};
pub use procedures::services::ports::BlockedPort;
pub use procedures::services::registers::Urgency;
pub use procedures::services::statistics::{PortErrors, Statistics};
pub use procedures::sii::SiiReadError;
pub use procedures::sii::program::{SiiProgramError, SiiWritten};
pub use procedures::stop::StopError;
pub use procedures::unassigned::rescan::{Found, Identified, Rescan};
pub use queue::{Consumer, queue};
pub use ring::identity::{Class, Classified, class_of};
pub use ring::{FrameLimit, Identity, MAX_IN_FLIGHT, MIN_DATAGRAMS_PER_FRAME, RingState};
pub use segment::ReadPdos;
pub use supervisor::long_transfers::{TransferKind, TransferProgress};
pub use supervisor::{AcyclicCounters, Bus, BusError, Reply, Supervisor, UnderWay};
pub use topology::{Closing, PortOf, Topology};
