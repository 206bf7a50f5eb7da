//! Homing: searches for a limit switch or an index pulse, which defines the origin of the positions.

use super::Servo;
use super::axis::{INCREMENTS_PER_REVOLUTION, INDEX_PULSE, LIMIT_SWITCH};
use super::phase::Homing;

impl Servo {
    pub(super) fn begin_homing(&mut self) {
        let p = &self.parameters;
        let (to_switch, to_zero) = (p.homing_speed_switch > 0.0, p.homing_speed_zero > 0.0);
        let side = if matches!(p.homing_method, 18 | 34) { 1.0 } else { -1.0 };
        self.homing = match p.homing_method {
            17 | 18 if to_switch && to_zero && self.on_switch(side) => Homing::FromSwitch(side),
            17 | 18 if to_switch && to_zero => Homing::ToSwitch(side),
            33 | 34 if to_zero => Homing::ToIndex(side),
            35 | 37 => self.found(self.motor.position),
            _ => Homing::Failed,
        };
    }

    pub(super) fn found(&mut self, home: f64) -> Homing {
        self.origin = self.parameters.home_offset - home;
        Homing::Stopping
    }

    pub(super) fn on_switch(&self, side: f64) -> bool {
        self.motor.position * side >= LIMIT_SWITCH
    }

    /// Speed of the set-point.
    pub(super) fn homing_velocity(&self) -> f64 {
        let p = &self.parameters;
        match self.homing {
            Homing::ToSwitch(side) => side * p.homing_speed_switch,
            Homing::FromSwitch(side) => -side * p.homing_speed_zero,
            Homing::ToIndex(side) => side * p.homing_speed_zero,
            Homing::NotStarted | Homing::Stopping | Homing::Done | Homing::Failed => 0.0,
        }
    }

    /// Whether the axis moves to the home position.
    pub(super) const fn is_homing(&self) -> bool {
        matches!(self.homing, Homing::ToSwitch(_) | Homing::FromSwitch(_) | Homing::ToIndex(_))
    }

    pub(super) fn search_home(&mut self, before: f64) {
        let revolution = f64::from(INCREMENTS_PER_REVOLUTION);
        let turn = |position: f64| ((position - INDEX_PULSE) / revolution).floor();
        let (last, now) = (turn(before), turn(self.motor.position));
        self.homing = match self.homing {
            Homing::ToSwitch(side) if self.on_switch(side) => Homing::FromSwitch(side),
            Homing::FromSwitch(side) if !self.on_switch(side) => self.found(side * LIMIT_SWITCH),
            Homing::ToIndex(_) if last != now => self.found(INDEX_PULSE + revolution * last.max(now)),
            Homing::Stopping if self.is_at_standstill() => Homing::Done,
            stage => stage,
        };
    }
}
