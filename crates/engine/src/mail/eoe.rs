//! EoE: Ethernet through a mailbox, and the addresses of the IP stack behind it (protocol 6.5).
//!
//! An [`EthernetPort`] takes whole Ethernet frames for a SubDevice and returns received frames. Its task cuts frames
//! into fragments and writes them in a lane of their own, so that they alternate with the other protocols; received
//! fragments are joined as they arrive. The cycle of the application does not limit the rate: fragments follow as fast
//! as the SubDevice accepts and sends them. The parts:
//!
//! * `fragments`, `reassembly`: frames to fragments and back;
//! * `traffic`: queues and counters of one mailbox; [`port`]: the handle;
//! * [`settings`]: IP parameters and address filter; [`error`]: why setting or reading them failed.

pub mod error;
mod fragments;
pub mod port;
mod reassembly;
pub mod settings;
mod traffic;

pub use crate::config::IpSettings;
pub use error::{EoeError, EoeFailure};
pub use port::EthernetPort;
pub use reassembly::MAX_FRAME;
pub use settings::{read_filter, read_ip, set_filter, set_ip};
pub use traffic::{EthernetCounters, EthernetFrame, EthernetRate, EthernetStatus, QUEUE, QueueError, TimeStamp};

pub(super) use traffic::Traffic;
