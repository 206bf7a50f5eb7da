//! Learns the time that an EEPROM takes for a command, to send the first poll at the right time.

use core::time::Duration;

/// Pause between polls of a command that takes longer than usual; it grows with the time that the command has taken.
const SHORTEST_PAUSE: Duration = Duration::from_micros(50);
/// Longest pause.
const LONGEST_PAUSE: Duration = Duration::from_millis(1);
/// Latest time of the first poll: an EEPROM that is slow for a while must not be polled late for ever.
const LONGEST_WAIT: Duration = Duration::from_millis(5);

/// The learned time is not refined below this.
const NARROW: Duration = Duration::from_micros(15);
/// A poll at a time that was in time before, and is a little early now, makes the next one later by this.
const STEP: Duration = Duration::from_micros(5);
/// A command that takes this much longer than expected is a slow one, and not a poll that was a little early.
const MUCH: Duration = Duration::from_micros(120);

/// Learned speed of an EEPROM.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Pace {
    /// Time from a command to its first poll.
    wait: Option<Duration>,
    /// A first poll after this time was in time.
    good: Option<Duration>,
    /// A first poll after this time was too early.
    too_early: Duration,
    /// Time of the last command, if its first poll was too early, and time of the last poll that was.
    slow: Option<(Duration, Duration)>,
}

impl Pace {
    /// An initial estimate.
    pub(super) const fn guess(wait: Option<Duration>) -> Pace {
        Pace { wait, good: None, too_early: Duration::ZERO, slow: None }
    }

    /// Time from a command to its first poll.
    pub(super) fn first(&self) -> Duration {
        self.wait.unwrap_or(SHORTEST_PAUSE)
    }

    /// Time from one poll to the next, for a command that has taken `elapsed`.
    pub(super) fn next(elapsed: Duration) -> Duration {
        (elapsed / 16).clamp(SHORTEST_PAUSE, LONGEST_PAUSE)
    }

    /// A command was done after this time; `early`: time of the last poll before. A single command that is slower than
    /// the previous ones changes nothing. If the first poll is in time, the next one is sent a little earlier, down to
    /// a time that was too early.
    pub(super) fn took(&mut self, time: Duration, early: Option<Duration>) {
        let tried = self.first();
        let Some(early) = early else {
            self.slow = None;
            self.good = self.wait;
            let room = tried.saturating_sub(self.too_early);
            if room > NARROW {
                self.wait = self.wait.map(|wait| wait - room / 4);
            }
            return;
        };
        if let Some(good) = self.good
            && time <= good + MUCH
        {
            self.too_early = self.too_early.max(tried);
            self.wait = Some(if good > tried { good } else { (good + STEP).min(time) });
            self.slow = None;
            return;
        }
        if let Some(before) = self.slow {
            let (time, early) = before.min((time, early));
            self.wait = Some(time.min(LONGEST_WAIT));
            (self.good, self.too_early) = (None, early.min(LONGEST_WAIT));
        }
        self.slow = Some((time, early));
    }

    /// The learned time.
    pub(super) fn learnt(&self) -> Option<Duration> {
        self.wait
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn us(us: u64) -> Duration {
        Duration::from_micros(us)
    }

    /// A command of an EEPROM that takes `busy`; returns the number of polls.
    fn command(pace: &mut Pace, busy: Duration) -> u32 {
        let (mut elapsed, mut polls, mut early) = (pace.first(), 1, None);
        while elapsed < busy {
            early = Some(elapsed);
            elapsed += Pace::next(elapsed);
            polls += 1;
        }
        pace.took(elapsed, early);
        polls
    }

    #[test]
    fn one_slow_command_changes_nothing() {
        let mut pace = Pace::default();
        command(&mut pace, us(60_000));
        assert_eq!(pace.first(), us(50));
        command(&mut pace, us(500));
        assert_eq!(pace.first(), us(500));
        for _ in 0..10 {
            command(&mut pace, us(90_000));
            assert!(pace.first() <= us(500), "{pace:?}");
            command(&mut pace, us(500));
            command(&mut pace, us(500));
        }
    }

    #[test]
    fn the_first_poll_comes_soon_after_the_end_and_seldom_before_it() {
        for busy in [us(90), us(500), us(530), us(2_100), us(4_700)] {
            let mut pace = Pace::guess(Some(us(5_000)));
            let polls: u32 = (0..100).map(|_| command(&mut pace, busy)).sum();
            assert!((busy..busy + us(20)).contains(&pace.first()), "{busy:?}: {pace:?}");
            assert!(polls < 130, "{busy:?}: {polls} polls");
        }
    }

    #[test]
    fn an_eeprom_that_takes_a_little_longer_now_and_then_is_polled_once_per_command() {
        let mut pace = Pace::default();
        (0..20).for_each(|_| _ = command(&mut pace, us(500)));
        let busy = [500, 500, 520, 511, 500].map(us);
        let polls: u32 = (0..100).map(|number| command(&mut pace, busy[number % 5])).sum();
        assert!(polls < 110, "{polls} polls");
        assert!((us(520)..us(540)).contains(&pace.first()), "{pace:?}");
    }

    #[test]
    fn the_first_poll_is_never_later_than_5_ms_and_pauses_grow_to_1_ms() {
        let mut pace = Pace::guess(Some(us(500)));
        command(&mut pace, us(90_000));
        command(&mut pace, us(80_000));
        assert_eq!(pace.first(), us(5_000));
        assert_eq!([0, 1_600, 8_000, 90_000].map(|at| Pace::next(us(at))), [us(50), us(100), us(500), us(1_000)]);
    }
}
