//! Application times that were set before the activation.

use std::time::Instant;

/// A time, and when it was set.
type At = (u64, Instant);

/// Application times before the activation. The grid of SYNC pulses begins with the first one; the application time
/// continues from the last one.
#[derive(Clone, Copy, Debug, Default)]
pub struct GivenTimes {
    /// The first time that is not 0.
    pub first: Option<At>,
    /// The last time; `None` if that is 0.
    pub last: Option<At>,
}

impl GivenTimes {
    /// The application sets a time now.
    pub fn set(&mut self, time: u64) {
        self.last = (time != 0).then(|| (time, Instant::now()));
        self.first = self.first.or(self.last);
    }
}

/// Nanoseconds since an instant.
pub fn passed_since(at: Instant) -> u64 {
    u64::try_from(at.elapsed().as_nanos()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: dc-sync, c-interface
    #[test]
    fn the_grid_begins_with_the_first_time_and_the_time_continues_from_the_last() {
        let mut given = GivenTimes::default();
        given.set(0);
        assert!(given.first.is_none() && given.last.is_none());
        given.set(7);
        given.set(9);
        assert_eq!((given.first.map(|it| it.0), given.last.map(|it| it.0)), (Some(7), Some(9)));
        given.set(0);
        assert_eq!((given.first.map(|it| it.0), given.last), (Some(7), None));
    }
}
