//! States of single SubDevices while the others exchange process data (facts 5.1).

use ringcat_engine::main_device::{GroupState, Pending};
use ringcat_engine::procedures::configure::ConfigureError;
use ringcat_wire::al::AlState;

use crate::acyclic::Inline;
use crate::application::Application;
use crate::error::Error;
use crate::links::Links;
use crate::supervisor_thread::SupervisorThread;

impl<L: Links> Application<L, Inline> {
    /// Starts to bring one SubDevice to a state while the others go on: INIT, PREOP, BOOT for new firmware, SAFEOP, OP. Its
    /// configuration is written again on the way up. The state is kept, also over a loss of power; a SubDevice that
    /// refuses is brought back to the state before. No working counter waits for one without process data, and its inputs
    /// are not fresh. Cycles have to go on until [`Pending::take`] gives the result.
    pub fn request_state(&mut self, subdevice: usize, state: AlState) -> Pending<Result<(), ConfigureError>> {
        self.engine_mut().start_state_request(subdevice, state)
    }

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
    /// Brings one SubDevice to a state while the others go on, and waits for it; as [`Application::request_state`].
    ///
    /// # Errors
    /// It refuses, does not answer or has no boot loader; or as [`SupervisorThread::run`].
    pub fn request_state(&self, subdevice: usize, state: AlState) -> Result<(), Error> {
        Ok(self.wait_for(move |engine| engine.start_state_request(subdevice, state))??)
    }

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
