//! The model of the segment: the SubDevices of the last scan, and once an application is active the state of
//! SubDevices, cables, rings, links and clocks, and the effects of observations.
//!
//! A pure machine: [`Segment::observe`] takes one [`Observation`] and returns the [`Effects`]: events to report,
//! procedures to start. Nothing else changes it. It does not send or wait; procedures do this, and return their results
//! as observations. Words for the cyclic half are posted to the board within `observe`, before any effect is executed.
//!
//! A scan takes time, and the segment changes meanwhile. So results contain the versions at their start ([`Versions`],
//! the number of an attempt), and outdated results are refused.

mod addressed;
mod addresses;
mod ascent;
mod attention;
mod breaks;
mod cable_watch;
mod cabling;
mod choices;
pub mod clocks;
mod crossings;
mod damper;
pub mod disturbance;
pub mod effect;
pub mod findings;
mod hot_connect;
mod idle;
mod key;
mod knowledge;
mod link_order;
mod local_rings;
mod matching;
pub mod member;
mod model;
mod observation;
mod order;
mod owners;
mod pdo_finding;
mod port_control;
mod reading;
mod repair;
pub mod retrace;
mod ring;
mod round_result;
mod rules;
mod scan;
mod seen;
pub mod setup;
mod silence;
mod stage;
pub mod start;
mod subdevice;
mod subdevices;
mod temporary_address;
pub mod unassigned;
mod undeclared;
mod versions;
pub mod view;
mod wake;
mod words;

pub use addressed::Addressed;
pub use ascent::longest_ascent;
pub use cabling::{Cabling, stations_by_position, type_of};
pub use choices::{Choices, ReadPdos, Retries};
pub use crossings::{Crossing, LineCheck, PORT_BITS, is_swapped};
pub use hot_connect::counts;
pub use idle::{Change, Differences, IdleObservation};
pub use key::SubDeviceKey;
pub use link_order::LinkObservation;
pub use local_rings::is_down;
pub use model::{Declared, Segment};
#[cfg(feature = "standby")]
pub use observation::StandbyObservation;
pub use observation::{MemberFinding, More, Observation, Problem, ProcessDataStep};
pub use owners::Owners;
pub use pdo_finding::PdoFinding;
pub use port_control::BlockedPort;
pub use reading::Reading;
pub use round_result::RoundResult;
pub use scan::{Found, Scan};
pub use seen::Seen;
pub use subdevice::SubDevice;
pub use subdevices::SubDevices;
pub use temporary_address::TemporaryAddress;
pub use undeclared::{AttemptFailure, KeptState, ShownState, StateRead, UndeclaredObservation, UpkeepProgress};
pub use versions::Versions;
pub use words::{Changes, Words};

#[cfg(test)]
mod tests;
