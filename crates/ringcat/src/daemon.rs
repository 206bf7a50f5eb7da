//! The bus of a master from the daemon `ringcatd`.
//!
//! The daemon drives a segment while no application does. [`OwnedBus::take`] takes it over without a scan: descriptors
//! of the links and what is known of the segment come over a Unix socket. From then on the application drives it from
//! its own process, at full speed and without a privilege. [`OwnedBus::release`], the end of the process, also by a
//! crash, or SIGKILL give it back.
//!
//! ```no_run
//! use std::path::Path;
//! use std::time::Duration;
//!
//! use ringcat::daemon::{DEFAULT_SOCKET, OwnedBus};
//! use ringcat::{Options, automatic};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut bus = OwnedBus::take(Path::new(DEFAULT_SOCKET), 0, "example", &Options::default(), || ())?;
//! let found = bus.supervisor().with(|engine| engine.subdevices())?;
//! let links = bus.take_links().ok_or("the links are in use")?;
//! let declaration = automatic(&found, Duration::from_millis(1));
//! let mut application = bus.supervisor().clone().activate(declaration, links)?;
//! application.wait_until_op(Duration::from_secs(10))?;
//! # Ok(())
//! # }
//! ```

mod error;
mod links;
mod owned;
mod questions;
pub mod serving;

pub use error::DaemonError;
pub use links::DaemonLinks;
pub use owned::OwnedBus;
pub use ringcat_control::DEFAULT_SOCKET;
pub use ringcat_control::client::{Client, ClientError};
pub use ringcat_control::message::{Answer, Ask, MasterState, Right};
