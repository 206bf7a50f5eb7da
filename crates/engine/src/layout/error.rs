//! Errors of the layout of process data.

use core::fmt;
use core::time::Duration;

use crate::declared::SubDeviceId;
use ringcat_wire::datagram::MAX_DATA;

/// Why domains cannot be laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum LayoutError {
    /// An area is longer than a datagram can carry.
    AreaTooLong {
        /// Index of the SubDevice.
        subdevice: SubDeviceId,
        /// SyncManager.
        sync_manager: u8,
        /// Its bytes.
        length: u16,
    },
    /// Logical addresses or images beyond 2 GiB.
    TooLarge,
    /// More frames than may be on the wire at once.
    TooManyFrames {
        /// Number of frames needed.
        frames: usize,
    },
    /// With MainDevice redundancy: the frames of a cycle do not fit into it at 100 Mbit/s.
    CycleTooShort {
        /// Time on the wire in a cycle in which all domains are exchanged, with master frames and one acyclic frame
        /// (of 1,514 bytes with Ethernet between both MainDevices). Unless it is compared with a single period of
        /// several that may be on the wire, with twice the time in which the other MainDevice forwards a frame: it
        /// receives a frame completely before it sends it.
        needed: Duration,
        /// What it does not fit into: the shortest period, multiplied by the number of cycles that may be on the wire
        /// if the time contains the forwarding.
        period: Duration,
    },
}

impl fmt::Display for LayoutError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LayoutError::AreaTooLong { subdevice, sync_manager, length } => write!(
                f,
                "SubDevice {subdevice}, SyncManager {sync_manager}: {length} bytes of process data, a datagram carries \
                 at most {MAX_DATA}"
            ),
            LayoutError::TooLarge => f.write_str("process data of all domains exceeds 2 GiB"),
            LayoutError::TooManyFrames { frames } => write!(
                f,
                "process data needs {frames} frames at once, at most {} may be in flight",
                crate::ring::MAX_IN_FLIGHT
            ),
            LayoutError::CycleTooShort { needed, period } => write!(
                f,
                "the frames of a cycle take {} us on the wire, with the master frames, one acyclic frame, and \
                 forwarding by the other MainDevice (up to twice): they do not fit into {} us",
                needed.as_nanos().div_ceil(1_000),
                period.as_nanos() / 1_000
            ),
        }
    }
}

impl core::error::Error for LayoutError {}
