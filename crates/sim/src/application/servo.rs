//! A CiA 402 drive with the inertia of motor and load: profile and cyclic modes, homing, brake, fault reactions.
//!
//! Input: objects of the outputs and of the dictionary (`parameters`), virtual time. Output: the objects of
//! [`Servo::value`], including statusword, position, velocity and torque. The drive computes in steps of [`STEP_NS`] at
//! times that do not depend on frames. Units are increments, seconds and thousandths of the rated torque.
//!
//! A step runs the power state machine ([`power`]), which determines the action (`Order`). The mode moves the
//! set-point, a position loop around a velocity loop computes the torque (`motion`), and the motor moves. `homing`
//! searches for the origin, `status` computes the values for the application. Position and velocity of the motor are
//! those of the machine, with position 0 at the first power-on; `origin` is the offset found by homing.

mod axis;
mod homing;
mod motion;
mod motor;
mod parameters;
mod phase;
pub mod power;
mod status;

use super::dictionary::Dictionary;
use super::mapping::Mapping;
use crate::time::SimTime;
use axis::STEP;
use motor::Motor;
use parameters::Parameters;
use phase::{Homing, Order};

pub use axis::{
    ACCELERATION, BRAKE_TORQUE, ERROR_COMMUNICATION, ERROR_FOLLOWING, FRICTION, HOMING_METHODS,
    INCREMENTS_PER_REVOLUTION, INDEX_PULSE, LIMIT_SWITCH, MODE_CSP, MODE_CST, MODE_CSV, MODE_HOMING,
    MODE_PROFILE_POSITION, MODE_PROFILE_TORQUE, MODE_PROFILE_VELOCITY, MODES, PEAK_TORQUE, STANDSTILL, STEP_NS,
};
pub use power::{DriveCommand, DriveState};

/// Duration of the drive's self-test after power-on.
const SELF_TEST_NS: u64 = 10_000_000;
/// Maximum number of steps computed at once after a time without access to the drive.
const MAX_STEPS: u64 = 80_000;

const NEW_SET_POINT: u16 = 0x0010;
const IMMEDIATE: u16 = 0x0020;
const RELATIVE: u16 = 0x0040;
const FAULT_RESET: u16 = 0x0080;
const HALT: u16 = 0x0100;

/// State of a drive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Servo {
    state: DriveState,
    command: DriveCommand,
    controlword: u16,
    /// Whether outputs are valid.
    remote: bool,
    mode: i8,
    parameters: Parameters,
    /// Revision of the dictionary from which the parameters were read.
    revision: Option<u32>,
    motor: Motor,
    /// Application position at machine position 0.
    origin: f64,
    set_position: f64,
    set_velocity: f64,
    set_torque: f64,
    /// Target of the set-point, number of steps to the target (cyclic), and the next target (profile).
    goal: Option<f64>,
    steps_left: u32,
    next_goal: Option<f64>,
    acknowledged: bool,
    homing: Homing,
    limited: bool,
    /// Time in seconds for which the following error has been too large, and for which the target has been reached.
    lagging: f64,
    settled: f64,
    error_code: u16,
    at: SimTime,
    ready_at: SimTime,
}

impl Servo {
    /// Power state.
    pub const fn state(&self) -> DriveState {
        self.state
    }

    /// Power-on: the load is at its last position, the result of homing is lost.
    pub fn power_on(&mut self, now: SimTime) {
        let motor = Motor { velocity: 0.0, torque: 0.0, ..self.motor };
        let ready_at = SimTime(now.0.saturating_add(SELF_TEST_NS));
        *self = Servo { motor, set_position: motor.position, at: now, ready_at, ..Servo::default() };
    }

    /// Applies new outputs: moves the motor up to `now`, then takes the new command.
    pub fn command(&mut self, now: SimTime, mapping: &Mapping, outputs: &[u8], dictionary: &Dictionary) {
        self.advance(now);
        self.take_parameters(mapping, outputs, dictionary);
        self.remote = true;
        let word = self.parameters.controlword;
        let rising = word & !core::mem::replace(&mut self.controlword, word);
        self.command = DriveCommand::from_controlword(word);
        if self.state == DriveState::Fault && rising & FAULT_RESET != 0 {
            (self.state, self.error_code) = (DriveState::SwitchOnDisabled, 0);
        } else {
            self.state = power::next(self.state, self.command);
        }
        if self.state != DriveState::OperationEnabled {
            self.forget_targets();
        }
        let mode = self.parameters.mode;
        if mode != self.mode && MODES.contains(&mode.into()) {
            (self.mode, self.set_torque, self.settled) = (mode, self.motor.torque, 0.0);
            self.forget_targets();
        }
        match self.mode {
            _ if self.state != DriveState::OperationEnabled => {}
            MODE_PROFILE_POSITION => self.take_set_point(word),
            MODE_HOMING if rising & NEW_SET_POINT != 0 => self.begin_homing(),
            MODE_HOMING if word & NEW_SET_POINT == 0 && self.is_homing() => self.homing = Homing::NotStarted,
            MODE_CSP => {
                let target = self.parameters.target_position.wrapping_add(self.parameters.position_offset);
                self.goal = Some(self.on_machine(target));
                self.steps_left = (self.parameters.interpolation_time() / STEP).round() as u32;
            }
            _ => {}
        }
    }

    /// Drops earlier commands when the drive is enabled or returns to a mode.
    fn forget_targets(&mut self) {
        (self.goal, self.next_goal, self.acknowledged) = (None, None, false);
        self.homing = Homing::NotStarted;
    }

    fn take_parameters(&mut self, mapping: &Mapping, outputs: &[u8], dictionary: &Dictionary) {
        if self.revision.replace(dictionary.revision()) != Some(dictionary.revision()) {
            for (index, sub_index, value) in dictionary.numbers(0x6000..=0x6FFF) {
                self.parameters.set(index, sub_index, value);
            }
        }
        for entry in mapping.entries() {
            if let Some(value) = mapping.value(entry.index, entry.sub_index, outputs) {
                self.parameters.set(entry.index, entry.sub_index, value);
            }
        }
    }

    /// Handshake of profile position: bit 4 of the controlword against bit 12 of the statusword.
    fn take_set_point(&mut self, word: u16) {
        if word & NEW_SET_POINT == 0 {
            self.acknowledged = false;
            return;
        }
        let free = self.goal.is_none_or(|goal| goal == self.set_position) && self.next_goal.is_none();
        if self.acknowledged || (!free && word & IMMEDIATE == 0 && self.next_goal.is_some()) {
            return;
        }
        let target = self.parameters.target_position;
        let goal = match word & RELATIVE {
            0 => self.on_machine(target),
            _ => self.next_goal.or(self.goal).unwrap_or(self.set_position) + f64::from(target),
        };
        (self.acknowledged, self.settled) = (true, 0.0);
        if free || word & IMMEDIATE != 0 {
            (self.goal, self.next_goal) = (Some(goal), None);
        } else {
            self.next_goal = Some(goal);
        }
    }

    /// Outputs are no longer valid: 0x6007 determines the action of an enabled drive; any other drive switches off.
    pub fn release(&mut self, now: SimTime) {
        self.advance(now);
        self.remote = false;
        match (self.state, self.parameters.abort_connection_option) {
            (state, 0) if state.has_torque() => {}
            (DriveState::OperationEnabled | DriveState::QuickStopActive, 2) => {
                self.state = DriveState::SwitchOnDisabled
            }
            (DriveState::OperationEnabled | DriveState::QuickStopActive, 3) => self.state = DriveState::QuickStopActive,
            (DriveState::OperationEnabled | DriveState::QuickStopActive, _) => self.fail(ERROR_COMMUNICATION),
            (DriveState::ReadyToSwitchOn | DriveState::SwitchedOn, _) => self.state = DriveState::SwitchOnDisabled,
            _ => {}
        }
    }

    fn fail(&mut self, code: u16) {
        self.error_code = code;
        self.state = if self.is_at_standstill() { DriveState::Fault } else { DriveState::FaultReactionActive };
        // The drive stops from its actual position, not from the set-point.
        self.track_motor(self.motor.velocity);
    }

    /// Moves the motor up to `now`.
    pub fn advance(&mut self, now: SimTime) {
        let steps = (now.0 / STEP_NS).saturating_sub(self.at.0 / STEP_NS).min(MAX_STEPS);
        self.at = now;
        if self.state == DriveState::NotReadyToSwitchOn && now >= self.ready_at {
            self.state = DriveState::SwitchOnDisabled;
        }
        for _ in 0..steps {
            if !self.state.has_torque() && self.motor.velocity == 0.0 && self.motor.torque == 0.0 {
                return;
            }
            self.step();
        }
    }

    fn step(&mut self) {
        let order = self.order();
        self.limited = false;
        let before = self.motor.position;
        let torque = match order {
            Order::Off => {
                self.track_motor(self.motor.velocity);
                0.0
            }
            Order::Stop(rate) => {
                self.ramp_to(0.0, rate, rate);
                if rate.is_infinite() {
                    self.track_motor(0.0);
                }
                self.position_loop(0.0)
            }
            Order::Follow => self.follow(),
        };
        let p = &self.parameters;
        let most = |limit: f64| limit.min(p.max_torque).min(PEAK_TORQUE);
        let limited = torque.clamp(-most(p.negative_torque), most(p.positive_torque));
        self.limited |= limited != torque;
        self.motor.step(limited, order == Order::Off);
        self.search_home(before);
        self.watch();
        self.leave(order);
    }

    fn order(&self) -> Order {
        let p = &self.parameters;
        let by_option = |option: i16| match option {
            0 => Order::Off,
            1 | 5 => Order::Stop(p.deceleration),
            3 | 7 => Order::Stop(f64::INFINITY),
            _ => Order::Stop(p.quick_stop_deceleration),
        };
        match (self.state, self.command) {
            (DriveState::OperationEnabled, DriveCommand::SwitchOn) => by_option(p.disable_operation_option),
            (DriveState::OperationEnabled, DriveCommand::Shutdown) => by_option(p.shutdown_option),
            (DriveState::OperationEnabled, _) if self.controlword & HALT != 0 => by_option(p.halt_option),
            (DriveState::OperationEnabled, _) => Order::Follow,
            (DriveState::QuickStopActive, _) => by_option(p.quick_stop_option),
            (DriveState::FaultReactionActive, _) => by_option(p.fault_reaction_option),
            _ => Order::Off,
        }
    }

    /// Transitions that wait for the motor, or occur at once if the drive function is off.
    fn leave(&mut self, order: Order) {
        if order != Order::Off && !self.is_at_standstill() {
            return;
        }
        self.state = match (self.state, self.command) {
            (DriveState::OperationEnabled, DriveCommand::SwitchOn) => DriveState::SwitchedOn, // 5
            (DriveState::OperationEnabled, DriveCommand::Shutdown) => DriveState::ReadyToSwitchOn, // 8
            // 12
            (DriveState::QuickStopActive, _) if self.parameters.quick_stop_option < 5 => DriveState::SwitchOnDisabled,
            (DriveState::FaultReactionActive, _) => DriveState::Fault, // 14
            (state, _) => state,
        };
    }

    /// Supervises the following error, and the time within the target window.
    fn watch(&mut self) {
        let window = self.parameters.following_window;
        let lags = window.is_some_and(|window| self.following_error().abs() > window);
        self.lagging = if lags { self.lagging + STEP } else { 0.0 };
        self.settled = if self.is_in_window() { self.settled + STEP } else { 0.0 };
        let supervised = matches!(self.state, DriveState::OperationEnabled | DriveState::QuickStopActive);
        if supervised && lags && self.lagging > self.parameters.following_timeout {
            self.fail(ERROR_FOLLOWING);
        }
    }

    /// The machine position of an application position, less than half the encoder range away.
    fn on_machine(&self, position: i32) -> f64 {
        let here = (self.set_position + self.origin).round();
        here - self.origin + f64::from(position.wrapping_sub(here as i64 as i32))
    }

    fn is_at_standstill(&self) -> bool {
        self.set_velocity == 0.0 && self.motor.velocity.abs() < STANDSTILL
    }

    fn following_error(&self) -> f64 {
        self.set_position - self.motor.position
    }
}
