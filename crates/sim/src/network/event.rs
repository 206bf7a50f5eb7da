//! Events of a segment's queue.

use super::pool::Slot;
use crate::cable::{Host, HostLink, LegId};

/// A due event.
#[derive(Clone, Copy, Debug)]
pub(super) enum Event {
    /// The last bit of a frame that changes no paths reaches the end of its first leg.
    Entry { slot: Slot, link: HostLink, leg: LegId },
    /// The last bit of a frame reaches the end of a leg. `faults_applied`: the faults of the leg are already applied.
    Arrival { slot: Slot, leg: LegId, faults_applied: bool },
    /// The end of a leg detects a signal or its loss, unless the signal has changed again since.
    Detection { leg: LegId, epoch: u32 },
    /// A device has work without a frame.
    Wake { device: u32 },
    /// A scheduled fault.
    Fault { number: u32 },
    /// The program of a host reacts to frames that wait.
    Reaction { host: Host },
}
