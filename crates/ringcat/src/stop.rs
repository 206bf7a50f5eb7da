//! An orderly stop of an application, in one thread and in two.

use std::time::Duration;

use ringcat_wire::al::AlState;

use crate::acyclic::Inline;
use crate::application::{Application, LastOutputs};
use crate::error::Error;
use crate::links::Links;
use crate::main_device::MainDevice;
use crate::supervisor_thread::SupervisorThread;

impl<L: Links> Application<L, Inline> {
    /// Stops in order: runs a few more cycles, with all outputs zero if `outputs` requests it, then brings all
    /// SubDevices down to a state. Returns the MainDevice, which may scan again.
    ///
    /// # Errors
    /// SubDevices do not reach the state in time, or the bus fails.
    pub fn stop(mut self, outputs: LastOutputs, state: AlState, limit: Duration) -> Result<MainDevice<L>, Error> {
        self.last_cycles(outputs);
        self.acyclic.engine.start_stop(state, limit, self.links.now());
        let mut main_device = MainDevice::from_parts(self.links, self.acyclic.engine, self.window.budget());
        main_device.finish_stop()?;
        Ok(main_device)
    }
}

impl<L: Links> Application<L, SupervisorThread> {
    /// Stops in order: runs a few more cycles, with all outputs zero if `outputs` requests it, then brings all
    /// SubDevices down to a state. Returns the MainDevice, which may scan again, and the links of the cycles.
    ///
    /// # Errors
    /// SubDevices do not reach the state in time, or the bus fails.
    pub fn stop(
        mut self,
        outputs: LastOutputs,
        state: AlState,
        limit: Duration,
    ) -> Result<(SupervisorThread, L), Error> {
        self.last_cycles(outputs);
        self.acyclic.stop(state, limit)?;
        Ok((self.acyclic, self.links))
    }
}
