//! What a drive is doing: the order of its power stage, and how far homing has come.

/// How far homing has come. Directions are -1.0 and 1.0.
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

/// What the power stage does in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Order {
    /// No torque, brake closed.
    Off,
    /// Slow down with so much per second, and hold the position then; infinite: with all torque.
    Stop(f64),
    /// Do what the mode says.
    Follow,
}
