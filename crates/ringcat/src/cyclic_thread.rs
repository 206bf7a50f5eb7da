//! Cycles in a thread of their own, beside the supervisor's.
//!
//! What the application computes in a cycle is a closure that this thread runs. Everybody else looks at [`News`], and asks
//! the supervisor's thread.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use crate::application::Application;
use crate::error::Error;
use crate::links::Links;
use crate::news::News;
use crate::process_data::ProcessData;
use crate::supervisor_thread::SupervisorThread;

/// An application whose cycles run in a thread of their own. They end when this is dropped.
#[derive(Debug)]
pub struct CyclicThread<L> {
    supervisor: SupervisorThread,
    news: Arc<News>,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<Application<L, SupervisorThread>>>,
}

impl<L: Links + Send + 'static> Application<L, SupervisorThread> {
    /// Runs the cycles in a thread of their own, each with `work`, until that breaks or [`CyclicThread::end`] is called.
    /// `prepare` runs in the thread first: the place to set its priority and processor. `work` is in the cyclic path: it
    /// must not allocate, lock or wait.
    ///
    /// # Errors
    /// The system has no more threads.
    pub fn start_cycles(
        mut self,
        prepare: impl FnOnce() + Send + 'static,
        mut work: impl FnMut(&mut ProcessData<'_>) -> ControlFlow<()> + Send + 'static,
    ) -> Result<CyclicThread<L>, Error> {
        let end = Arc::new(AtomicBool::new(false));
        let (supervisor, news, ended) = (self.acyclic.clone(), self.news().clone(), end.clone());
        let body = move || {
            prepare();
            while !ended.load(Ordering::Relaxed) && self.cycle(&mut work).is_continue() {
                self.cyclic.publish_foreign();
            }
            self
        };
        let thread = std::thread::Builder::new().name("cycles".into()).spawn(body).map_err(Error::Thread)?;
        Ok(CyclicThread { supervisor, news, end, thread: Some(thread) })
    }
}

impl<L> CyclicThread<L> {
    /// What the cycles make known.
    pub fn news(&self) -> &News {
        &self.news
    }

    /// The acyclic half.
    pub fn supervisor(&self) -> &SupervisorThread {
        &self.supervisor
    }

    /// Whether the cycles have ended by themselves.
    pub fn has_ended(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Ends the cycles after the one that runs, and hands back the application, to be stopped or to go on.
    ///
    /// # Errors
    /// The closure has panicked.
    pub fn end(mut self) -> Result<Application<L, SupervisorThread>, Error> {
        self.end.store(true, Ordering::Relaxed);
        let thread = self.thread.take().ok_or(Error::Gone)?;
        thread.join().map_err(|_| Error::Gone)
    }
}

impl<L> Drop for CyclicThread<L> {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A panic of the thread has been told by the panic handler.
            let _ = thread.join();
        }
    }
}
