//! Why process data of a SubDevice is sent once in a cycle, where lost frames are sent again (decision 0045).

use core::fmt;

/// Why not all process data of a SubDevice is sent again when its frame is lost: a lost frame may cost it a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum SentOnce {
    /// Outputs: it has CoE, and no start-up command selects free run, so each write may be an event for it. Inputs are
    /// read again.
    SmSynchronous,
    /// Outputs and inputs: a SyncManager has one buffer.
    OneBuffer,
    /// Outputs and inputs: it was absent at the scan, or its SII is not usable.
    Unknown,
    /// Outputs, by declaration ([`Repetition::Inputs`](crate::config::Repetition::Inputs)).
    OutputsDeclared,
    /// Outputs and inputs, by declaration ([`Repetition::Nothing`](crate::config::Repetition::Nothing)).
    Declared,
}

impl fmt::Display for SentOnce {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            SentOnce::SmSynchronous => "outputs are sent once: it has CoE and is not declared to run free",
            SentOnce::OneBuffer => "outputs and inputs are sent once: a SyncManager has one buffer",
            SentOnce::Unknown => "outputs and inputs are sent once: it was absent at the scan or has no usable SII",
            SentOnce::OutputsDeclared => "outputs are sent once, as declared",
            SentOnce::Declared => "outputs and inputs are sent once, as declared",
        })
    }
}
