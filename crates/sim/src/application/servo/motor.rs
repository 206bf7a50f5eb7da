//! The motor and its load.

use super::axis::{ACCELERATION, BRAKE_TORQUE, FRICTION, STEP};

/// Motor and load.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Motor {
    pub position: f64,
    pub velocity: f64,
    pub torque: f64,
}

impl Motor {
    pub fn step(&mut self, torque: f64, brake: bool) {
        let mut velocity = self.velocity + (torque - FRICTION * self.velocity) * ACCELERATION * STEP;
        if brake {
            let most = BRAKE_TORQUE * ACCELERATION * STEP;
            velocity -= velocity.clamp(-most, most);
        }
        // Mean of both speeds: the work of the torque equals the energy gained by the load exactly.
        self.position += (self.velocity + velocity) / 2.0 * STEP;
        (self.velocity, self.torque) = (velocity, torque);
    }
}
