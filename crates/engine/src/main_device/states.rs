//! How far declared SubDevices and hot connect groups are, for the application.

use ringcat_wire::al::AlState;

use crate::segment::member::Phase;

/// How far a declared SubDevice is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SubDeviceState {
    /// It does not answer.
    Absent,
    /// It is being configured, or waits for the next attempt.
    Configuring,
    /// It is in its target state.
    Settled(AlState),
}

/// How far a hot connect group is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GroupState {
    /// SubDevices of it that answer.
    pub present: usize,
    /// Those in the states that were declared.
    pub settled: usize,
    /// All that belong to it.
    pub members: usize,
}

impl GroupState {
    /// All of them are in the states that were declared.
    pub const fn has_joined(&self) -> bool {
        self.settled == self.members
    }
}

impl From<Phase> for SubDeviceState {
    fn from(phase: Phase) -> SubDeviceState {
        match phase {
            Phase::Absent => SubDeviceState::Absent,
            Phase::Configuring => SubDeviceState::Configuring,
            Phase::Settled(state) => SubDeviceState::Settled(state),
        }
    }
}
