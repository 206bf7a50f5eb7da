//! Temporary station addresses, and the search for SubDevices without a known one.

use ringcat_wire::address::StationAddress;

/// The first temporary station address.
const FIRST: u16 = 0xC000;
/// Number of temporary station addresses. They are used in turn: a SubDevice that was out of reach for a while must not
/// be taken for another one.
const COUNT: u16 = 0xFFFF - FIRST;
/// Consecutive failed searches before an event reports them.
const PATIENCE: u32 = 100;
/// Consecutive failed searches before it is tested whether frames hold too many datagrams.
const DOUBT: u32 = 3;

/// Temporary station addresses, and the search for SubDevices without a known one.
#[derive(Debug, Default)]
pub struct Addresses {
    /// Number of changes of assigned addresses.
    changes: u32,
    /// Place of the next temporary address among all of them.
    next: u16,
    /// Consecutive failed searches.
    failures: u32,
}

impl Addresses {
    /// Number of changes of assigned addresses so far.
    pub fn version(&self) -> u32 {
        self.changes
    }

    /// The next temporary address to assign that is not in use; any address if all are in use.
    pub fn next(&self, is_in_use: impl Fn(StationAddress) -> bool) -> StationAddress {
        let at = |place: u16| StationAddress(FIRST + (self.next + place) % COUNT);
        (0..COUNT).map(at).find(|address| !is_in_use(*address)).unwrap_or(at(0))
    }

    /// The temporary address that was given last.
    pub fn last(&self) -> StationAddress {
        StationAddress(FIRST + (self.next + COUNT - 1) % COUNT)
    }

    /// Whether the last search failed so often that it has to be tested whether frames hold too many datagrams.
    pub fn are_frames_doubtful(&self) -> bool {
        self.failures == DOUBT
    }

    /// Addresses were assigned or taken away. Returns the new version.
    pub(super) fn change(&mut self) -> u32 {
        self.changes = self.changes.wrapping_add(1);
        self.changes
    }

    /// A temporary address is not used again before all others.
    pub(super) fn offered(&mut self, station: StationAddress) {
        self.next = station.0.wrapping_sub(FIRST).wrapping_add(1) % COUNT;
    }

    /// A search has ended, with all SubDevices known or not. True if the failure is to be reported.
    pub(super) fn searched(&mut self, is_complete: bool) -> bool {
        self.failures = if is_complete { 0 } else { self.failures.saturating_add(1) };
        self.failures == PATIENCE
    }
}
