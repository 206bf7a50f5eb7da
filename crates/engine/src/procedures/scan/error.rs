//! Why a scan ended without a result.

use core::fmt;
use core::time::Duration;

use ringcat_wire::address::Position;

use super::stations::MAX_SUBDEVICES;
use crate::procedures::sii::SiiReadError;
use crate::ring::FrameLimit;
use crate::ring_status::LinkCounts;
use crate::supervisor::BusError;

/// Why a scan ended without a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ScanError {
    /// Frames returned, but no SubDevice had processed them.
    NoSubDevices,
    /// No frame returned.
    NoAnswer,
    /// The count did not settle.
    Unsettled {
        /// The last two counts.
        counts: [u16; 2],
    },
    /// The segment changed repeatedly during the scan.
    Changed {
        /// SubDevices on each link at the beginning.
        before: LinkCounts,
        /// At the end.
        after: LinkCounts,
    },
    /// The knowledge of another process was compared with the segment, and differed again after each scan.
    Unstable {
        /// Number of scans.
        scans: u32,
        /// Time since the beginning.
        within: Duration,
    },
    /// Frames with as many datagrams as fit return unprocessed.
    FrameLimit(FrameLimit),
    /// More SubDevices than station addresses.
    TooMany {
        /// SubDevices counted.
        count: u32,
    },
    /// The bus failed.
    Bus(BusError),
    /// The SII of a SubDevice cannot be read.
    Sii {
        /// Its position.
        position: Position,
        /// The error.
        error: SiiReadError,
    },
    /// The role of the MainDevice became INACTIVE meanwhile.
    RoleChanged,
}

impl fmt::Display for ScanError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ScanError::NoSubDevices => f.write_str("frames return, but no SubDevice processes them"),
            ScanError::NoAnswer => {
                f.write_str("no frame returns: is the cable plugged and the first SubDevice powered?")
            }
            ScanError::Unsettled { counts: [a, b] } => {
                write!(f, "the number of SubDevices does not settle: {a}, then {b}")
            }
            ScanError::Changed { before, after } => write!(
                f,
                "the segment changes while it is scanned: {} SubDevices on the main and {} on the redundant link, then \
                 {} and {}",
                before.main, before.redundant, after.main, after.redundant
            ),
            ScanError::Unstable { scans, within } => {
                let within = within.as_millis();
                write!(
                    f,
                    "the segment differs again after each of {scans} scans within {within} ms: a cable may be loose"
                )
            }
            ScanError::FrameLimit(limit) => limit.fmt(f),
            ScanError::TooMany { count } => write!(f, "{count} SubDevices, at most {MAX_SUBDEVICES} are possible"),
            ScanError::Bus(error) => error.fmt(f),
            ScanError::Sii { position, error } => write!(f, "SubDevice at position {position}: {error}"),
            ScanError::RoleChanged => f.write_str("the role of the MainDevice became INACTIVE during the scan"),
        }
    }
}

impl core::error::Error for ScanError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            ScanError::Bus(error) => Some(error),
            ScanError::Sii { error, .. } => Some(error),
            _ => None,
        }
    }
}

impl From<BusError> for ScanError {
    fn from(error: BusError) -> ScanError {
        ScanError::Bus(error)
    }
}

impl ScanError {
    /// The segment or lost frames may be the cause, so another attempt is useful.
    pub(super) const fn is_passing(&self) -> bool {
        match self {
            ScanError::Bus(_) | ScanError::Changed { .. } => true,
            ScanError::Sii { error, .. } => error.is_passing(),
            ScanError::NoSubDevices
            | ScanError::NoAnswer
            | ScanError::Unsettled { .. }
            | ScanError::Unstable { .. }
            | ScanError::FrameLimit(_)
            | ScanError::TooMany { .. }
            | ScanError::RoleChanged => false,
        }
    }
}
