//! Result of a read of one SubDevice in a round.

use ringcat_wire::al::{AlStatus, AlStatusCode};
use ringcat_wire::register::DlStatus;

use super::undeclared::ShownState;

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

impl From<Reading> for ShownState {
    fn from(reading: Reading) -> ShownState {
        match reading {
            Reading::Unknown => ShownState::Unknown,
            Reading::Silent | Reading::Doubled => ShownState::Elsewhere,
            Reading::Answer { status, code, .. } => ShownState::Shown((status, code)),
        }
    }
}

impl Reading {
    /// It answered.
    pub const fn is_answer(&self) -> bool {
        matches!(self, Reading::Answer { .. })
    }
}

/// Number of answers.
pub(super) fn answers(readings: &[Reading]) -> usize {
    readings.iter().filter(|reading| reading.is_answer()).count()
}
