//! Operation without an application: how the last scan compares with the broadcasts since, and rescans on request.
//!
//! One procedure at a time works on the segment; broadcasts are evaluated when it has ended.

mod change;
mod differences;
mod observation;

pub use change::Change;
pub use differences::Differences;
pub use observation::IdleObservation;

use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;

use crate::ring_status::LinkCounts;

/// Consecutive broadcasts without an answer after which no SubDevice is connected.
pub(super) const SILENT: u8 = 3;
/// Consecutive failures of a scan after which they are reported.
pub(super) const PATIENCE: u32 = 20;

/// How the last scan compares with the broadcasts since.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Comparison {
    /// No broadcast was compared with it yet.
    #[default]
    Open,
    /// It shows the present segment, with these SubDevices on each link.
    Same(LinkCounts),
    /// The segment has changed since.
    Changed {
        /// Consecutive attempts to follow that have failed.
        failures: u32,
        /// The failures were reported.
        is_reported: bool,
    },
}

impl Comparison {
    /// A change that no attempt has followed yet.
    pub const CHANGED: Comparison = Comparison::Changed { failures: 0, is_reported: false };
}

/// Rescans on request.
#[derive(Debug, Default)]
pub(super) struct Rescans {
    /// Number of the last request.
    pub asked: u64,
    /// Number of the last request with a result, and the result.
    pub ended: (u64, Differences),
}

/// The procedure of idle operation that works on the segment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Work {
    /// No procedure.
    #[default]
    Nothing,
    /// The first scan.
    FirstScan,
    /// The scan after a change, or by request, while it gives addresses or changes ports.
    Follow,
    /// The same scan while it only reads EEPROMs, which may take long.
    FollowReads,
    /// Reads of all states.
    ReadStates,
    /// Delays are measured: the ring is open on purpose.
    Measurement,
    /// The end of an application.
    Deactivation,
}

/// Operation without an application.
#[derive(Debug, Default)]
pub(super) struct Idle {
    pub compared: Comparison,
    /// Consecutive broadcasts without an answer.
    pub silent: u8,
    /// The procedure that works on the segment.
    pub work: Work,
    /// Changes that broadcasts have shown, also while a procedure works.
    pub changes: u32,
    /// Former station addresses of SubDevices that the scan under way has given others.
    pub readdressed: Vec<StationAddress>,
    pub rescans: Rescans,
}

impl Idle {
    /// A new beginning, with other numbers of requests than before. A deactivation goes on.
    pub fn renewed(&self) -> Idle {
        let asked = self.rescans.asked;
        let work = if self.work == Work::Deactivation { Work::Deactivation } else { Work::Nothing };
        let rescans = Rescans { asked, ended: (asked, Differences::default()) };
        Idle { work, rescans, changes: self.changes, ..Idle::default() }
    }

    /// A procedure has ended. Another one may be under way since.
    pub fn end(&mut self, work: Work) {
        if self.work == work {
            self.work = Work::Nothing;
        }
    }

    /// The scan under way only reads EEPROMs from now on, or no longer.
    pub fn read(&mut self, is_reading: bool) {
        match (self.work, is_reading) {
            (Work::Follow, true) => self.work = Work::FollowReads,
            (Work::FollowReads, false) => self.work = Work::Follow,
            _ => {}
        }
    }

    /// Whether broadcasts show the segment as it is: no procedure changes ports or addresses.
    pub fn is_visible(&self) -> bool {
        matches!(self.work, Work::Nothing | Work::ReadStates | Work::FollowReads)
    }

    /// The number of the last request for a rescan, if it has no result yet.
    pub fn wanted(&self) -> Option<u64> {
        Some(self.rescans.asked).filter(|asked| *asked > self.rescans.ended.0)
    }
}
