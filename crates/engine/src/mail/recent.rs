//! Mail that comes twice (protocol 6.1, 6.2).
//!
//! A repeat brings a mail with its old counter, and so does a frame that comes back late; some SubDevices send an
//! answer twice. A mail is a double when its counter is not zero and counter and content are those of a mail of late.
//! Content is compared because there are SubDevices whose counter stands still.

use alloc::collections::VecDeque;
use core::time::Duration;

use crate::time::Instant;

/// Where there was no disturbance, only a SubDevice that sends its mail twice brings doubles: the last mail again.
const USUAL: usize = 1;
/// A repeat brings the last mail or the one before; late ones may have come in between. Less than a turn of the
/// counter.
const AFTER_REPEAT: usize = 5;
/// A late read brings what the mailbox held when it was sent: a mail that was accepted by one of so many reads that
/// were sent before it, after repeats, or after it, by the repeat that healed it. A turn of the counter brings others;
/// a place or two is uncertain.
const AROUND_LATE: usize = 4;
/// How long mails are remembered for those that come late; frames come back 100 ms late at most, or count as lost.
const KEPT_FOR: Duration = Duration::from_millis(400);
/// Mails that are remembered at most: a mailbox that is read every 100 us fills no more in the time of the longest
/// delay.
const KEPT: usize = 1024;
const FNV_OFFSET: u64 = 0xCBF2_9CE4_8422_2325;
const FNV_PRIME: u64 = 0x0000_0100_0000_01B3;

/// How a mail came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    /// By a read of its own.
    Usual,
    /// After a repeat request.
    Repeat,
    /// Beside the read that was waited for: by one that was given up before it came back, and may have been healed
    /// meanwhile, or by the second copy of one.
    Stray,
}

/// A mail that was accepted.
#[derive(Clone, Copy, Debug)]
struct Known {
    counter: u8,
    /// Hash of the content.
    content: u64,
    /// When the read that brought it was sent.
    sent: Instant,
}

/// The mails that were accepted last, in the order in which their reads were sent: that in which the SubDevice gave
/// them away, but for those that were repeated.
#[derive(Clone, Debug, Default)]
pub(super) struct Recent {
    /// Newest first.
    mails: VecDeque<Known>,
}

impl Recent {
    /// Whether a mail was there before; one that was not is noted. `sent` is when the read was sent that brought it, or
    /// any time between that and the end of the read before.
    pub(super) fn is_double(&mut self, counter: u8, content: &[u8], way: Way, sent: Instant) -> bool {
        if counter == 0 {
            return false;
        }
        let content = hash(content);
        let place = self.mails.iter().position(|known| known.sent <= sent).unwrap_or(self.mails.len());
        let candidates = match way {
            Way::Usual => place..place + USUAL,
            Way::Repeat => place..place + AFTER_REPEAT,
            Way::Stray => place.saturating_sub(AROUND_LATE)..place + AROUND_LATE,
        };
        let mut candidates = self.mails.range(candidates.start..candidates.end.min(self.mails.len()));
        if candidates.any(|known| (known.counter, known.content) == (counter, content)) {
            return true;
        }
        let outdated = |known: &Known| sent.since(known.sent) > KEPT_FOR;
        while self.mails.len() > AFTER_REPEAT && (self.mails.len() >= KEPT || self.mails.back().is_some_and(outdated)) {
            self.mails.pop_back();
        }
        self.mails.insert(place.min(self.mails.len()), Known { counter, content, sent });
        false
    }
}

/// FNV-1a.
fn hash(bytes: &[u8]) -> u64 {
    bytes.iter().fold(FNV_OFFSET, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(FNV_PRIME))
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: mailbox
    #[test]
    fn the_same_counter_with_the_same_content_is_a_double() {
        let mut recent = Recent::default();
        let mut is_double = |counter, content: &[u8]| recent.is_double(counter, content, Way::Usual, Instant(1));
        assert!(!is_double(1, b"a"));
        assert!(is_double(1, b"a"));
        assert!(!is_double(1, b"b"), "a counter that stands still");
        assert!(!is_double(0, b"b"), "0 is no counter");
        assert!(!is_double(0, b"b"), "0 is no counter");
    }

    #[test]
    fn after_a_repeat_older_mails_are_doubles_too() {
        let mut recent = Recent::default();
        let at = |ms: u64| Instant(ms * 1_000_000);
        let mut is_double = |counter, way, ms| recent.is_double(counter, b"x", way, at(ms));
        for counter in 1..=3 {
            assert!(!is_double(counter, Way::Usual, counter.into()));
        }
        assert!(is_double(1, Way::Repeat, 4));
        assert!(!is_double(4, Way::Repeat, 4));
    }

    // covers: mailbox-faults
    #[test]
    fn what_comes_late_is_compared_with_what_was_read_about_the_time_when_it_left() {
        let mut recent = Recent::default();
        let at = |ms: u64| Instant(ms * 1_000_000);
        let mut is_double = |counter, way, ms| recent.is_double(counter, b"x", way, at(ms));
        // Each counter, then a pause of 300 ms in which one mail is repeated again and again, then each counter again.
        for turn in 0..2 {
            for counter in 1..=7 {
                assert!(!is_double(counter, Way::Usual, 310 * turn + u64::from(counter)));
            }
        }
        assert!(is_double(7, Way::Stray, 300), "a repeat brought it long after it was accepted");
        assert!(is_double(1, Way::Stray, 300), "healed by a read that was sent later");
        assert!(is_double(3, Way::Stray, 312), "healed");
        assert!(!is_double(2, Way::Stray, 316), "that with this counter before is a turn away: this one is new");
        assert!(is_double(2, Way::Stray, 316));
    }
}
