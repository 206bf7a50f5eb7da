//! When the model has to evaluate posted words again.

use crate::time::Instant;

/// When posted words have to be evaluated again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wake {
    /// At this time.
    pub at: Instant,
    /// With the next supervision result, also if it is equal to the last one.
    pub with_result: bool,
}

impl Wake {
    /// No evaluation without other words.
    pub const NEVER: Wake = Wake { at: Instant::NEVER, with_result: false };
    /// With the next supervision result.
    pub const RESULT: Wake = Wake { with_result: true, ..Wake::NEVER };

    /// At a time.
    pub const fn at(at: Instant) -> Wake {
        Wake { at, ..Wake::NEVER }
    }

    /// The earlier one of both.
    #[must_use]
    pub fn or(self, other: Wake) -> Wake {
        Wake { at: self.at.min(other.at), with_result: self.with_result || other.with_result }
    }
}
