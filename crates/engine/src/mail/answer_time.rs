//! When to poll for an answer, estimated from earlier answers.
//!
//! A read that is too early costs a datagram as long as the mailbox; a late read costs time. So the first poll is at
//! the expected time. If the last answer was available then, it reads the mailbox at once, otherwise it polls the
//! status byte. After several answers at the expected time, an earlier poll is tried. Times exclude queueing: how long
//! datagrams wait for a busy wire does not depend on the SubDevice.

use core::time::Duration;

/// Shortest pause between two polls: about a round trip on a network interface.
const SHORTEST_PAUSE: Duration = Duration::from_micros(100);
/// Longest pause between two polls.
const LONGEST_PAUSE: Duration = Duration::from_millis(1);
/// The pause is this part of the time waited so far.
const PAUSE_PART: u32 = 8;
/// An earlier poll is earlier by half of the uncertainty, and at least by this part.
const EARLIER_PART: u32 = 16;
/// After an earlier poll without an answer, the number of answers at the usual time before the next attempt; four times
/// as many after each further failure.
const FIRST_PATIENCE: u32 = 4;
/// Largest such number: it limits the time until a faster response of the SubDevice is detected.
const LONGEST_PATIENCE: u32 = 32;
/// The shortest round trip may grow by this part of itself per measurement.
const FADING_PART: u32 = 32;

/// Estimates the response time.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AnswerTime {
    /// Time after which answers were available.
    usual: Duration,
    /// Time after which an answer was not available yet.
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

    /// Twice the smallest amount by which an earlier poll is earlier.
    fn step(&self) -> Duration {
        self.usual / EARLIER_PART * 2
    }

    /// Pause to the next poll when no answer is available after `waited`.
    pub(super) fn pause(waited: Duration) -> Duration {
        (waited / PAUSE_PART).clamp(SHORTEST_PAUSE, LONGEST_PAUSE)
    }

    /// An answer was available `after` its request; the last poll before it, at `empty_poll`, found no mail.
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
    fn poll(time: &mut AnswerTime, real: Duration) -> u32 {
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
    fn the_first_poll_is_at_the_time_of_the_answer() {
        let real = Duration::from_micros(1000);
        let mut time = AnswerTime::default();
        let learning: u32 = (0..10).map(|_| poll(&mut time, real)).sum();
        assert!(learning < 16, "{learning} polls without an answer for the first ten answers");
        let later: u32 = (0..200).map(|_| poll(&mut time, real)).sum();
        let usual = time.first_poll();
        assert!((Duration::from_micros(940)..Duration::from_micros(1070)).contains(&usual), "{usual:?}");
        assert!(later < 12, "{later} of 200 polls came too early");
    }

    // covers: start-lists
    #[test]
    fn the_estimate_follows_faster_and_slower_answers() {
        let mut time = AnswerTime::default();
        for real in [1000, 300, 4000, 200].map(Duration::from_micros) {
            (0..100).for_each(|_| _ = poll(&mut time, real));
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
    fn time_in_the_send_queue_is_not_part_of_a_round_trip() {
        let us = Duration::from_micros;
        let mut trip = ShortestTrip::default();
        assert_eq!(trip.took(us(320)), us(320));
        assert_eq!(trip.took(us(160)), us(160));
        assert_eq!(trip.took(us(900)), us(165));
        (0..100).for_each(|_| _ = trip.took(us(640)));
        assert_eq!(trip.took(us(640)), us(640), "a longer round trip is accepted in the end");
    }
}
