//! Cycles that this machine was too late for, told as they happen but not one by one.

use std::time::Duration;

use ringcat::Instant;

/// Cycles that were left out are told at most this often, and so many times at most; all are counted.
const STALL_PAUSE: Duration = Duration::from_millis(100);
const STALLS_TOLD: u32 = 200;
/// Cycles that this machine was too late for, as far as they have been told.
#[derive(Default)]
pub struct Stalls {
    told: u64,
    lines: u32,
    next: Instant,
}

impl Stalls {
    /// How many there are that have not been told, if it is time to.
    pub fn news(&mut self, skipped: u64, now: Instant) -> Option<u64> {
        let more = skipped - self.told;
        if more == 0 || now < self.next || self.lines == STALLS_TOLD {
            return None;
        }
        *self = Stalls { told: skipped, lines: self.lines + 1, next: now + STALL_PAUSE };
        Some(more)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cycles_that_were_left_out_are_told_once_and_not_too_often() {
        let mut stalls = Stalls::default();
        let ms = |ms: u64| Instant(ms * 1_000_000);
        assert_eq!((stalls.news(0, ms(1)), stalls.news(3, ms(2)), stalls.news(3, ms(3))), (None, Some(3), None));
        assert_eq!((stalls.news(4, ms(50)), stalls.news(9, ms(103)), stalls.news(9, ms(500))), (None, Some(6), None));
        let told = (0..1_000).filter(|at| stalls.news(10 + at, ms(1_000 + 1_000 * at)).is_some()).count();
        assert_eq!(told + 2, STALLS_TOLD as usize);
    }
}
