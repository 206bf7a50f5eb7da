//! Status of a drive: statusword, actual values, and whether a target is reached.

use super::phase::Homing;
use super::*;

/// Tolerance of a reached torque target.
const TORQUE_WINDOW: f64 = 10.0;
const VOLTAGE_ENABLED: u16 = 0x0010;
const REMOTE: u16 = 0x0200;
const TARGET_REACHED: u16 = 0x0400;
const INTERNAL_LIMIT: u16 = 0x0800;
const BIT_12: u16 = 0x1000;
const BIT_13: u16 = 0x2000;

impl Servo {
    pub(super) fn is_in_window(&self) -> bool {
        let p = &self.parameters;
        match self.mode {
            _ if self.controlword & HALT != 0 => self.is_at_standstill(),
            MODE_PROFILE_POSITION | MODE_CSP => self.goal.is_some_and(|goal| {
                p.position_window.is_none_or(|window| (goal - self.motor.position).abs() <= window)
            }),
            MODE_PROFILE_VELOCITY => (p.target_velocity - self.motor.velocity).abs() <= p.velocity_window,
            MODE_PROFILE_TORQUE => (p.target_torque - self.motor.torque).abs() <= TORQUE_WINDOW,
            _ => false,
        }
    }

    pub(super) fn is_reached(&self) -> bool {
        let p = &self.parameters;
        let window_time = match self.mode {
            MODE_PROFILE_POSITION | MODE_CSP => p.position_window_time,
            MODE_PROFILE_VELOCITY => p.velocity_window_time,
            MODE_HOMING => {
                return !matches!(self.homing, Homing::Stopping) && self.is_at_standstill() && !self.is_homing();
            }
            _ => 0.0,
        };
        self.is_in_window() && self.settled >= window_time
    }

    /// The statusword.
    pub fn statusword(&self) -> u16 {
        let enabled = self.state == DriveState::OperationEnabled;
        let lags = self.lagging > 0.0 || self.error_code == ERROR_FOLLOWING;
        let (bit_12, bit_13) = match self.mode {
            MODE_PROFILE_POSITION => (enabled && (self.acknowledged || self.next_goal.is_some()), lags),
            MODE_PROFILE_VELOCITY => {
                (enabled && self.motor.velocity.abs() <= self.parameters.velocity_threshold, false)
            }
            MODE_HOMING => {
                (matches!(self.homing, Homing::Stopping | Homing::Done), matches!(self.homing, Homing::Failed))
            }
            MODE_CSP | MODE_CSV | MODE_CST => (enabled && self.order() == Order::Follow, lags),
            _ => (false, false),
        };
        let bit = |set: bool, bit: u16| if set { bit } else { 0 };
        self.state.status_bits()
            | VOLTAGE_ENABLED
            | bit(self.remote, REMOTE)
            | bit(enabled && self.is_reached(), TARGET_REACHED)
            | bit(self.limited, INTERNAL_LIMIT)
            | bit(bit_12, BIT_12)
            | bit(bit_13, BIT_13)
    }

    /// Updates the inputs.
    pub fn report(&mut self, now: SimTime, mapping: &Mapping, inputs: &mut [u8]) {
        self.advance(now);
        for entry in mapping.entries() {
            if let Some(value) = self.value(entry.index, entry.sub_index) {
                mapping.set_value(entry.index, entry.sub_index, value, inputs);
            }
        }
    }

    /// Values that the drive computes; numbers are sign-extended.
    pub fn value(&self, index: u16, sub_index: u8) -> Option<u64> {
        let number = |value: f64| value.round() as i64 as u64;
        let brake = !self.state.has_torque() || self.order() == Order::Off;
        Some(match (index, sub_index) {
            (0x1001, 0) if self.error_code == ERROR_COMMUNICATION => 0x11,
            (0x1001, 0) if self.error_code != 0 => 0x21,
            (0x603F, 0) => self.error_code.into(),
            (0x6041, 0) => self.statusword().into(),
            (0x6061, 0) => i64::from(self.mode) as u64,
            (0x6062, 0) => number(self.set_position + self.origin),
            (0x6063, 0) => number(self.motor.position),
            (0x6064, 0) => number(self.motor.position + self.origin),
            (0x606B, 0) => number(self.set_velocity),
            (0x606C, 0) => number(self.motor.velocity),
            // The current loop is ideal.
            (0x6074 | 0x6077 | 0x6078, 0) => number(self.motor.torque),
            (0x60F4, 0) => number(self.following_error()),
            (0x60FD, 0) => u64::from(self.on_switch(-1.0)) | u64::from(self.on_switch(1.0)) << 1,
            (0x60FE, 1) => u64::from(brake),
            _ => return None,
        })
    }
}
