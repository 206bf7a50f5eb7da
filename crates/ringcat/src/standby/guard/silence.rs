//! For how long a heartbeat has been missing.

use std::time::{Duration, Instant};

/// The silence of a heartbeat after its first beat, by checks of it. A check that comes late counts for two intervals
/// at most: what has delayed it, such as a machine that stalls, has delayed the other process too.
#[derive(Debug)]
pub(super) struct Silence {
    beats: u32,
    looked_at: Instant,
    interval: Duration,
    lasts: Duration,
}

impl Silence {
    /// No beat yet, with checks at this interval.
    pub(super) fn new(now: Instant, interval: Duration) -> Silence {
        Silence { beats: 0, looked_at: now, interval, lasts: Duration::ZERO }
    }

    /// How long it lasts, after so many beats.
    pub(super) fn look(&mut self, beats: u32, now: Instant) -> Duration {
        let since = now.saturating_duration_since(self.looked_at).min(self.interval * 2);
        self.lasts = if beats == self.beats && beats != 0 { self.lasts + since } else { Duration::ZERO };
        (self.beats, self.looked_at) = (beats, now);
        self.lasts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    // covers: standby, MR-21
    #[test]
    fn a_silence_lasts_from_the_last_beat_and_a_beat_ends_it() {
        let begin = Instant::now();
        let mut silence = Silence::new(begin, 2 * MS);
        let lasts: Vec<Duration> = [(2, 8), (4, 8), (6, 8), (8, 9), (10, 9)]
            .into_iter()
            .map(|(ms, beats)| silence.look(beats, begin + ms * MS))
            .collect();
        assert_eq!(lasts, [0, 2, 4, 0, 2].map(|ms| ms * MS));
    }

    // covers: standby, MR-21
    #[test]
    fn a_stall_of_the_whole_machine_counts_for_two_looks() {
        let begin = Instant::now();
        let mut silence = Silence::new(begin, 2 * MS);
        assert_eq!(silence.look(1, begin + 2 * MS), Duration::ZERO);
        assert_eq!(silence.look(1, begin + 500 * MS), 4 * MS);
        assert_eq!(silence.look(1, begin + 502 * MS), 6 * MS);
        assert_eq!(silence.look(2, begin + 504 * MS), Duration::ZERO);
    }

    // covers: standby, MR-21
    #[test]
    fn before_the_first_beat_there_is_no_silence() {
        let begin = Instant::now();
        let mut silence = Silence::new(begin, 2 * MS);
        assert_eq!(silence.look(0, begin + 2 * MS), Duration::ZERO);
        assert_eq!(silence.look(0, begin + 4 * MS), Duration::ZERO);
    }
}
