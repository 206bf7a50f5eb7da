//! What a look at one SubDevice has shown.

use ringcat_wire::al::{AlStatus, AlStatusCode};
use ringcat_wire::register::DlStatus;

/// What a SubDevice said.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Look {
    /// Its frames were lost: nothing is known.
    #[default]
    Unknown,
    /// Frames came back, it did not answer.
    Silent,
    /// Several answered: another SubDevice has its address too.
    Doubled,
    /// It answered.
    Answer {
        /// AL status.
        status: AlStatus,
        /// AL status code.
        code: AlStatusCode,
        /// Its ports.
        dl_status: DlStatus,
    },
}

impl Look {
    /// It answered.
    pub const fn is_answer(&self) -> bool {
        matches!(self, Look::Answer { .. })
    }
}

/// How many answered.
pub(super) fn answers(looks: &[Look]) -> usize {
    looks.iter().filter(|look| look.is_answer()).count()
}
