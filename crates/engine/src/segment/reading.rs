//! Result of a read of one SubDevice in a round.

use ringcat_wire::al::{AlStatus, AlStatusCode};
use ringcat_wire::register::DlStatus;

/// Result of the read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reading {
    /// Its frames were lost: no information.
    #[default]
    Unknown,
    /// Frames returned without its answer.
    Silent,
    /// Several answered: another SubDevice has the same address.
    Doubled,
    /// It answered.
    Answer {
        /// AL status.
        status: AlStatus,
        /// AL status code.
        code: AlStatusCode,
        /// Its port states.
        dl_status: DlStatus,
    },
}

impl Reading {
    /// Its station address is not, or not only, its own.
    pub const fn is_elsewhere(&self) -> bool {
        matches!(self, Reading::Silent | Reading::Doubled)
    }

    /// It answered.
    pub const fn is_answer(&self) -> bool {
        matches!(self, Reading::Answer { .. })
    }
}

/// Number of answers.
pub(super) fn answers(readings: &[Reading]) -> usize {
    readings.iter().filter(|reading| reading.is_answer()).count()
}
