//! What the two halves exchange about distributed clocks.
//!
//! The supervisor posts which reference clock each copy of a cyclic frame distributes; the exchange posts the result of
//! the broadcast read of the time differences.

use core::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};

use ringcat_wire::address::StationAddress;

use super::clock_times::TimeWords;
use crate::link::Link;

/// Reference clocks that the copies of cyclic frames distribute.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct References {
    /// Reference on the copy sent on the main link; `None`: that copy distributes no time.
    pub main: Option<StationAddress>,
    /// Reference on the copy sent on the redundant link.
    pub redundant: Option<StationAddress>,
    /// Where both copies have a reference: the redundant one is the reference of the segment, and the main one is
    /// steered towards it.
    pub redundant_leads: bool,
}

impl References {
    /// The reference on the copy sent on a link.
    pub const fn on(self, link: Link) -> Option<StationAddress> {
        match link {
            Link::Main => self.main,
            Link::Redundant => self.redundant,
        }
    }

    /// The link of the segment's reference, and that of the reference steered towards it.
    pub const fn leader(self) -> (Option<Link>, Option<Link>) {
        match (self.main.is_some(), self.redundant.is_some()) {
            (true, true) if self.redundant_leads => (Some(Link::Redundant), Some(Link::Main)),
            (true, true) => (Some(Link::Main), Some(Link::Redundant)),
            (true, false) => (Some(Link::Main), None),
            (false, true) => (Some(Link::Redundant), None),
            (false, false) => (None, None),
        }
    }
}

/// The shared words.
#[derive(Debug, Default)]
pub struct ClockWords {
    /// Stations in the lower half, the leader in bit 32, number of posts in the upper 31 bits.
    references: AtomicU64,
    spread: AtomicU32,
    is_window_watched: AtomicBool,
    is_reference_led: AtomicBool,
    are_some_in_front: AtomicBool,
    spread_count: AtomicU32,
    are_ports_guarded: AtomicBool,
    /// How often the exchange stopped the distribution of time, and up to which of these stops the supervisor has
    /// answered.
    holds: AtomicU32,
    answered: AtomicU32,
    /// The application's time, and that of the clocks.
    pub(crate) times: TimeWords,
}

const LEADER: u64 = 1 << 32;
const CHANGE: u32 = 33;

impl ClockWords {
    /// Posts the references.
    pub fn post_references(&self, references: References) {
        let station = |station: Option<StationAddress>| u64::from(station.map_or(0, |station| station.0));
        let changes = (self.references.load(Ordering::Relaxed) >> CHANGE).wrapping_add(1);
        let leader = if references.redundant_leads { LEADER } else { 0 };
        let word = station(references.main) | station(references.redundant) << 16 | leader | changes << CHANGE;
        self.references.store(word, Ordering::Release);
    }

    /// The references, and the number of posts.
    pub fn references(&self) -> (References, u32) {
        let word = self.references.load(Ordering::Acquire);
        let station = |bits: u64| Some(StationAddress(bits as u16)).filter(|station| station.0 != 0);
        let references =
            References { main: station(word), redundant: station(word >> 16), redundant_leads: word & LEADER != 0 };
        (references, (word >> CHANGE) as u32)
    }

    /// From now on the exchange stops the distribution of time when ports have changed.
    pub(crate) fn guard_ports(&self) {
        self.are_ports_guarded.store(true, Ordering::Relaxed);
    }

    pub(crate) fn are_ports_guarded(&self) -> bool {
        self.are_ports_guarded.load(Ordering::Relaxed)
    }

    /// Stops the distribution of time until the supervisor answers.
    pub(crate) fn hold(&self) {
        let holds = self.holds.load(Ordering::Relaxed);
        self.holds.store(holds.wrapping_add(1), Ordering::Release);
    }

    /// Number of stops of the distribution so far.
    #[inline]
    pub(crate) fn holds(&self) -> u32 {
        self.holds.load(Ordering::Acquire)
    }

    /// All changes up to the stop with this number are known; the distribution may go on.
    pub(crate) fn answer(&self, holds: u32) {
        self.answered.store(holds, Ordering::Release);
    }

    /// Whether the distribution of time is stopped.
    pub(crate) fn is_held(&self) -> bool {
        self.holds() != self.answered.load(Ordering::Acquire)
    }

    /// From now on the exchange reports when the differences enter the sync window and leave it.
    pub(crate) fn watch_window(&self) {
        self.is_window_watched.store(true, Ordering::Relaxed);
    }

    pub(crate) fn is_window_watched(&self) -> bool {
        self.is_window_watched.load(Ordering::Relaxed)
    }

    /// The segment's reference is steered towards the time of the host or of the application. Its own difference then
    /// shows the jitter of the host and no longer counts.
    pub(crate) fn lead_reference(&self) {
        self.is_reference_led.store(true, Ordering::Relaxed);
    }

    pub(crate) fn is_reference_led(&self) -> bool {
        self.is_reference_led.load(Ordering::Relaxed)
    }

    /// Sets whether frames pass clocks before the reference that these follow: such clocks receive the time that the
    /// host predicts.
    pub(crate) fn post_in_front(&self, some: bool) {
        self.are_some_in_front.store(some, Ordering::Relaxed);
    }

    /// Whether some difference shows the jitter of the host, so that the OR of all differences carries no information.
    pub(crate) fn shows_host_jitter(&self) -> bool {
        self.is_reference_led() || self.are_some_in_front.load(Ordering::Relaxed)
    }

    pub(crate) fn post_spread(&self, spread_ns: u32) {
        self.spread.store(spread_ns, Ordering::Relaxed);
        let count = self.spread_count.load(Ordering::Relaxed);
        self.spread_count.store(count.wrapping_add(1).max(1), Ordering::Release);
    }

    /// OR of all |0x092C| in nanoseconds that the last cyclic frame saw; `None` before the first.
    pub fn spread_ns(&self) -> Option<u32> {
        (self.spread_count.load(Ordering::Acquire) != 0).then(|| self.spread.load(Ordering::Relaxed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn references_survive_their_word() {
        let words = ClockWords::default();
        assert_eq!(words.references(), (References::default(), 0));
        for (number, redundant_leads) in [false, true].into_iter().enumerate() {
            let (main, redundant) = (Some(StationAddress(0x1001)), Some(StationAddress(0xFFFE)));
            let references = References { main, redundant, redundant_leads };
            words.post_references(references);
            assert_eq!(words.references(), (references, number as u32 + 1));
        }
        words.post_references(References::default());
        assert_eq!(words.references().0.leader(), (None, None));
        assert_eq!(words.spread_ns(), None);
        words.post_spread(7);
        assert_eq!(words.spread_ns(), Some(7));
    }
}
