//! Duplicate mail (protocol 6.1, 6.2).
//!
//! A repeat, or a frame that comes back late, returns a mail with its old counter; some SubDevices send an answer
//! twice. A mail is a duplicate if its counter is not zero, and counter and content equal those of a recent mail. The
//! content is compared because some SubDevices never change their counter.

use alloc::collections::VecDeque;
use alloc::vec::Vec;
use core::time::Duration;

use crate::time::Instant;

/// Candidates of an expected read: without a disturbance only the last mail can be a duplicate, if the SubDevice sends
/// it twice.
const AFTER_EXPECTED: usize = 1;
/// Candidates after a repeat: it returns the last mail or the one before, and late mails may be in between. Less than a
/// wrap of the counter.
const AFTER_REPEAT: usize = 5;
/// Candidates of a late read, before and after its time: it returns the content of the mailbox when the SubDevice
/// processed it. This mail may have been accepted by an earlier read (before repeats), or by the later repeat that
/// recovered it. Less than a wrap of the counter; the order of sending is uncertain by a read or two.
const AROUND_LATE: usize = 4;
/// Time for which mails are remembered to detect late duplicates; a frame that comes back more than 100 ms late counts
/// as lost.
const KEPT_FOR: Duration = Duration::from_millis(400);
/// Largest number of remembered mails: a mailbox that is read every 100 us gives fewer in the longest delay.
const KEPT: usize = 1024;
const FNV_OFFSET: u64 = 0xCBF2_9CE4_8422_2325;
const FNV_PRIME: u64 = 0x0000_0100_0000_01B3;

/// The read that returned a mail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ReadKind {
    /// The expected read.
    Expected,
    /// A read after a repeat request.
    Repeat,
    /// A read that was given up before its frame came back, and may have been recovered meanwhile; or the second copy
    /// of a read.
    Stray,
}

/// A mail that was accepted.
#[derive(Clone, Copy, Debug)]
struct Known {
    counter: u8,
    /// Hash of the content.
    content: u64,
    /// When the read that returned it was sent.
    sent: Instant,
}

/// The last accepted mails, in the order in which their reads were sent. This is the order in which the SubDevice sent
/// them, except for repeated mails.
#[derive(Clone, Debug, Default)]
pub(super) struct Recent {
    /// Newest first.
    mails: VecDeque<Known>,
}

impl Recent {
    /// Whether a mail is a duplicate; a new mail is recorded. `sent` is when its read was sent, or any time between
    /// that and the end of the previous read.
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

impl Recent {
    /// Counter and hash of the mails that a repeat may return, newest first.
    pub(super) fn known(&self) -> Vec<(u8, u64)> {
        self.mails.iter().take(AFTER_REPEAT).map(|known| (known.counter, known.content)).collect()
    }

    /// Mails that another process has accepted, newest first.
    pub(super) fn of(known: &[(u8, u64)], now: Instant) -> Recent {
        let known = known.iter().take(AFTER_REPEAT);
        Recent {
            mails: known.map(|(counter, content)| Known { counter: *counter, content: *content, sent: now }).collect(),
        }
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
    fn the_same_counter_with_the_same_content_is_a_duplicate() {
        let mut recent = Recent::default();
        let mut is_duplicate =
            |counter, content: &[u8]| recent.is_duplicate(counter, content, ReadKind::Expected, Instant(1));
        assert!(!is_duplicate(1, b"a"));
        assert!(is_duplicate(1, b"a"));
        assert!(!is_duplicate(1, b"b"), "the counter does not change");
        assert!(!is_duplicate(0, b"b"), "0 is no counter");
        assert!(!is_duplicate(0, b"b"), "0 is no counter");
    }

    #[test]
    fn after_a_repeat_older_mails_are_duplicates_too() {
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
    fn a_late_mail_is_compared_with_mails_read_about_the_time_of_its_read() {
        let mut recent = Recent::default();
        let at = |ms: u64| Instant(ms * 1_000_000);
        let mut is_duplicate = |counter, kind, ms| recent.is_duplicate(counter, b"x", kind, at(ms));
        // Each counter, then a pause of 300 ms with one mail repeated continuously, then each counter again.
        for turn in 0..2 {
            for counter in 1..=7 {
                assert!(!is_duplicate(counter, ReadKind::Expected, 310 * turn + u64::from(counter)));
            }
        }
        assert!(is_duplicate(7, ReadKind::Stray, 300), "a repeat returned it long after it was accepted");
        assert!(is_duplicate(1, ReadKind::Stray, 300), "recovered by a read that was sent later");
        assert!(is_duplicate(3, ReadKind::Stray, 312), "recovered");
        assert!(
            !is_duplicate(2, ReadKind::Stray, 316),
            "the mail with the same counter is a wrap away: this one is new"
        );
        assert!(is_duplicate(2, ReadKind::Stray, 316));
    }
}
