//! Phase of a drive: the action of its power stage, and the progress of homing.

/// Progress of homing. Directions are -1.0 and 1.0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Homing {
    #[default]
    NotStarted,
    ToSwitch(f64),
    FromSwitch(f64),
    ToIndex(f64),
    Stopping,
    Done,
    Failed,
}

/// Action of the power stage in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Order {
    /// No torque, brake closed.
    Off,
    /// Decelerate at this rate, then hold the position; infinite: with full torque.
    Stop(f64),
    /// Follow the mode.
    Follow,
}
