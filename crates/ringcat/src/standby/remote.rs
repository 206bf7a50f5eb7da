//! Remote access to one of two MainDevices over TCP (protocol AC-08, REQ037): its state, requests for a role, permanent
//! standby on and off.
//!
//! [`RemoteServer`] answers clients in a thread of its own, which does not disturb the cycles: it reads data that other
//! threads publish, and sends queries to the thread of the acyclic half. [`RemoteClient`] is a client. Both need the
//! same [`RemoteToken`]. The messages are not encrypted: over a network that others use, forward the port through SSH.
//! Needs the feature `daemon`.

mod client;
mod connection;
mod server;
mod token;

pub use ringcat_control::remote::{REMOTE_VERSION, RemoteCounters, RemoteRole, RemoteState};

pub use self::client::{RemoteClient, RemoteError};
pub use self::server::{RemoteOptions, RemoteServer};
pub use self::token::{RemoteToken, TokenError};
