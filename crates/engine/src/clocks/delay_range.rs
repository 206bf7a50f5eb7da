//! Limits of a propagation delay that receive times leave open (protocol 7.1).

use core::fmt;

/// Limits of a propagation delay from the reference clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct DelayRange {
    /// Lower limit in nanoseconds.
    pub least_ns: i64,
    /// Upper limit in nanoseconds.
    pub most_ns: i64,
}

impl DelayRange {
    /// From a lower to an upper limit in nanoseconds.
    pub const fn new(least_ns: i64, most_ns: i64) -> DelayRange {
        DelayRange { least_ns, most_ns }
    }
}

impl fmt::Display for DelayRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} to {} ns", self.least_ns, self.most_ns)
    }
}
