//! Time of the last returned frame.

use crate::time::Instant;

/// Time of the last returned frame.
#[derive(Debug, Default)]
pub(super) struct Silence {
    /// Number of the last supervision result with an answer, the time of its arrival, and the cycles sent by then.
    pub last: Option<(Option<u32>, Instant, u64)>,
    /// Earliest time of the next check.
    pub next: Instant,
    /// It was reported that no frame returns.
    pub is_blocked: bool,
}
