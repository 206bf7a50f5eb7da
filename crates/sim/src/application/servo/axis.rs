//! Constants of the drive and its machine: encoder, load, switches, and the codes of its modes and errors.

/// Duration of a step.
pub const STEP_NS: u64 = 125_000;
pub(super) const STEP: f64 = STEP_NS as f64 / 1e9;
/// Increments of the encoder.
pub const INCREMENTS_PER_REVOLUTION: i32 = 131_072;
/// Acceleration of motor and load per thousandth of the rated torque: increments per second squared.
pub const ACCELERATION: f64 = 50_000.0;
/// Friction in thousandths of the rated torque at one increment per second.
pub const FRICTION: f64 = 1e-5;
/// Torque of the closed brake.
pub const BRAKE_TORQUE: f64 = 1_000.0;
/// Maximum torque of the motor.
pub const PEAK_TORQUE: f64 = 3_000.0;
/// Position of the limit switches on the machine; both are cams that the axis can pass.
pub const LIMIT_SWITCH: f64 = 2_000_000.0;
/// Position of the index pulse in a revolution.
pub const INDEX_PULSE: f64 = 12_345.0;
/// Speed below which the motor is considered to be at standstill.
pub const STANDSTILL: f64 = 1_000.0;
/// Error code: process data was lost while the drive had torque.
pub const ERROR_COMMUNICATION: u16 = 0x7500;
/// Error code: the following error was too large for too long.
pub const ERROR_FOLLOWING: u16 = 0x8611;

/// Mode of operation: profile position.
pub const MODE_PROFILE_POSITION: i8 = 1;
/// Mode of operation: profile velocity.
pub const MODE_PROFILE_VELOCITY: i8 = 3;
/// Mode of operation: profile torque.
pub const MODE_PROFILE_TORQUE: i8 = 4;
/// Mode of operation: homing.
pub const MODE_HOMING: i8 = 6;
/// Mode of operation: cyclic synchronous position.
pub const MODE_CSP: i8 = 8;
/// Mode of operation: cyclic synchronous velocity.
pub const MODE_CSV: i8 = 9;
/// Mode of operation: cyclic synchronous torque.
pub const MODE_CST: i8 = 10;
/// Valid values of 0x6060; 0 is no mode: the drive stops.
pub const MODES: &[i64] = &[0, 1, 3, 4, 6, 8, 9, 10];
/// Valid values of 0x6098.
pub const HOMING_METHODS: &[i64] = &[17, 18, 33, 34, 35, 37];
