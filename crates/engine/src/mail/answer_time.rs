//! When to look for an answer, learnt from those before.
//!
//! Reading too early costs a datagram as long as the mailbox, reading late costs time. So the first look comes when the
//! answer should be there; it reads at once where that was right last time, and looks at the status byte otherwise.

use core::time::Duration;

/// Shortest pause between two looks: about a round trip on a network interface.
const SHORTEST_PAUSE: Duration = Duration::from_micros(100);
/// Longest pause between two looks.
const LONGEST_PAUSE: Duration = Duration::from_millis(1);
/// The pause is this part of the time that was waited so far.
const PAUSE_PART: u32 = 8;
/// Each answer that was there at the first look makes the next look earlier by this part.
const EARLIER_PART: u32 = 64;

/// Learns how long answers take.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AnswerTime {
    usual: Duration,
    /// The last answer was there at the first look.
    hit: bool,
}

impl AnswerTime {
    /// How long after the request the first look is due.
    pub(super) fn first_look(&self) -> Duration {
        self.usual
    }

    /// Whether the first look had better be a read.
    pub(super) fn is_sure(&self) -> bool {
        self.hit
    }

    /// Pause to the next look when an answer is not there after `waited`.
    pub(super) fn pause(waited: Duration) -> Duration {
        (waited / PAUSE_PART).clamp(SHORTEST_PAUSE, LONGEST_PAUSE)
    }

    /// An answer came `after` its request, at the first look or later.
    pub(super) fn took(&mut self, after: Duration, first_look: bool) {
        self.hit = first_look;
        self.usual = if first_look { self.usual - self.usual / EARLIER_PART } else { (self.usual + after) / 2 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looks_come_when_answers_do() {
        let real = Duration::from_micros(1000);
        let mut time = AnswerTime::default();
        let mut early = 0;
        for _ in 0..200 {
            let first = time.first_look();
            if first >= real {
                time.took(first, true);
                continue;
            }
            early += 1;
            let mut at = first;
            while at < real {
                at += AnswerTime::pause(at);
            }
            time.took(at, false);
        }
        let usual = time.first_look();
        assert!((Duration::from_micros(900)..Duration::from_micros(1150)).contains(&usual), "{usual:?}");
        assert!(early < 60, "{early} of 200 looks came too early");
    }

    #[test]
    fn pauses_grow_with_the_time_waited_and_are_bounded() {
        assert_eq!(AnswerTime::pause(Duration::ZERO), SHORTEST_PAUSE);
        assert_eq!(AnswerTime::pause(Duration::from_millis(4)), Duration::from_micros(500));
        assert_eq!(AnswerTime::pause(Duration::from_secs(1)), LONGEST_PAUSE);
    }
}
