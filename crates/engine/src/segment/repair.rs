//! Repeated configurations of a member that lost registers that were written to it.

use alloc::string::String;

/// Consecutive repetitions for the same difference. If the difference changes each time, the count restarts.
const ATTEMPTS: u8 = 3;

/// The difference at the last repeated configuration, and the number of repetitions without success.
#[derive(Debug, Default)]
pub struct Repair {
    reason: String,
    tries: u8,
}

impl Repair {
    /// A repetition has not yet succeeded.
    pub fn is_under_way(&self) -> bool {
        self.tries > 0
    }

    /// Counts a repetition because of a difference. False if it has been repeated often enough.
    pub(super) fn begin(&mut self, reason: &str) -> bool {
        if self.reason != reason {
            *self = Repair { reason: reason.into(), tries: 0 };
        }
        let is_useful = self.tries < ATTEMPTS;
        self.tries += u8::from(is_useful);
        is_useful
    }
}
