//! How a thread waits for frames; [`crate::wait`] implements it.

use std::time::Duration;

/// How to wait.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum ReceiveMode {
    /// Sleeps in the kernel.
    #[default]
    Blocking,
    /// Polls the receive rings.
    BusyPoll,
    /// Sleeps until shortly before the usual return of a frame, then polls for this time, then sleeps.
    Hybrid {
        /// Time to poll: longer than the variation of the return. Frames that return within 50 us are polled for from
        /// the start.
        spin: Duration,
    },
}
