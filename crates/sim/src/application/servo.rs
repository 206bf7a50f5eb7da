//! A CiA 402 drive: the power state machine behind controlword and statusword, and a position that follows.
//!
//! In: controlword (0x6040), mode (0x6060), target position (0x607A) and target velocity (0x60FF) from the valid
//! outputs. Out: statusword (0x6041), mode display (0x6061), actual position (0x6064), actual velocity (0x606C) and
//! error code (0x603F). Modes: cyclic synchronous position (8) and cyclic synchronous velocity (9). Units are
//! increments and increments per second. The motor is ideal but for a speed limit.

use super::process_data::Mapping;
use crate::time::SimTime;

/// Highest speed in increments per second.
pub const MAX_SPEED: i64 = 10_000_000;
/// Mode of operation: cyclic synchronous position.
pub const MODE_CSP: i8 = 8;
/// Mode of operation: cyclic synchronous velocity.
pub const MODE_CSV: i8 = 9;
/// Error code after process data was lost while the drive was enabled: communication.
pub const ERROR_COMMUNICATION: u16 = 0x7500;

const NS_PER_S: i64 = 1_000_000_000;
const VOLTAGE_ENABLED: u16 = 0x0010;
const REMOTE: u16 = 0x0200;
const TARGET_REACHED: u16 = 0x0400;
const FOLLOWS: u16 = 0x1000;

/// State of the power state machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DriveState {
    /// Power cannot be switched on yet.
    #[default]
    SwitchOnDisabled,
    /// Waits for switch on.
    ReadyToSwitchOn,
    /// Power is on, no torque.
    SwitchedOn,
    /// The drive follows its target.
    OperationEnabled,
    /// Stands still after a quick stop.
    QuickStopActive,
    /// Waits for a fault reset.
    Fault,
}

impl DriveState {
    /// Its bits in the statusword.
    pub const fn status_bits(self) -> u16 {
        match self {
            DriveState::SwitchOnDisabled => 0x0040,
            DriveState::ReadyToSwitchOn => 0x0021,
            DriveState::SwitchedOn => 0x0023,
            DriveState::OperationEnabled => 0x0027,
            DriveState::QuickStopActive => 0x0007,
            DriveState::Fault => 0x0008,
        }
    }
}

/// What a controlword asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum DriveCommand {
    DisableVoltage,
    QuickStop,
    Shutdown,
    SwitchOn,
    EnableOperation,
}

impl DriveCommand {
    const fn from_controlword(word: u16) -> DriveCommand {
        match word & 0x0F {
            bits if bits & 0x02 == 0 => DriveCommand::DisableVoltage,
            bits if bits & 0x04 == 0 => DriveCommand::QuickStop,
            bits if bits & 0x01 == 0 => DriveCommand::Shutdown,
            bits if bits & 0x08 == 0 => DriveCommand::SwitchOn,
            _ => DriveCommand::EnableOperation,
        }
    }
}

/// One step of the power state machine.
const fn next(state: DriveState, command: DriveCommand) -> DriveState {
    use DriveCommand as C;
    use DriveState as S;
    match (state, command) {
        (S::Fault, _) => S::Fault,
        (S::SwitchOnDisabled, C::Shutdown) => S::ReadyToSwitchOn,
        (S::SwitchOnDisabled, C::DisableVoltage | C::QuickStop | C::SwitchOn | C::EnableOperation) => {
            S::SwitchOnDisabled
        }
        (S::ReadyToSwitchOn, C::SwitchOn | C::EnableOperation) => S::SwitchedOn,
        (S::ReadyToSwitchOn, C::Shutdown) => S::ReadyToSwitchOn,
        (S::SwitchedOn, C::EnableOperation) => S::OperationEnabled,
        (S::SwitchedOn, C::SwitchOn) => S::SwitchedOn,
        (S::SwitchedOn, C::Shutdown) => S::ReadyToSwitchOn,
        (S::OperationEnabled, C::EnableOperation) => S::OperationEnabled,
        (S::OperationEnabled, C::SwitchOn) => S::SwitchedOn,
        (S::OperationEnabled, C::Shutdown) => S::ReadyToSwitchOn,
        (S::OperationEnabled, C::QuickStop) => S::QuickStopActive,
        (S::QuickStopActive, C::EnableOperation) => S::OperationEnabled,
        (S::QuickStopActive, C::QuickStop | C::Shutdown | C::SwitchOn) => S::QuickStopActive,
        (_, C::DisableVoltage) => S::SwitchOnDisabled,
        (S::ReadyToSwitchOn | S::SwitchedOn, C::QuickStop) => S::SwitchOnDisabled,
    }
}

/// State of a drive.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Servo {
    state: DriveState,
    fault_reset: bool,
    remote: bool,
    mode: i8,
    target_position: i32,
    target_velocity: i32,
    position: i32,
    velocity: i64,
    /// Part of an increment not yet moved, in increments per second times nanoseconds.
    remainder: i64,
    error_code: u16,
    at: SimTime,
}

impl Servo {
    /// Power state.
    pub const fn state(&self) -> DriveState {
        self.state
    }

    /// Actual position in increments.
    pub const fn position(&self) -> i32 {
        self.position
    }

    /// New outputs: the motor moves up to now, then takes the new command.
    pub fn command(&mut self, now: SimTime, mapping: &Mapping, outputs: &[u8]) {
        self.advance(now);
        let value = |index| mapping.value(index, 0, outputs);
        self.remote = true;
        if let Some(mode) = value(0x6060) {
            self.mode = mode as u8 as i8;
        }
        if let Some(position) = value(0x607A) {
            self.target_position = position as u32 as i32;
        }
        if let Some(velocity) = value(0x60FF) {
            self.target_velocity = velocity as u32 as i32;
        }
        self.control(value(0x6040).unwrap_or(0) as u16);
    }

    fn control(&mut self, word: u16) {
        let reset = word & 0x80 != 0;
        if self.state == DriveState::Fault && reset && !self.fault_reset {
            self.state = DriveState::SwitchOnDisabled;
            self.error_code = 0;
        } else {
            self.state = next(self.state, DriveCommand::from_controlword(word));
        }
        self.fault_reset = reset;
    }

    /// Outputs are no longer valid: an enabled drive goes to fault, any other switches off.
    pub fn release(&mut self, now: SimTime) {
        self.advance(now);
        self.remote = false;
        match self.state {
            DriveState::OperationEnabled | DriveState::QuickStopActive => {
                self.state = DriveState::Fault;
                self.error_code = ERROR_COMMUNICATION;
            }
            DriveState::Fault => {}
            DriveState::SwitchOnDisabled | DriveState::ReadyToSwitchOn | DriveState::SwitchedOn => {
                self.state = DriveState::SwitchOnDisabled;
            }
        }
        self.velocity = 0;
    }

    /// Fills in the inputs as they are now.
    pub fn report(&mut self, now: SimTime, mapping: &Mapping, inputs: &mut [u8]) {
        self.advance(now);
        let mut set = |index, value: i64| mapping.set_value(index, 0, value as u64, inputs);
        set(0x6041, i64::from(self.statusword()));
        set(0x6061, i64::from(self.mode));
        set(0x6064, i64::from(self.position));
        set(0x606C, self.velocity);
        set(0x603F, i64::from(self.error_code));
    }

    /// The statusword.
    pub const fn statusword(&self) -> u16 {
        let mut word = self.state.status_bits() | VOLTAGE_ENABLED;
        if self.remote {
            word |= REMOTE;
        }
        if matches!(self.state, DriveState::OperationEnabled) {
            word |= FOLLOWS;
            if self.position == self.target_position {
                word |= TARGET_REACHED;
            }
        }
        word
    }

    /// Moves the motor up to `now`.
    fn advance(&mut self, now: SimTime) {
        let elapsed_ns = i64::try_from(now.since(self.at).as_nanos()).unwrap_or(i64::MAX).min(NS_PER_S);
        self.at = now;
        if self.state != DriveState::OperationEnabled || elapsed_ns == 0 {
            if self.state != DriveState::OperationEnabled {
                self.velocity = 0;
            }
            return;
        }
        let position = i64::from(self.position);
        let moved = match self.mode {
            MODE_CSP => {
                let reach = MAX_SPEED * elapsed_ns / NS_PER_S;
                let moved = (i64::from(self.target_position) - position).clamp(-reach, reach);
                self.velocity = moved * NS_PER_S / elapsed_ns;
                moved
            }
            MODE_CSV => {
                self.velocity = i64::from(self.target_velocity).clamp(-MAX_SPEED, MAX_SPEED);
                let travel = self.velocity * elapsed_ns + self.remainder;
                self.remainder = travel % NS_PER_S;
                travel / NS_PER_S
            }
            _ => {
                self.velocity = 0;
                0
            }
        };
        // An encoder wraps.
        self.position = (position + moved) as i32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn enabled(mode: i8) -> Servo {
        let mut servo = Servo { mode, remote: true, ..Servo::default() };
        for word in [0x06, 0x07, 0x0F] {
            servo.control(word);
        }
        assert_eq!(servo.state(), DriveState::OperationEnabled);
        servo
    }

    #[test]
    fn shutdown_switch_on_enable_lead_to_operation() {
        let mut servo = Servo::default();
        let words = [(0x0000, 0x0040), (0x0006, 0x0021), (0x0007, 0x0023), (0x000F, 0x0027), (0x0002, 0x0007)];
        for (control, status) in words {
            servo.control(control);
            assert_eq!(servo.statusword() & 0x006F, status, "controlword {control:#06x}");
        }
        servo.control(0x0000);
        assert_eq!(servo.state(), DriveState::SwitchOnDisabled);
    }

    #[test]
    fn enable_in_switch_on_disabled_does_nothing() {
        let mut servo = Servo::default();
        servo.control(0x000F);
        assert_eq!(servo.state(), DriveState::SwitchOnDisabled);
    }

    #[test]
    fn lost_process_data_is_a_fault_that_a_rising_reset_bit_clears() {
        let mut servo = enabled(MODE_CSP);
        servo.release(SimTime(0));
        assert_eq!((servo.state(), servo.error_code), (DriveState::Fault, ERROR_COMMUNICATION));
        servo.control(0x000F);
        assert_eq!(servo.state(), DriveState::Fault);
        servo.control(0x0080);
        assert_eq!((servo.state(), servo.error_code), (DriveState::SwitchOnDisabled, 0));
    }

    #[test]
    fn csp_follows_the_target_within_its_speed() {
        let mut servo = enabled(MODE_CSP);
        servo.target_position = 15_000;
        servo.advance(SimTime::from_millis(1));
        assert_eq!((servo.position(), servo.velocity), (10_000, MAX_SPEED));
        assert_eq!(servo.statusword() & TARGET_REACHED, 0);
        servo.advance(SimTime::from_millis(2));
        assert_eq!((servo.position(), servo.velocity), (15_000, 5_000_000));
        assert_eq!(servo.statusword() & TARGET_REACHED, TARGET_REACHED);
    }

    #[test]
    fn csv_loses_no_part_of_an_increment() {
        let mut servo = enabled(MODE_CSV);
        servo.target_velocity = -333;
        for ms in 1..=3000 {
            servo.advance(SimTime::from_millis(ms));
        }
        assert_eq!(servo.position(), -999);
    }
}
