//! Duplicate mail (protocol 6.1, 6.2).
//!
//! A repeat brings a mail with its old counter, and so does a frame that comes back late; some SubDevices send an
//! answer twice. A mail is a duplicate when its counter is not zero, and counter and content are those of a recent
//! mail. The content is compared because some SubDevices never change their counter.

use alloc::collections::VecDeque;
use core::time::Duration;

use crate::time::Instant;

/// Without a disturbance, only a SubDevice that sends its mail twice causes duplicates: of the last mail.
const AFTER_EXPECTED: usize = 1;
/// A repeat brings the last mail or the one before; late ones may have come in between. Less than a wrap of the
/// counter.
/// counter.
const AFTER_REPEAT: usize = 5;
/// A late read brings the content of the mailbox at the time of the read: a mail that was accepted by one of this
/// number of reads before it, after repeats, or after it, by the repeat that recovered it. After a wrap of the counter
/// it would be another mail; the order of sending is uncertain by a read or two.
const AROUND_LATE: usize = 4;
/// Time for which mails are remembered to detect late ones; frames come back 100 ms late at most, or count as lost.
const KEPT_FOR: Duration = Duration::from_millis(400);
/// Largest number of remembered mails: a mailbox that is read every 100 us gives no more in the longest delay.
const KEPT: usize = 1024;
const FNV_OFFSET: u64 = 0xCBF2_9CE4_8422_2325;
const FNV_PRIME: u64 = 0x0000_0100_0000_01B3;

/// How a mail was received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ReadKind {
    /// By a read of its own.
    Expected,
    /// After a repeat request.
    Repeat,
    /// Beside the expected read: by one that was given up before it came back, and may have been recovered meanwhile,
    /// or by the second copy of one.
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

/// The last accepted mails, in the order in which their reads were sent: the order in which the SubDevice handed them
/// over, except for repeated ones.
#[derive(Clone, Debug, Default)]
pub(super) struct Recent {
    /// Newest first.
    mails: VecDeque<Known>,
}

impl Recent {
    /// Whether a mail is a duplicate; a new one is recorded. `sent` is when its read was sent, or any time between that
    /// and the end of the previous read.
    pub(super) fn is_duplicate(&mut self, counter: u8, content: &[u8], kind: ReadKind, sent: Instant) -> bool {
        if counter == 0 {
            return false;
        }
        let content = hash(content);
        let place = self.mails.iter().position(|known| known.sent <= sent).unwrap_or(self.mails.len());
        let candidates = match kind {
            ReadKind::Expected => place..place + AFTER_EXPECTED,
            ReadKind::Repeat => place..place + AFTER_REPEAT,
            ReadKind::Stray => place.saturating_sub(AROUND_LATE)..place + AROUND_LATE,
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
        let mut is_duplicate =
            |counter, content: &[u8]| recent.is_duplicate(counter, content, ReadKind::Expected, Instant(1));
        assert!(!is_duplicate(1, b"a"));
        assert!(is_duplicate(1, b"a"));
        assert!(!is_duplicate(1, b"b"), "a counter that stands still");
        assert!(!is_duplicate(0, b"b"), "0 is no counter");
        assert!(!is_duplicate(0, b"b"), "0 is no counter");
    }

    #[test]
    fn after_a_repeat_older_mails_are_doubles_too() {
        let mut recent = Recent::default();
        let at = |ms: u64| Instant(ms * 1_000_000);
        let mut is_duplicate = |counter, kind, ms| recent.is_duplicate(counter, b"x", kind, at(ms));
        for counter in 1..=3 {
            assert!(!is_duplicate(counter, ReadKind::Expected, counter.into()));
        }
        assert!(is_duplicate(1, ReadKind::Repeat, 4));
        assert!(!is_duplicate(4, ReadKind::Repeat, 4));
    }

    // covers: mailbox-faults
    #[test]
    fn what_comes_late_is_compared_with_what_was_read_about_the_time_when_it_left() {
        let mut recent = Recent::default();
        let at = |ms: u64| Instant(ms * 1_000_000);
        let mut is_duplicate = |counter, kind, ms| recent.is_duplicate(counter, b"x", kind, at(ms));
        // Each counter, then a pause of 300 ms with one mail repeated continuously, then each counter again.
        for turn in 0..2 {
            for counter in 1..=7 {
                assert!(!is_duplicate(counter, ReadKind::Expected, 310 * turn + u64::from(counter)));
            }
        }
        assert!(is_duplicate(7, ReadKind::Stray, 300), "a repeat brought it long after it was accepted");
        assert!(is_duplicate(1, ReadKind::Stray, 300), "healed by a read that was sent later");
        assert!(is_duplicate(3, ReadKind::Stray, 312), "healed");
        assert!(
            !is_duplicate(2, ReadKind::Stray, 316),
            "that with this counter before is a turn away: this one is new"
        );
        assert!(is_duplicate(2, ReadKind::Stray, 316));
    }
}
