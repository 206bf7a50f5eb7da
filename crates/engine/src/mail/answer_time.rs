//! When to look for an answer, learnt from those before.
//!
//! Reading too early costs a datagram as long as the mailbox, reading late costs time. So the first look comes when the
//! answer should be there; it reads at once where that was right last time, and looks at the status byte otherwise.
//! When all was well for a while, an earlier look is tried. Times are those at which an access that nothing delayed
//! would have been asked for: how long datagrams wait for their turn on a busy wire is no matter of the SubDevice.

use core::time::Duration;

/// Shortest pause between two looks: about a round trip on a network interface.
const SHORTEST_PAUSE: Duration = Duration::from_micros(100);
/// Longest pause between two looks.
const LONGEST_PAUSE: Duration = Duration::from_millis(1);
/// The pause is this part of the time that was waited so far.
const PAUSE_PART: u32 = 8;
/// A try to look earlier is earlier by half of what is not known, and by this part at least.
const EARLIER_PART: u32 = 16;
/// After a try in vain, so many answers are taken at the usual time before the next; four times as many after another.
const FIRST_PATIENCE: u32 = 4;
/// Most of them: a SubDevice whose answers become quicker is followed after so many.
const LONGEST_PATIENCE: u32 = 32;
/// A round trip that has become longer is believed by this part of it each time.
const FADING_PART: u32 = 32;

/// Learns how long answers take.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AnswerTime {
    /// They were there by then.
    usual: Duration,
    /// At this time one was not there.
    vain: Duration,
    /// The last answer was there at the first look.
    hit: bool,
    /// Answers that were there at the first look since the last try to look earlier.
    calm: u32,
    /// How many there must be before the next try.
    patience: u32,
}

impl AnswerTime {
    /// How long after the request the first look is due.
    pub(super) fn first_look(&self) -> Duration {
        if self.is_trying() { self.usual - self.unknown().max(self.step()) / 2 } else { self.usual }
    }

    /// Whether the first look had better be a read.
    pub(super) fn is_sure(&self) -> bool {
        self.hit
    }

    fn is_trying(&self) -> bool {
        self.calm >= self.patience
    }

    fn unknown(&self) -> Duration {
        self.usual.saturating_sub(self.vain)
    }

    /// Twice the least that a try is earlier.
    fn step(&self) -> Duration {
        self.usual / EARLIER_PART * 2
    }

    /// Pause to the next look when an answer is not there after `waited`.
    pub(super) fn pause(waited: Duration) -> Duration {
        (waited / PAUSE_PART).clamp(SHORTEST_PAUSE, LONGEST_PAUSE)
    }

    /// An answer was found `after` its request; the last look before found nothing at `vain`.
    pub(super) fn took(&mut self, after: Duration, vain: Option<Duration>) {
        let is_known = self.usual != Duration::ZERO;
        let trying = is_known && self.is_trying();
        let Some(vain) = vain else {
            self.hit = true;
            self.usual = if is_known { self.usual.min(after) } else { after };
            if self.vain >= self.usual {
                self.vain = Duration::ZERO;
            }
            // A try that has shown something is followed by another.
            self.calm += u32::from(!trying);
            return;
        };
        self.vain = vain;
        if !trying || vain >= self.usual {
            self.hit = false;
            self.usual = if is_known { (self.usual + after) / 2 } else { after };
        } else if self.unknown() <= self.step() {
            self.calm = 0;
            self.patience = (self.patience * 4).clamp(FIRST_PATIENCE, LONGEST_PATIENCE);
        }
    }
}

/// The shortest way to the SubDevice and back of late.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ShortestTrip(Option<Duration>);

impl ShortestTrip {
    /// An access took so long, waiting for its turn included. Returns how long one takes that need not wait.
    pub(super) fn took(&mut self, trip: Duration) -> Duration {
        let shortest = self.0.map_or(trip, |shortest| trip.min(shortest + shortest / FADING_PART));
        self.0 = Some(shortest);
        shortest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Asks as the reader does; returns the looks that found nothing.
    fn ask(time: &mut AnswerTime, real: Duration) -> u32 {
        let (mut at, mut vain, mut looks) = (time.first_look(), None, 0);
        while at < real {
            vain = Some(at);
            at += AnswerTime::pause(at);
            looks += 1;
        }
        time.took(at, vain);
        looks
    }

    // covers: mailbox, start-lists
    #[test]
    fn looks_come_when_answers_do() {
        let real = Duration::from_micros(1000);
        let mut time = AnswerTime::default();
        let learning: u32 = (0..10).map(|_| ask(&mut time, real)).sum();
        assert!(learning < 16, "{learning} looks in vain for the first ten answers");
        let later: u32 = (0..200).map(|_| ask(&mut time, real)).sum();
        let usual = time.first_look();
        assert!((Duration::from_micros(940)..Duration::from_micros(1070)).contains(&usual), "{usual:?}");
        assert!(later < 12, "{later} of 200 looks came too early");
    }

    // covers: start-lists
    #[test]
    fn answers_that_become_quicker_or_slower_are_followed() {
        let mut time = AnswerTime::default();
        for real in [1000, 300, 4000, 200].map(Duration::from_micros) {
            (0..100).for_each(|_| _ = ask(&mut time, real));
            let usual = time.first_look();
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
