//! Without an application, since the last scan: whether a broadcast shows other SubDevices or other states.

use ringcat_wire::register::EcatEvent;

use super::posted::{Words, counts_of};
use crate::ring_status::LinkCounts;

/// What a broadcast has shown.
#[derive(Clone, Copy, Debug, Default)]
pub struct Broadcast {
    counts: LinkCounts,
    al_status: u8,
    ports_changed: bool,
    is_unplugged: bool,
}

impl Words {
    /// The answer to a broadcast.
    pub fn broadcast(&self) -> Option<Broadcast> {
        let (_, result) = self.supervision?;
        Some(Broadcast {
            counts: counts_of(&result),
            al_status: result.al_status[0] | result.al_status[1],
            ports_changed: EcatEvent::from_bits(result.irq).dl_status,
            is_unplugged: false,
        })
    }
}

impl Broadcast {
    /// No SubDevice answers.
    pub fn unanswered(is_unplugged: bool) -> Broadcast {
        Broadcast { is_unplugged, ..Broadcast::default() }
    }

    /// SubDevices on each link.
    pub fn counts(&self) -> LinkCounts {
        self.counts
    }

    /// Ports have changed.
    pub fn ports_changed(&self) -> bool {
        self.ports_changed
    }

    /// No link has a carrier.
    pub fn is_unplugged(&self) -> bool {
        self.is_unplugged
    }

    /// Whether any SubDevice answers.
    pub fn has_answer(&self) -> bool {
        self.counts != LinkCounts::default()
    }

    /// Whether it shows a segment with these SubDevices on each link, without a change of ports.
    pub fn shows(&self, scanned: LinkCounts) -> bool {
        self.counts == scanned && !self.ports_changed
    }
}

/// What is known of SubDevices and states since the last scan.
#[derive(Debug, Default)]
pub struct SinceScan {
    /// SubDevices on each link as they were reported, or found, last.
    counted: Option<LinkCounts>,
    /// The unexpected OR of the states for which all states were read last.
    read_for: Option<u8>,
}

impl SinceScan {
    /// These SubDevices were found; nothing is known with `None`.
    pub fn begin(&mut self, found: Option<LinkCounts>) {
        self.counted = found;
    }

    /// Whether a broadcast counts others than the one before, or than were found.
    pub fn has_other_count(&mut self, shown: &Broadcast, found: LinkCounts) -> bool {
        self.counted.replace(shown.counts).unwrap_or(found) != shown.counts
    }

    /// Whether a broadcast shows an unexpected OR of the states for which the states were not read yet.
    pub fn has_other_states(&mut self, shown: &Broadcast, expected: Option<u8>) -> bool {
        let is_other = expected.is_some_and(|expected| shown.al_status != expected);
        if !is_other {
            self.read_for = None;
        }
        is_other && self.read_for != Some(shown.al_status)
    }

    /// All states are read for this broadcast.
    pub fn note_read_for(&mut self, shown: &Broadcast) {
        self.read_for = Some(shown.al_status);
    }
}
