//! How a thread waits for frames; [`crate::wait`] implements it.

use std::time::Duration;

/// How to wait.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ReceiveMode {
    /// Sleeps in the kernel.
    #[default]
    Blocking,
    /// Polls the receive rings.
    BusyPoll,
    /// Polls for this time, then sleeps.
    Hybrid {
        /// Time to poll: slightly longer than the usual round trip of a frame.
        spin: Duration,
    },
}
