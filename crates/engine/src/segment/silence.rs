//! Check for frames that do not return.

use crate::time::Instant;

/// Check for frames that do not return.
#[derive(Debug, Default)]
pub(super) struct Silence {
    /// Earliest time of the next check.
    pub next: Instant,
    /// It was reported that no frame returns.
    pub is_blocked: bool,
}
