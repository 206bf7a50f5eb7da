//! What the queue of a segment holds.

use super::pool::Slot;
use crate::cable::{HostLink, LegId};

/// Something that is due.
#[derive(Clone, Copy, Debug)]
pub(super) enum Event {
    /// The last bit of a frame that changes no ways reaches the end of its first leg.
    Entry { slot: Slot, link: HostLink, leg: LegId },
    /// The last bit of a frame reaches the end of a leg. `meddled`: the faults of the leg have had their turn.
    Arrival { slot: Slot, leg: LegId, meddled: bool },
    /// The end of a leg notices whether there is a signal, unless it has changed again since.
    Detection { leg: LegId, epoch: u32 },
    /// A device has something to do by itself.
    Wake { device: u32 },
    /// A scheduled fault.
    Fault { number: u32 },
}
