//! How far SubDevices are: the mandatory ones, groups that join and leave.

use ringcat_engine::main_device::GroupState;

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

    /// How far each hot connect group is, by its number. Not for the cyclic path.
    pub fn groups(&self) -> Vec<GroupState> {
        self.engine().groups()
    }
}

impl SupervisorThread {
    /// Whether every declared SubDevice that is not optional is in its target state.
    ///
    /// # Errors
    /// The thread is gone.
    pub fn mandatory_settled(&self) -> Result<bool, Error> {
        self.with(|engine| engine.mandatory_settled())
    }

    /// How far each hot connect group is, by its number.
    ///
    /// # Errors
    /// The thread is gone.
    pub fn groups(&self) -> Result<Vec<GroupState>, Error> {
        self.with(|engine| engine.groups())
    }
}
