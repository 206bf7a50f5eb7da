//! Mail that comes twice (facts 6.1, 6.2).
//!
//! A repeat brings a mail with its old counter, and so does a frame that comes back late; some SubDevices send an answer
//! twice. A mail is a double when its counter is not zero and counter and content are those of a mail of late. Content
//! is compared because there are SubDevices whose counter stands still.

use alloc::collections::VecDeque;
use core::time::Duration;

use crate::time::Instant;

/// How far back a mail may have been there before. Where there was no disturbance, only a SubDevice that sends its mail
/// twice brings doubles.
const USUAL: usize = 1;
/// A repeat brings the last mail or the one before; late ones may have come in between. Less than a turn of the counter.
const AFTER_REPEAT: usize = 5;
/// What a late read brings was accepted after it was sent, or before: it may have followed repeats, one after the other.
const BEFORE_LATE: Duration = Duration::from_millis(200);
/// How long mails are remembered for those that come late; frames come back 100 ms late at most, or count as lost.
const KEPT_FOR: Duration = Duration::from_millis(400);
/// Mails that are remembered at most: a mailbox that is read every 100 us fills no more in the time of the longest delay.
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
    /// With a read that was sent then and given up before it came back. It may have been healed meanwhile.
    Late(Instant),
}

/// The mails that were accepted last.
#[derive(Clone, Debug, Default)]
pub(super) struct Recent {
    /// Newest first: counter, hash of the content, when it was accepted.
    mails: VecDeque<(u8, u64, Instant)>,
}

impl Recent {
    /// Whether a mail was there before; one that was not is noted.
    pub(super) fn is_double(&mut self, counter: u8, content: &[u8], way: Way, now: Instant) -> bool {
        if counter == 0 {
            return false;
        }
        let hash = hash(content);
        let depth = match way {
            Way::Usual => USUAL,
            Way::Repeat => AFTER_REPEAT,
            Way::Late(sent) => {
                self.mails.iter().take_while(|(_, _, at)| *at + BEFORE_LATE >= sent).count().max(AFTER_REPEAT)
            }
        };
        let mut candidates = self.mails.iter().take(depth);
        if candidates.any(|(other, content, _)| (*other, *content) == (counter, hash)) {
            return true;
        }
        let outdated = |(_, _, at): &(u8, u64, Instant)| now.since(*at) > KEPT_FOR;
        while self.mails.len() > AFTER_REPEAT && (self.mails.len() >= KEPT || self.mails.back().is_some_and(outdated)) {
            self.mails.pop_back();
        }
        self.mails.push_front((counter, hash, now));
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
    fn after_a_disturbance_older_mails_are_doubles_too() {
        let mut recent = Recent::default();
        let at = |ms: u64| Instant(ms * 1_000_000);
        let mut is_double = |counter, way, ms| recent.is_double(counter, b"x", way, at(ms));
        for counter in 1..=3 {
            assert!(!is_double(counter, Way::Usual, counter.into()));
        }
        assert!(is_double(1, Way::Repeat, 4));
        assert!(!is_double(4, Way::Repeat, 4));
        assert!(is_double(1, Way::Late(at(1)), 5), "healed after its read was sent");
        for counter in 5..=7 {
            assert!(!is_double(counter, Way::Usual, counter.into()));
        }
        assert!(is_double(1, Way::Late(at(190)), 199));
        assert!(!is_double(1, Way::Late(at(290)), 291), "long after, it is another one");
    }
}
