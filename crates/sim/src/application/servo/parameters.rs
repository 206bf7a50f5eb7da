//! Parameters of a drive: objects read from the outputs if they are mapped, otherwise from the dictionary.
//!
//! Input: objects as index, sub index and value. Output: numbers in the units of the drive: increments, seconds,
//! thousandths of the rated torque. Objects that the drive does not read are ignored.

use super::axis::INCREMENTS_PER_REVOLUTION;

/// Objects of the drive as numbers; the fields are in the order of their indices.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Parameters {
    /// 0x6007: reaction to the loss of valid outputs.
    pub abort_connection_option: i16,
    /// 0x6040.
    pub controlword: u16,
    /// 0x605A to 0x605E.
    pub quick_stop_option: i16,
    pub shutdown_option: i16,
    pub disable_operation_option: i16,
    pub halt_option: i16,
    pub fault_reaction_option: i16,
    /// 0x6060.
    pub mode: i8,
    /// 0x6065 in increments (`None`: not supervised), 0x6066 in seconds.
    pub following_window: Option<f64>,
    pub following_timeout: f64,
    /// 0x6067 in increments (`None`: always reached), 0x6068 in seconds.
    pub position_window: Option<f64>,
    pub position_window_time: f64,
    /// 0x606D in increments per second, 0x606E in seconds, 0x606F in increments per second.
    pub velocity_window: f64,
    pub velocity_window_time: f64,
    pub velocity_threshold: f64,
    /// 0x6071, 0x6072 in thousandths of the rated torque.
    pub target_torque: f64,
    pub max_torque: f64,
    /// 0x607A.
    pub target_position: i32,
    /// 0x607C.
    pub home_offset: f64,
    /// 0x607D: smallest and largest position.
    pub position_limits: (i32, i32),
    /// 0x607F, and 0x6080 (from revolutions per minute), in increments per second.
    pub max_profile_velocity: f64,
    pub max_motor_speed: f64,
    /// 0x6081, 0x6083 to 0x6085.
    pub profile_velocity: f64,
    pub acceleration: f64,
    pub deceleration: f64,
    pub quick_stop_deceleration: f64,
    /// 0x6087 in thousandths of the rated torque per second.
    pub torque_slope: f64,
    /// 0x6098, 0x6099:1, 0x6099:2, 0x609A.
    pub homing_method: i8,
    pub homing_speed_switch: f64,
    pub homing_speed_zero: f64,
    pub homing_acceleration: f64,
    /// 0x60B0 to 0x60B2.
    pub position_offset: i32,
    pub velocity_offset: f64,
    pub torque_offset: f64,
    /// 0x60C2: value and power of ten.
    pub interpolation: (u8, i8),
    /// 0x60E0, 0x60E1.
    pub positive_torque: f64,
    pub negative_torque: f64,
    /// 0x60FF.
    pub target_velocity: f64,
}

impl Parameters {
    /// Sets an object; `value` contains the bits of the object from bit 0 on.
    pub fn set(&mut self, index: u16, sub_index: u8, value: u64) {
        let word = value as u16 as i16;
        let thousandths = f64::from(value as u16 as i16);
        let number = f64::from(value as u32 as i32);
        let positive = f64::from(value as u32);
        let milliseconds = f64::from(value as u16) / 1e3;
        let window = (value as u32 != u32::MAX).then_some(positive);
        // A rate of zero would not allow any motion to start or stop.
        let rate = positive.max(1.0);
        match (index, sub_index) {
            (0x6007, 0) => self.abort_connection_option = word,
            (0x6040, 0) => self.controlword = value as u16,
            (0x605A, 0) => self.quick_stop_option = word,
            (0x605B, 0) => self.shutdown_option = word,
            (0x605C, 0) => self.disable_operation_option = word,
            (0x605D, 0) => self.halt_option = word,
            (0x605E, 0) => self.fault_reaction_option = word,
            (0x6060, 0) => self.mode = value as u8 as i8,
            (0x6065, 0) => self.following_window = window,
            (0x6066, 0) => self.following_timeout = milliseconds,
            (0x6067, 0) => self.position_window = window,
            (0x6068, 0) => self.position_window_time = milliseconds,
            (0x606D, 0) => self.velocity_window = f64::from(value as u16),
            (0x606E, 0) => self.velocity_window_time = milliseconds,
            (0x606F, 0) => self.velocity_threshold = f64::from(value as u16),
            (0x6071, 0) => self.target_torque = thousandths,
            (0x6072, 0) => self.max_torque = f64::from(value as u16),
            (0x607A, 0) => self.target_position = value as u32 as i32,
            (0x607C, 0) => self.home_offset = number,
            (0x607D, 1) => self.position_limits.0 = value as u32 as i32,
            (0x607D, 2) => self.position_limits.1 = value as u32 as i32,
            (0x607F, 0) => self.max_profile_velocity = positive,
            (0x6080, 0) => self.max_motor_speed = positive * f64::from(INCREMENTS_PER_REVOLUTION) / 60.0,
            (0x6081, 0) => self.profile_velocity = positive,
            (0x6083, 0) => self.acceleration = rate,
            (0x6084, 0) => self.deceleration = rate,
            (0x6085, 0) => self.quick_stop_deceleration = rate,
            (0x6087, 0) => self.torque_slope = positive,
            (0x6098, 0) => self.homing_method = value as u8 as i8,
            (0x6099, 1) => self.homing_speed_switch = positive,
            (0x6099, 2) => self.homing_speed_zero = positive,
            (0x609A, 0) => self.homing_acceleration = rate,
            (0x60B0, 0) => self.position_offset = value as u32 as i32,
            (0x60B1, 0) => self.velocity_offset = number,
            (0x60B2, 0) => self.torque_offset = thousandths,
            (0x60C2, 1) => self.interpolation.0 = value as u8,
            (0x60C2, 2) => self.interpolation.1 = value as u8 as i8,
            (0x60E0, 0) => self.positive_torque = f64::from(value as u16),
            (0x60E1, 0) => self.negative_torque = f64::from(value as u16),
            (0x60FF, 0) => self.target_velocity = number,
            _ => {}
        }
    }

    /// The time in which set-points are interpolated, in seconds.
    pub fn interpolation_time(&self) -> f64 {
        let (value, power) = self.interpolation;
        f64::from(value) * 10f64.powi(power.into())
    }
}
