//! What a finding of clocks was asked of: the model refuses those that are outdated, each for its fact.

use ringcat_wire::address::StationAddress;

/// A clock as a procedure has known it: its station address, and how often it had lost its registers by then. A finding
/// of earlier registers is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ClockKey {
    /// Its station address.
    pub station: StationAddress,
    /// How often it had lost its registers.
    pub losses: u32,
}

/// Numbers of changes of the clocks. They go on from one application to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ClockChanges {
    /// Set-ups of all clocks that have begun.
    pub set_ups: u32,
    /// Changes of delays, of the links of clocks, and of references.
    pub delays: u32,
    /// How often the delays have become doubtful.
    pub doubts: u32,
    /// Changes of all offsets: jumps and steps of the time.
    pub offsets: u32,
}

impl ClockChanges {
    /// The values with which another application begins.
    pub const fn of_next(self) -> ClockChanges {
        ClockChanges { set_ups: self.set_ups.wrapping_add(1), ..self }
    }
}

/// The version of the clocks, for a procedure that starts now.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ClockVersions {
    /// Changes of the clocks.
    pub changes: ClockChanges,
    /// Number of times that SubDevices had been put out of reach on purpose.
    pub isolations: u32,
    /// Stops of the distribution.
    pub holds: u32,
}
