//! When to poll for an answer, learnt from earlier answers.
//!
//! Reading too early costs a datagram as long as the mailbox, reading late costs time. So the first poll is at the
//! expected time; it reads at once where that was right last time, and polls the status byte otherwise. After a series
//! of good polls an earlier one is tried. Times are those without queueing: how long datagrams wait for a busy wire
//! does not depend on the SubDevice.

use core::time::Duration;

/// Shortest pause between two polls: about a round trip on a network interface.
const SHORTEST_PAUSE: Duration = Duration::from_micros(100);
/// Longest pause between two polls.
const LONGEST_PAUSE: Duration = Duration::from_millis(1);
/// The pause is this part of the time waited so far.
const PAUSE_PART: u32 = 8;
/// An earlier poll is earlier by half of the uncertainty, and by this part at least.
const EARLIER_PART: u32 = 16;
/// After an earlier poll in vain, the number of answers at the usual time before the next attempt; four times as many
/// after each further failure.
const FIRST_PATIENCE: u32 = 4;
/// Largest such number: it limits how long a SubDevice that becomes faster stays unnoticed.
const LONGEST_PATIENCE: u32 = 32;
/// A longer round trip is taken over by this part of it each time.
const FADING_PART: u32 = 32;

/// Learns the response times.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AnswerTime {
    /// Answers were available after this time.
    usual: Duration,
    /// After this time an answer was not available yet.
    empty_poll: Duration,
    /// The last answer was available at the first poll.
    hit: bool,
    /// Answers available at the first poll since the last earlier poll.
    calm: u32,
    /// Number of them required before the next earlier poll.
    patience: u32,
}

impl AnswerTime {
    /// Time from the request to the first poll.
    pub(super) fn first_poll(&self) -> Duration {
        if self.is_trying() { self.usual - self.unknown().max(self.step()) / 2 } else { self.usual }
    }

    /// Whether the first poll should read the mailbox at once.
    pub(super) fn is_sure(&self) -> bool {
        self.hit
    }

    fn is_trying(&self) -> bool {
        self.calm >= self.patience
    }

    fn unknown(&self) -> Duration {
        self.usual.saturating_sub(self.empty_poll)
    }

    /// Twice the minimum by which an earlier poll is earlier.
    fn step(&self) -> Duration {
        self.usual / EARLIER_PART * 2
    }

    /// Pause to the next poll when no answer is available after `waited`.
    pub(super) fn pause(waited: Duration) -> Duration {
        (waited / PAUSE_PART).clamp(SHORTEST_PAUSE, LONGEST_PAUSE)
    }

    /// An answer was found `after` its request; the last poll before it, at `vain`, found nothing.
    pub(super) fn took(&mut self, after: Duration, empty_poll: Option<Duration>) {
        let is_known = self.usual != Duration::ZERO;
        let trying = is_known && self.is_trying();
        let Some(empty_poll) = empty_poll else {
            self.hit = true;
            self.usual = if is_known { self.usual.min(after) } else { after };
            if self.empty_poll >= self.usual {
                self.empty_poll = Duration::ZERO;
            }
            // A successful attempt is followed by another.
            self.calm += u32::from(!trying);
            return;
        };
        self.empty_poll = empty_poll;
        if !trying || empty_poll >= self.usual {
            self.hit = false;
            self.usual = if is_known { (self.usual + after) / 2 } else { after };
        } else if self.unknown() <= self.step() {
            self.calm = 0;
            self.patience = (self.patience * 4).clamp(FIRST_PATIENCE, LONGEST_PATIENCE);
        }
    }
}

/// The shortest recent round trip to the SubDevice.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ShortestTrip(Option<Duration>);

impl ShortestTrip {
    /// Takes the duration of an access including queueing. Returns the estimated duration without queueing.
    pub(super) fn took(&mut self, trip: Duration) -> Duration {
        let shortest = self.0.map_or(trip, |shortest| trip.min(shortest + shortest / FADING_PART));
        self.0 = Some(shortest);
        shortest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Polls as the reader does; returns the polls that found nothing.
    fn ask(time: &mut AnswerTime, real: Duration) -> u32 {
        let (mut at, mut empty_poll, mut polls) = (time.first_poll(), None, 0);
        while at < real {
            empty_poll = Some(at);
            at += AnswerTime::pause(at);
            polls += 1;
        }
        time.took(at, empty_poll);
        polls
    }

    // covers: mailbox, start-lists
    #[test]
    fn looks_come_when_answers_do() {
        let real = Duration::from_micros(1000);
        let mut time = AnswerTime::default();
        let learning: u32 = (0..10).map(|_| ask(&mut time, real)).sum();
        assert!(learning < 16, "{learning} polls in empty_poll for the first ten answers");
        let later: u32 = (0..200).map(|_| ask(&mut time, real)).sum();
        let usual = time.first_poll();
        assert!((Duration::from_micros(940)..Duration::from_micros(1070)).contains(&usual), "{usual:?}");
        assert!(later < 12, "{later} of 200 polls came too early");
    }

    // covers: start-lists
    #[test]
    fn answers_that_become_quicker_or_slower_are_followed() {
        let mut time = AnswerTime::default();
        for real in [1000, 300, 4000, 200].map(Duration::from_micros) {
            (0..100).for_each(|_| _ = ask(&mut time, real));
            let usual = time.first_poll();
            assert!(usual > real * 9 / 10 && usual < real * 5 / 4, "{usual:?} for {real:?}");
        }
    }

    #[test]
    fn pauses_grow_with_the_time_waited_and_are_bounded() {
        assert_eq!(AnswerTime::pause(Duration::ZERO), SHORTEST_PAUSE);
        assert_eq!(AnswerTime::pause(Duration::from_millis(4)), Duration::from_micros(500));
        assert_eq!(AnswerTime::pause(Duration::from_secs(1)), LONGEST_PAUSE);
    }

    // covers: start-lists
    #[test]
    fn waiting_for_a_turn_is_no_part_of_a_trip() {
        let us = Duration::from_micros;
        let mut trip = ShortestTrip::default();
        assert_eq!(trip.took(us(320)), us(320));
        assert_eq!(trip.took(us(160)), us(160));
        assert_eq!(trip.took(us(900)), us(165));
        (0..100).for_each(|_| _ = trip.took(us(640)));
        assert_eq!(trip.took(us(640)), us(640), "a longer way is believed in the end");
    }
}
