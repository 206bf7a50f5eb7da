//! States of declared SubDevices and hot connect groups, for the application.

use ringcat_wire::al::AlState;

use crate::segment::member::Phase;

/// State of a declared SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SubDeviceState {
    /// It does not answer.
    Absent,
    /// It is not known: this MainDevice is INACTIVE in a ring of two, and no ACTIVE reports states.
    Unknown,
    /// It is being configured, or waits for the next attempt.
    Configuring,
    /// It is in its target state.
    Settled(AlState),
}

/// State of a hot connect group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct GroupState {
    /// SubDevices of the group that answer.
    pub present: usize,
    /// SubDevices of the group in their declared states.
    pub settled: usize,
    /// All SubDevices of the group.
    pub members: usize,
}

impl GroupState {
    /// Whether all SubDevices of the group are in their declared states.
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
