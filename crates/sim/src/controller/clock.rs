//! The local clock of distributed clocks and the receive-time latches (facts 3.12, 7.1).
//!
//! In: virtual time. Out: local time with drift, and which ports' receive times belong to a latching frame. The control
//! loop and the SYNC units are not modelled: writes to DC_SYSTEM_TIME are accepted and ignored.

use crate::frame::Port;
use crate::time::SimTime;

const BILLION: i128 = 1_000_000_000;

/// The local clock.
#[derive(Clone, Debug)]
pub(super) struct Clock {
    started: SimTime,
    start: u64,
    drift_ppb: i64,
    arrivals: [Option<(u64, SimTime)>; 4],
    /// The frame whose further arrivals are latched.
    latching: Option<u64>,
}

impl Clock {
    pub fn new(start: u64, drift_ppb: i64) -> Clock {
        Clock { started: SimTime::ZERO, start, drift_ppb, arrivals: [None; 4], latching: None }
    }

    pub fn restart(&mut self, now: SimTime) {
        *self = Clock { started: now, ..Clock::new(self.start, self.drift_ppb) };
    }

    /// Local time in nanoseconds.
    pub fn local(&self, now: SimTime) -> u64 {
        let elapsed = now.0.saturating_sub(self.started.0);
        let drift = (i128::from(elapsed) * i128::from(self.drift_ppb) / BILLION) as u64;
        self.start.wrapping_add(elapsed).wrapping_add(drift)
    }

    /// Notes the first bit of a frame at a port. Returns whether it is a latching frame that came back.
    pub fn arrived(&mut self, port: Port, frame: u64, first_bit: SimTime) -> bool {
        self.arrivals[port.index()] = Some((frame, first_bit));
        self.latching == Some(frame)
    }

    /// Starts latching `frame`; yields the arrivals it has had so far.
    pub fn latch(&mut self, frame: u64) -> impl Iterator<Item = (Port, SimTime)> + use<> {
        self.latching = Some(frame);
        let arrivals = self.arrivals;
        Port::ALL.into_iter().filter_map(move |port| match arrivals[port.index()] {
            Some((id, at)) if id == frame => Some((port, at)),
            _ => None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drift_of_100_ppm_is_100_us_in_a_second() {
        let mut clock = Clock::new(5, 100_000);
        clock.restart(SimTime(1_000));
        assert_eq!(clock.local(SimTime(1_000_001_000)), 1_000_100_005);
        let mut slow = Clock::new(0, -100_000);
        slow.restart(SimTime(0));
        assert_eq!(slow.local(SimTime(1_000_000_000)), 999_900_000);
    }
}
