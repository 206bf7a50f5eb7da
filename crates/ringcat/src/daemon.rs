//! The bus of a master from the daemon `ringcatd`.
//!
//! The daemon drives a segment while no application does. [`OwnedBus::take`] takes it over without a scan: descriptors
//! of the links and what is known of the segment come over a Unix socket. From then on the application drives it from
//! its own process, at full speed and without a privilege. [`OwnedBus::release`], the end of the process, also by a
//! crash, or SIGKILL give it back.
//!
//! ```no_run
//! use std::time::Duration;
//!
//! use ringcat::daemon::OwnedBus;
//! use ringcat::{Options, automatic};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut bus = OwnedBus::request(0, &Options::default())?;
//! let found = bus.scan()?.subdevices;
//! let mut application = bus.activate(automatic(&found, Duration::from_millis(1)))?;
//! application.wait_until_op(Duration::from_secs(10))?;
//! # Ok(())
//! # }
//! ```

mod application;
mod bus_log;
mod debug_interfaces;
mod error;
mod ethernet;
mod frame_record;
#[cfg(feature = "eoe")]
mod interfaces;
mod links;
mod orders;
mod owned;
mod ownership;
mod query_threads;
mod received;
mod receiver;
mod record_files;
mod refusing;
pub mod serving;
mod settings;
mod tool;

pub use application::socket;
pub use bus_log::{BusLog, Followed, Lines, OperatorLines, Priority};
pub use debug_interfaces::DebugInterfaces;
pub use error::DaemonError;
pub use frame_record::{FrameRecord, LastWritten, RecordError};
pub use links::{DaemonLinks, adopt_links};
pub use owned::OwnedBus;
pub use ownership::{Ownership, OwnershipWatch};
pub use record_files::RecordReason;
pub use ringcat_control::DEFAULT_SOCKET;
pub use ringcat_control::client::{Client, ClientError};
pub use ringcat_control::message::SegmentOverview;
pub use ringcat_control::message::{Answer, HandedBus, HandedLink, HandedLinks, MasterState, Query, Right};
pub use ringcat_control::refusal::{Refusal, ServiceFault};
pub use ringcat_control::settings::{BusSettings, DebugRing};
pub use ringcat_control::socket::to_connect_to as find_socket;
pub use ringcat_control::tool as known;
pub use settings::options_with;
