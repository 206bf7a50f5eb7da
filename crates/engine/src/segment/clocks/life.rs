//! Phases of the clocks of a segment: from the declaration to the lock, and from each change to the next measurement.

use alloc::collections::BTreeMap;
use alloc::string::String;

use ringcat_wire::address::StationAddress;

use crate::clocks::SyncWindow;
use crate::link::Link;
use crate::time::Instant;

/// Phases of the clocks of a segment.
#[derive(Debug)]
pub enum Life {
    /// No distributed clocks are declared.
    Undeclared,
    /// The first set-up is under way. It closes no branch.
    Starting,
    /// The first set-up is under way. It closes branches of forks without a clock: SubDevices there do not answer.
    StartingWithoutBranches,
    /// No set-up has succeeded. With the reason that was reported last.
    NotSetUp(Option<String>),
    /// Delays and offsets are written.
    Running(Running),
}

/// The state of clocks that were set up.
#[derive(Debug, Default)]
pub struct Running {
    /// The static drift compensation.
    pub compensation: Compensation,
    /// Whether the known delays are valid.
    pub delays: Delays,
    /// Known values that are not yet written.
    pub unwritten: Unwritten,
    /// The registers to write next.
    pub due: Due,
    /// Whether all required clocks have reached the window.
    pub lock: Lock,
    /// The links of the last answers, if they contradict the known links: the next answers must confirm them.
    pub unconfirmed: Option<BTreeMap<StationAddress, Option<Link>>>,
}

/// The static drift compensation: while it runs, differences do not show the accuracy of the cyclic distribution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Compensation {
    /// It is under way.
    Running,
    /// It has ended, or has not begun.
    #[default]
    Idle,
}

/// Whether the known delays are those of the segment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Delays {
    /// The known delays are those of the segment.
    #[default]
    Valid,
    /// The segment has changed since they were measured, first at this time.
    Doubtful(Instant),
}

/// Known delays that are not yet written, by link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unwritten {
    /// Links with such delays.
    pub links: [bool; 2],
    /// Clocks with a changed delay.
    pub clocks: usize,
    /// The largest change.
    pub largest_ns: u32,
}

/// The registers to write next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Due {
    /// No registers.
    #[default]
    Nothing,
    /// Delays, before any time is distributed again.
    Delays,
    /// Filter depths.
    Filters,
    /// Offsets: the application's time is another one. No time is distributed until they are written.
    Offsets,
}

/// Whether all required clocks have reached the window.
#[derive(Debug, Default)]
pub enum Lock {
    /// Not all have reached it yet.
    #[default]
    Open,
    /// All have reached it. While some clocks receive the time predicted by the host, this evaluates the differences.
    Locked(SyncWindow),
}
