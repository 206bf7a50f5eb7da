//! Work in the thread of the acyclic half that is waited for later, or aborted.

use std::future::Future;

use ringcat_engine::main_device::{MainDevice as Engine, Ticket};

use crate::error::Error;
use crate::supervisor_thread::SupervisorThread;

/// Work under way, started by [`SupervisorThread::start_job`]. Dropped, it is aborted.
#[derive(Debug)]
pub struct Job<T: Send + 'static> {
    supervisor: SupervisorThread,
    ticket: Option<Ticket<T>>,
}

impl SupervisorThread {
    /// Starts an async function of the engine in the thread; as [`SupervisorThread::run`], but does not wait for its end.
    ///
    /// # Errors
    /// The thread is gone.
    pub fn start_job<T, W>(&self, make: impl FnOnce(&mut Engine) -> W + Send + 'static) -> Result<Job<T>, Error>
    where
        T: Send + 'static,
        W: Future<Output = T> + 'static,
    {
        let ticket = self.with(move |engine| {
            let work = make(engine);
            let pending = engine.start(work);
            engine.park(pending)
        })?;
        Ok(Job { supervisor: self.clone(), ticket: Some(ticket) })
    }
}

impl<T: Send + 'static> Job<T> {
    /// Waits for the end.
    ///
    /// # Errors
    /// The thread is gone, or the MainDevice was stopped meanwhile.
    pub fn wait(mut self) -> Result<T, Error> {
        let ticket = self.ticket.take().ok_or(Error::Gone)?;
        self.supervisor.ask(move |engine, _| engine.collect(&ticket))?.ok_or(Error::Gone)
    }

    /// Ends the work: an SDO transfer is aborted at the SubDevice, too. Waits until that has begun.
    ///
    /// # Errors
    /// The thread is gone.
    pub fn abort(mut self) -> Result<(), Error> {
        match self.ticket.take() {
            Some(ticket) => self.supervisor.with(move |engine| engine.discard(ticket)),
            None => Ok(()),
        }
    }
}

impl<T: Send + 'static> Drop for Job<T> {
    fn drop(&mut self) {
        if let Some(ticket) = self.ticket.take() {
            // A thread that is gone has no work.
            self.supervisor.post(move |engine| engine.discard(ticket));
        }
    }
}
