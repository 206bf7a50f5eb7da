//! States of mandatory SubDevices, of hot connect groups and of clocks.

use ringcat_engine::config::ReferenceClock;
use ringcat_engine::main_device::{ClockStatus, GroupState};
use ringcat_wire::address::Position;

use crate::acyclic::Inline;
use crate::application::Application;
use crate::error::Error;
use crate::links::Links;
use crate::supervisor_thread::SupervisorThread;

impl<L: Links> Application<L, Inline> {
    /// Whether every declared SubDevice that is not optional is in its target state.
    pub fn mandatory_settled(&self) -> bool {
        self.engine().mandatory_settled()
    }

    /// The state of each hot connect group, by its number. Not for the cyclic path.
    pub fn groups(&self) -> Vec<GroupState> {
        self.engine().groups()
    }

    /// Each distributed clock: delay, drift, difference to the reference clock. Empty if the declaration has no clocks.
    /// Not for the cyclic path.
    pub fn clocks(&self) -> Vec<ClockStatus> {
        self.engine().clocks()
    }

    /// Chooses the reference clock, also while the clocks run. Returns the position of the reference from now on: the
    /// first clock that answers if the chosen one does not; `None` without clocks. Not for the cyclic path.
    pub fn choose_reference_clock(&mut self, reference: ReferenceClock) -> Option<Position> {
        self.engine_mut().choose_reference_clock(reference)
    }
}

impl SupervisorThread {
    /// Whether every declared SubDevice that is not optional is in its target state.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn mandatory_settled(&self) -> Result<bool, Error> {
        self.with(|engine| engine.mandatory_settled())
    }

    /// The state of each hot connect group, by its number.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn groups(&self) -> Result<Vec<GroupState>, Error> {
        self.with(|engine| engine.groups())
    }

    /// Each distributed clock: delay, drift, difference to the reference clock. Empty if the declaration has no clocks.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn clocks(&self) -> Result<Vec<ClockStatus>, Error> {
        self.with(|engine| engine.clocks())
    }

    /// Chooses the reference clock, also while the clocks run. Returns the position of the reference from now on: the
    /// first clock that answers if the chosen one does not; `None` without clocks.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn choose_reference_clock(&self, reference: ReferenceClock) -> Result<Option<Position>, Error> {
        self.with(move |engine| engine.choose_reference_clock(reference))
    }
}
