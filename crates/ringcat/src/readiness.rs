//! Waiting until all SubDevices are in their states, with a limit and with reasons.

use std::thread::sleep;
use std::time::{Duration, Instant as WallClock};

use crate::acyclic::AcyclicHalf;
use crate::application::Application;
use crate::error::Error;
use crate::links::Links;
use crate::not_ready::NotReady;
use crate::process_data::ProcessData;
use crate::supervisor_thread::SupervisorThread;

/// Interval at which another thread checks the states.
const LOOK: Duration = Duration::from_millis(1);

impl<L: Links, H: AcyclicHalf> Application<L, H> {
    /// Runs cycles until every declared SubDevice is in its target state (OP unless declared otherwise), except
    /// optional SubDevices that do not answer. Outputs are unchanged. Events remain to be taken.
    ///
    /// # Errors
    /// [`Error::NotReady`]: the limit has passed; the error names each SubDevice that is not ready, with the reason.
    /// The application may continue.
    pub fn wait_until_op(&mut self, limit: Duration) -> Result<(), Error> {
        self.wait_until_op_with(limit, |_| ())
    }

    /// As [`Application::wait_until_op`]; each cycle calls `work`.
    ///
    /// # Errors
    /// As [`Application::wait_until_op`].
    pub fn wait_until_op_with(
        &mut self,
        limit: Duration,
        mut work: impl FnMut(&mut ProcessData<'_>),
    ) -> Result<(), Error> {
        let end = self.now() + limit;
        loop {
            // The published state may be that of the previous application; the engine has the present state.
            if self.all_settled() && self.acyclic.not_ready()?.is_empty() {
                return Ok(());
            }
            if self.now() >= end {
                return Err(NotReady { limit, subdevices: self.acyclic.not_ready()? }.into());
            }
            self.cycle(&mut work);
            let now = self.now();
            self.acyclic.keep_events(now);
        }
    }
}

impl SupervisorThread {
    /// Waits until every declared SubDevice is in its target state while cycles run in another thread; as
    /// [`Application::wait_until_op`].
    ///
    /// # Errors
    /// [`Error::NotReady`]: the limit has passed. [`Error::Gone`]: the thread has ended.
    pub fn wait_until_op(&self, limit: Duration) -> Result<(), Error> {
        let begin = WallClock::now();
        while !(self.all_settled() && self.not_ready()?.is_empty()) {
            if begin.elapsed() >= limit {
                return Err(NotReady { limit, subdevices: self.not_ready()? }.into());
            }
            sleep(LOOK);
        }
        Ok(())
    }
}
