//! The local clock of distributed clocks and the receive-time latches (protocol 3.12, 7.1, 7.2.1).
//!
//! Input: virtual time, and the system times written by EtherCAT. Output: local time with the error of a free-running
//! clock ([`oscillator`]), corrected by the control loop ([`control_loop`]), and the ports at which a latching frame is
//! recorded. SYNC and LATCH units are in [`super::sync_unit`].

mod control_loop;
mod oscillator;

use core::time::Duration;

pub(super) use control_loop::LoopSettings;
pub use oscillator::Wander;

use crate::frame::Port;
use crate::time::SimTime;
use control_loop::{ControlLoop, Steering};
use oscillator::{FRACTION, Oscillator};

/// Imperfections of a clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ClockErrors {
    /// Frequency error relative to virtual time, in parts per billion.
    pub drift_ppb: i64,
    /// Change of the drift over time.
    pub wander: Wander,
    /// Maximum random delay of the detected arrival of a frame.
    pub receive_jitter: Duration,
}

/// The local clock.
#[derive(Clone, Debug)]
pub(super) struct Clock {
    started: SimTime,
    start: u64,
    oscillator: Oscillator,
    jitter_ns: u64,
    control: ControlLoop,
    steering: Steering,
    /// Count of the free-running clock when the current correction began, and local time then, both with fraction.
    anchor: (i128, i128),
    arrivals: [Option<(u64, SimTime)>; 4],
    /// The frame whose further arrivals are latched.
    latching: Option<u64>,
    /// Ports at which the next arrival of any frame is latched, if the controller does not distinguish frames.
    armed: [bool; 4],
    /// The last latching frame, and the time at which the processing unit processed it.
    latched: Option<(u64, SimTime)>,
}

impl Clock {
    pub fn new(start: u64, errors: ClockErrors) -> Clock {
        Clock {
            started: SimTime::ZERO,
            start,
            oscillator: Oscillator { drift_ppb: errors.drift_ppb, wander: errors.wander },
            jitter_ns: u64::try_from(errors.receive_jitter.as_nanos()).unwrap_or(u64::MAX - 1),
            control: ControlLoop::default(),
            steering: Steering::FREE,
            anchor: (0, 0),
            arrivals: [None; 4],
            latching: None,
            armed: [false; 4],
            latched: None,
        }
    }

    pub fn restart(&mut self, now: SimTime) {
        self.started = now;
        self.restart_loop(now);
        self.anchor = (0, 0);
        (self.arrivals, self.latching, self.armed) = ([None; 4], None, [false; 4]);
    }

    /// Local time in nanoseconds.
    pub fn local(&self, now: SimTime) -> u64 {
        self.start.wrapping_add((self.counted(now).1 >> FRACTION) as u64)
    }

    /// Local time that the controller records for the first bit of a frame at a port.
    pub fn stamp(&self, port: Port, first_bit: SimTime) -> u64 {
        self.local(self.seen(port, first_bit))
    }

    /// Time at which the controller detects the first bit of a frame.
    fn seen(&self, port: Port, first_bit: SimTime) -> SimTime {
        if self.jitter_ns == 0 {
            return first_bit;
        }
        let mut hash = first_bit.0 ^ self.start.rotate_left(32) ^ (port.index() as u64) << 62;
        for factor in [0xBF58_476D_1CE4_E5B9, 0x94D0_49BB_1331_11EB_u64] {
            hash = (hash ^ hash >> 31).wrapping_mul(factor);
        }
        SimTime(first_bit.0.saturating_add((hash >> 11) % (self.jitter_ns + 1)))
    }

    /// Counts of the free-running and the corrected clock since power-on, with fraction.
    fn counted(&self, now: SimTime) -> (i128, i128) {
        let free = self.oscillator.counted(i128::from(now.0) - i128::from(self.started.0));
        let since = free - self.anchor.0;
        (free, self.anchor.1 + since + self.steering.added(since))
    }

    /// Compares the copy of the system time at the first bit of a frame with the received time, and corrects the clock.
    /// `correction` is the value added to local time: offset minus delay.
    pub fn compare(&mut self, received: u32, correction: u64, first_bit: SimTime, settings: LoopSettings) {
        let copy = self.stamp(Port::A, first_bit).wrapping_add(correction) as u32;
        let dt = copy.wrapping_sub(received) as i32;
        self.control.sample(i128::from(dt) << FRACTION, settings);
        self.steer(first_bit, self.control.steering(settings));
    }

    /// Resets the loop: the clock is not corrected.
    pub fn restart_loop(&mut self, now: SimTime) {
        self.control = ControlLoop::default();
        self.steer(now, Steering::FREE);
    }

    fn steer(&mut self, now: SimTime, steering: Steering) {
        self.anchor = self.counted(now);
        self.steering = steering;
    }

    /// Contents of DC_SYSTEM_TIME_DIFFERENCE and DC_SPEED_COUNTER_DIFFERENCE.
    pub fn loop_registers(&self) -> (u32, i16) {
        (self.control.difference_register(), self.control.speed_register())
    }

    /// Time at which local time reaches a value in the near past or future: the correction is below a thousandth, so a
    /// few steps are enough.
    pub fn when(&self, local: u64, now: SimTime) -> SimTime {
        let mut at = now;
        for _ in 0..8 {
            let missing = local.wrapping_sub(self.local(at)) as i64;
            if missing == 0 {
                break;
            }
            at = SimTime(at.0.saturating_add_signed(missing));
        }
        at
    }

    /// Records the first bit of a frame at a port. Returns whether it is latched: a latching frame that returns, or any
    /// frame if frames are not distinguished.
    pub fn arrived(&mut self, port: Port, frame: u64, first_bit: SimTime) -> bool {
        self.arrivals[port.index()] = Some((frame, first_bit));
        core::mem::take(&mut self.armed[port.index()]) || self.latching == Some(frame)
    }

    /// Starts latching `frame`, which the processing unit processes at `at_unit`; returns its arrivals so far. If
    /// frames are not distinguished (`any`), it returns the last arrival at each port; at the other ports the next
    /// arrival is latched.
    pub fn latch(&mut self, frame: u64, at_unit: SimTime, any: bool) -> impl Iterator<Item = (Port, SimTime)> + use<> {
        let arrivals = self.arrivals;
        self.latched = Some((frame, at_unit));
        // The time of the frame's first arrival here; a later frame may have arrived since.
        let since = arrivals.iter().flatten().filter(|(id, _)| *id == frame).map(|(_, at)| *at).min();
        let is_in = move |id: u64, at: SimTime| id == frame || (any && since.is_none_or(|since| at >= since));
        self.latching = (!any).then_some(frame);
        self.armed = arrivals.map(|arrival| any && !arrival.is_some_and(|(id, at)| is_in(id, at)));
        Port::ALL.into_iter().filter_map(move |port| match arrivals[port.index()] {
            Some((id, at)) if any || is_in(id, at) => Some((port, at)),
            _ => None,
        })
    }

    /// The last latching frame, and the time at which the processing unit processed it.
    pub const fn latched(&self) -> Option<(u64, SimTime)> {
        self.latched
    }
}

#[cfg(test)]
mod tests;
