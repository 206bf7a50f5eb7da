//! Result of the activation.

use alloc::vec::Vec;
use core::time::Duration;

use super::declaration::areas::Directory;
use super::live_status::LiveStatus;
use crate::exchange::Exchange;

/// Result of the activation.
#[derive(Debug)]
#[non_exhaustive]
pub struct Active {
    /// The cyclic half.
    pub exchange: Exchange,
    /// Places of PDO entries.
    pub directory: Directory,
    /// Periods of the domains. There is at least one domain, possibly only for supervision.
    pub periods: Vec<Duration>,
    /// State of SubDevices and links, for any thread.
    pub live_status: LiveStatus,
    /// Maximum number of cycles of a domain under way at once.
    pub under_way: u8,
}
