//! The words that the exchange posts: the only module that reads them, and compares them with earlier ones.
//!
//! The fields of [`Words`] are visible here only, so a rule cannot compare them on its own. Several questions are asked
//! of the same words, and each has a reference of its own in the [`Reader`], because the model answers them at
//! different times: since the words before, since the last round of reads, since the ring was reported, since the last
//! answer, since the last scan. The supervisor also compares words, to wake the procedure that passes them on
//! (`supervisor/watching.rs`), and decides nothing.

mod answers;
mod broadcasts;
mod changes;
mod counts;
mod posted;
mod ring_changes;
mod round;

pub use broadcasts::Broadcast;
pub use changes::Changes;
pub use posted::Words;

use self::answers::LastAnswer;
use self::broadcasts::SinceScan;
use self::changes::SinceBefore;
use self::counts::SteadyCounts;
use self::ring_changes::SinceReport;
use self::round::SinceRound;

/// The references with which words are compared, one for each question.
#[derive(Debug, Default)]
pub(super) struct Reader {
    /// The words before.
    pub before: SinceBefore,
    /// The words at the beginning of the last round of reads.
    pub round: SinceRound,
    /// The ring as it was processed last.
    pub ring: SinceReport,
    /// SubDevices that answer while the ring does not change.
    pub counts: SteadyCounts,
    /// The last result with an answer.
    pub answer: LastAnswer,
    /// Without an application: the last scan.
    pub scan: SinceScan,
}

impl Reader {
    /// Broadcasts follow, without an application.
    pub fn begin_idle(&mut self) {
        self.ring = SinceReport::default();
        self.counts = SteadyCounts::default();
        self.scan = SinceScan::default();
    }
}
