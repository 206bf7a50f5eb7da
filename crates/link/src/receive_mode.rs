//! How a thread waits for frames, as a socket's owner chooses it; [`crate::wait`] does it.

use std::time::Duration;

/// How to wait.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ReceiveMode {
    /// Asleep in the kernel.
    #[default]
    Blocking,
    /// Spinning on the rings.
    BusyPoll,
    /// Spinning for this long, then asleep.
    Hybrid {
        /// How long: a little more than frames usually take.
        spin: Duration,
    },
}
