//! When frames came back last.

use crate::time::Instant;

/// When frames came back last.
#[derive(Debug, Default)]
pub(super) struct Silence {
    /// Number of the last supervision result with an answer, when it was seen, and how many cycles had been sent by
    /// then.
    pub last: Option<(Option<u32>, Instant, u64)>,
    /// Not looked at before then.
    pub next: Instant,
    /// It was reported that none comes back.
    pub is_blocked: bool,
}
