//! Detects silent links: copies that are sent on them do not come back.
//!
//! A reply that needs both copies would wait until its deadline for the copy on a dead link (a cut host cable), each
//! time. A copy is not awaited on a link that has been silent for [`SILENCE`] while the copy on the other link proves
//! the ring open. Frames are still sent on the silent link, to detect when copies come back.

use core::time::Duration;

use crate::link::Link;
use crate::time::Instant;

/// Silence after which copies on a link are not awaited: several frame timeouts, longer than a burst of losses.
const SILENCE: Duration = Duration::from_millis(30);

/// Since when the copies sent on each link have not come back.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Silence {
    since: [Option<Instant>; 2],
}

impl Silence {
    /// A copy is sent.
    pub(crate) fn sent(&mut self, link: Link, now: Instant) {
        self.since[link.index()].get_or_insert(now);
    }

    /// A copy that was sent on a link came back, on time or late.
    pub(crate) fn came_back(&mut self, link: Link) {
        self.since[link.index()] = None;
    }

    /// Bits of the links that are silent.
    pub(crate) fn mask(&self, now: Instant) -> u8 {
        let silent = |link: &&Link| self.since[link.index()].is_some_and(|since| now.since(since) >= SILENCE);
        Link::ALL.iter().filter(silent).fold(0, |mask, link| mask | link.bit())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn silence_begins_with_the_first_missing_copy_and_ends_with_any_copy() {
        let mut silence = Silence::default();
        let at = |ms: u64| Instant(ms * 1_000_000);
        assert_eq!(silence.mask(at(1000)), 0, "nothing was sent");
        silence.sent(Link::Main, at(1000));
        silence.sent(Link::Main, at(1020));
        assert_eq!(silence.mask(at(1029)), 0);
        assert_eq!(silence.mask(at(1030)), Link::Main.bit());
        silence.came_back(Link::Main);
        assert_eq!(silence.mask(at(1030)), 0);
    }
}
