//! What activation hands out.

use alloc::vec::Vec;
use core::time::Duration;

use super::areas::Directory;
use crate::exchange::Exchange;

/// What activation hands out.
#[derive(Debug)]
pub struct Active {
    /// The cyclic half.
    pub exchange: Exchange,
    /// Where PDO entries lie.
    pub directory: Directory,
    /// Periods of the domains. There is at least one domain, if only for supervision.
    pub periods: Vec<Duration>,
    /// Most cycles of a domain that may be under way at once.
    pub under_way: u8,
}
