//! Learns the time that an EEPROM takes for a command, to send the first poll at the right time.

use core::time::Duration;

/// Pause between polls of a command that takes longer than usual; it grows with the time that the command has taken.
const SHORTEST_PAUSE: Duration = Duration::from_micros(50);
/// Longest pause.
const LONGEST_PAUSE: Duration = Duration::from_millis(1);
/// Latest time of the first poll: an EEPROM that is slow for a while must not be polled late for ever.
const LONGEST_WAIT: Duration = Duration::from_millis(5);

/// The learned time is not refined below this.
const NARROW: Duration = Duration::from_micros(40);

/// Learned speed of an EEPROM.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Pace {
    /// Time from a command to its first poll.
    wait: Option<Duration>,
    /// A first poll after this time was too early.
    too_early: Duration,
    /// Time of the last command, if its first poll was too early.
    slow: Option<Duration>,
}

impl Pace {
    /// An initial estimate.
    pub(super) const fn guess(wait: Option<Duration>) -> Pace {
        Pace { wait, too_early: Duration::ZERO, slow: None }
    }

    /// Time from a command to its first poll.
    pub(super) fn first(&self) -> Duration {
        self.wait.unwrap_or(SHORTEST_PAUSE)
    }

    /// Time from one poll to the next, for a command that has taken `elapsed`.
    pub(super) fn next(elapsed: Duration) -> Duration {
        (elapsed / 16).clamp(SHORTEST_PAUSE, LONGEST_PAUSE)
    }

    /// A command was done after this time, at its first poll or at a later one. A single command that is slower than
    /// the previous ones changes nothing. If the first poll is in time, the next one is sent a little earlier, down to
    /// a time that was too early.
    pub(super) fn took(&mut self, time: Duration, at_first_poll: bool) {
        if at_first_poll {
            self.slow = None;
            if let Some(wait) = &mut self.wait {
                let room = wait.saturating_sub(self.too_early);
                *wait -= if room > NARROW { room / 4 } else { Duration::ZERO };
            }
            return;
        }
        self.too_early = self.too_early.max(self.first());
        if let Some(before) = self.slow {
            self.wait = Some(before.min(time).min(LONGEST_WAIT));
        }
        self.slow = Some(time);
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
        let (mut elapsed, mut polls) = (pace.first(), 1);
        while elapsed < busy {
            elapsed += Pace::next(elapsed);
            polls += 1;
        }
        pace.took(elapsed, polls == 1);
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
            assert!((busy..busy + us(50)).contains(&pace.first()), "{busy:?}: {pace:?}");
            assert!(polls < 130, "{busy:?}: {polls} polls");
        }
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
