//! The loops that compute the torque of the motor, and the profiles that move the set-point.

use super::Servo;
use super::axis::{
    ACCELERATION, FRICTION, MODE_CSP, MODE_CST, MODE_CSV, MODE_HOMING, MODE_PROFILE_POSITION, MODE_PROFILE_TORQUE,
    MODE_PROFILE_VELOCITY, PEAK_TORQUE, STEP,
};

/// Gains of the velocity loop and of the position loop, per second.
const VELOCITY_GAIN: f64 = 2_000.0;
const POSITION_GAIN: f64 = 250.0;
/// Fraction of the torque that the position loop assumes near its set-point.
const BRAKING_RESERVE: f64 = 0.8;
/// Fraction of the deceleration that is assumed before a software limit.
const LIMIT_RESERVE: f64 = 0.9;

impl Servo {
    /// Moves the set-point according to the mode and returns the torque for it.
    pub(super) fn follow(&mut self) -> f64 {
        let p = &self.parameters;
        let (acceleration, deceleration, quick) = (p.acceleration, p.deceleration, p.quick_stop_deceleration);
        let (target, fastest) = (p.target_velocity, p.max_profile_velocity.min(p.max_motor_speed));
        let (velocity_offset, torque_offset) = (p.velocity_offset, p.torque_offset);
        match self.mode {
            MODE_PROFILE_POSITION => {
                let most = p.profile_velocity.min(fastest);
                self.approach(most, acceleration, deceleration);
                self.position_loop(0.0)
            }
            MODE_CSP => {
                self.interpolate();
                self.position_loop(velocity_offset) + torque_offset
            }
            MODE_HOMING => {
                let rate = p.homing_acceleration;
                self.ramp_to(self.homing_velocity(), rate, rate);
                self.position_loop(0.0)
            }
            MODE_PROFILE_VELOCITY => {
                self.ramp_to(target.clamp(-fastest, fastest), acceleration, deceleration);
                self.track_motor(self.set_velocity);
                self.velocity_loop(self.set_velocity)
            }
            MODE_CSV => {
                let (low, high) = self.velocity_limits(self.motor.position, quick);
                let velocity = (target + velocity_offset).clamp(low, high);
                self.limited |= velocity != target + velocity_offset;
                self.track_motor(velocity);
                self.velocity_loop(velocity) + torque_offset
            }
            MODE_PROFILE_TORQUE | MODE_CST => {
                let (low, high) = self.velocity_limits(self.motor.position, quick);
                let (aim, slope) = (p.target_torque, p.torque_slope * STEP);
                let (slope, offset) = if self.mode == MODE_CST { (f64::INFINITY, torque_offset) } else { (slope, 0.0) };
                self.set_torque += (aim - self.set_torque).clamp(-slope, slope);
                self.track_motor(self.motor.velocity);
                // A velocity loop takes over if the axis would exceed its speed or position limits.
                let wanted = self.set_torque + offset;
                let torque = wanted.clamp(self.velocity_loop(low), self.velocity_loop(high));
                self.limited |= torque != wanted;
                torque
            }
            _ => {
                self.ramp_to(0.0, deceleration, deceleration);
                self.position_loop(0.0)
            }
        }
    }

    /// Sets the set-point to the motor's position.
    pub(super) fn track_motor(&mut self, velocity: f64) {
        (self.set_position, self.set_velocity) = (self.motor.position, velocity);
    }

    /// Changes the speed of the set-point towards `wanted`, within the limits.
    pub(super) fn ramp_to(&mut self, wanted: f64, acceleration: f64, deceleration: f64) {
        let (low, high) = self.velocity_limits(self.set_position, deceleration);
        let aim = wanted.clamp(low, high);
        self.limited |= aim != wanted;
        let faster = aim.abs() > self.set_velocity.abs() && aim * self.set_velocity >= 0.0;
        let rate = if faster { acceleration } else { deceleration } * STEP;
        self.set_velocity += (aim - self.set_velocity).clamp(-rate, rate);
        self.set_position += self.set_velocity * STEP;
    }

    /// Trapezoidal profile to the goal.
    pub(super) fn approach(&mut self, most: f64, acceleration: f64, deceleration: f64) {
        let goal = self.goal.map_or(self.set_position, |goal| self.within_limits(goal));
        let distance = goal - self.set_position;
        let speed = most.min(braking_speed(distance.abs(), deceleration));
        self.ramp_to(speed.copysign(distance), acceleration, deceleration);
        if distance.abs() < 0.5 && self.set_velocity.abs() <= 2.0 * deceleration * STEP {
            (self.set_position, self.set_velocity) = (goal, 0.0);
            self.goal = self.next_goal.take().or(self.goal);
        }
    }

    /// Linear to the goal in the remaining steps.
    pub(super) fn interpolate(&mut self) {
        let goal = self.goal.map_or(self.set_position, |goal| self.within_limits(goal));
        let fastest = self.parameters.max_motor_speed;
        let velocity = (goal - self.set_position) / (f64::from(self.steps_left.max(1)) * STEP);
        self.set_velocity = velocity.clamp(-fastest, fastest);
        self.limited |= velocity.abs() > fastest;
        self.set_position += self.set_velocity * STEP;
        self.steps_left = self.steps_left.saturating_sub(1);
    }

    /// Torque for the set-point: returns as fast as the loop allows, at speeds from which the motor can brake.
    pub(super) fn position_loop(&self, velocity_offset: f64) -> f64 {
        let p = &self.parameters;
        // The set-point has made this step already, the motor follows.
        let error = self.following_error() - self.set_velocity * STEP;
        let torque = p.max_torque.min(p.positive_torque).min(p.negative_torque).min(PEAK_TORQUE);
        let most = braking_speed(error.abs(), BRAKING_RESERVE * torque * ACCELERATION);
        let correction = (POSITION_GAIN * error).clamp(-most, most);
        let velocity = self.set_velocity + velocity_offset + correction;
        self.velocity_loop(velocity.clamp(-p.max_motor_speed, p.max_motor_speed))
    }

    pub(super) fn velocity_loop(&self, velocity: f64) -> f64 {
        (velocity - self.motor.velocity) * VELOCITY_GAIN / ACCELERATION + FRICTION * velocity
    }

    /// Software limits on the machine; none while homing searches for the origin.
    pub(super) fn software_limits(&self) -> Option<(f64, f64)> {
        let (low, high) = self.parameters.position_limits;
        let limited = low < high && (low, high) != (i32::MIN, i32::MAX) && self.mode != MODE_HOMING;
        limited.then(|| (f64::from(low) - self.origin, f64::from(high) - self.origin))
    }

    pub(super) fn within_limits(&mut self, goal: f64) -> f64 {
        let inside = self.software_limits().map_or(goal, |(low, high)| goal.clamp(low, high));
        self.limited |= inside != goal;
        inside
    }

    /// Speeds from which the axis can stop before its software limits.
    pub(super) fn velocity_limits(&self, position: f64, deceleration: f64) -> (f64, f64) {
        let fastest = self.parameters.max_motor_speed;
        let speed = |distance: f64| braking_speed(distance.max(0.0), LIMIT_RESERVE * deceleration).min(fastest);
        match self.software_limits() {
            Some((low, high)) => (-speed(position - low), speed(high - position)),
            None => (-fastest, fastest),
        }
    }
}

/// The highest speed from which a set-point that moves in steps can stop within a distance.
fn braking_speed(distance: f64, deceleration: f64) -> f64 {
    let step = deceleration * STEP;
    let speed = (step * step / 4.0 + 2.0 * deceleration * distance).sqrt() - step / 2.0;
    speed.clamp(0.0, distance / STEP)
}
