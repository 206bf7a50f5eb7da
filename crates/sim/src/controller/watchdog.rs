//! The process data and the PDI watchdog (protocol 3.7).
//!
//! Input: triggers and the times in the registers. Output: states and the next expiry. [`super::Controller`] handles
//! counters and events.

use core::time::Duration;

use crate::time::SimTime;

/// One tick of the watchdog divider's clock.
const TICK_NS: u64 = 40;

/// State of a watchdog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// Not triggered since the reset.
    Idle,
    /// Last triggered at this time.
    Running(SimTime),
    /// Expired.
    Expired,
}

/// One watchdog.
#[derive(Clone, Copy, Debug)]
pub(super) struct Watchdog {
    state: State,
    /// Zero disables the watchdog.
    limit: Duration,
}

impl Watchdog {
    pub const fn new() -> Watchdog {
        Watchdog { state: State::Idle, limit: Duration::ZERO }
    }

    /// Applies divider and time registers.
    pub fn configure(&mut self, divider: u16, time: u16) {
        self.limit = Duration::from_nanos((u64::from(divider) + 2) * TICK_NS * u64::from(time));
    }

    pub fn trigger(&mut self, now: SimTime) {
        self.state = State::Running(now);
    }

    /// Returns to the state after a reset: it cannot expire before the next trigger.
    pub fn rest(&mut self) {
        self.state = State::Idle;
    }

    /// Time at which it expires without a trigger.
    pub fn deadline(&self) -> SimTime {
        match self.state {
            State::Running(since) if !self.limit.is_zero() => since + self.limit,
            _ => SimTime::NEVER,
        }
    }

    /// Expires if it is due; returns whether it expired now.
    pub fn expire(&mut self, now: SimTime) -> bool {
        let expires = now >= self.deadline() && self.deadline() != SimTime::NEVER;
        if expires {
            self.state = State::Expired;
        }
        expires
    }

    pub fn expired(&self) -> bool {
        self.state == State::Expired && !self.limit.is_zero()
    }

    /// Running or disabled: bit 0 of WATCHDOG_STATUS.
    pub fn ok(&self) -> bool {
        matches!(self.state, State::Running(_)) || self.limit.is_zero()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reset_values_are_100_ms() {
        // protocol 3.7: (0x09C2 + 2) x 40 ns = 100 us, times 1000.
        let mut watchdog = Watchdog::new();
        watchdog.configure(0x09C2, 0x03E8);
        watchdog.trigger(SimTime(0));
        assert_eq!(watchdog.deadline(), SimTime::from_millis(100));
        assert!(!watchdog.expire(SimTime(99_999_999)) && watchdog.ok());
        assert!(watchdog.expire(SimTime::from_millis(100)) && !watchdog.ok());
    }

    #[test]
    fn time_zero_disables_the_watchdog() {
        let mut watchdog = Watchdog::new();
        watchdog.trigger(SimTime(0));
        assert!(watchdog.ok() && watchdog.deadline() == SimTime::NEVER);
    }
}
