//! Cycles in their own thread, beside the supervisor thread.
//!
//! The thread runs a closure of the application in each cycle. Other threads read [`CyclicStatus`], and call services
//! of the supervisor thread.
//!
//! A panic of the closure does not stop the bus: cycles continue with zero outputs until [`CyclicThread::end`] returns
//! the application and the panic message, for an orderly stop.

use std::any::Any;
use std::fmt;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use crate::application::Application;
use crate::cyclic_status::CyclicStatus;
use crate::error::Error;
use crate::links::Links;
use crate::probe::CycleProbe;
use crate::process_data::ProcessData;
use crate::supervisor_thread::SupervisorThread;

/// An application with cycles in their own thread. They end when this is dropped.
#[derive(Debug)]
pub struct CyclicThread<L> {
    supervisor: SupervisorThread,
    cyclic_status: Arc<CyclicStatus>,
    end: Arc<AtomicBool>,
    panicked: Arc<AtomicBool>,
    thread: Option<JoinHandle<Ended<L>>>,
}

/// The application when its cycles have ended.
pub type Ended<L> = Result<Application<L, SupervisorThread>, Box<Panicked<L>>>;

/// The closure of the cycles has panicked. The application is as it was, with all outputs zero: it can be stopped in
/// order, or run cycles with another closure.
#[non_exhaustive]
pub struct Panicked<L> {
    /// The panic's message.
    pub message: String,
    /// The application.
    pub application: Application<L, SupervisorThread>,
}

impl<L> fmt::Display for Panicked<L> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the application's closure has panicked: {}", self.message)
    }
}

impl<L> fmt::Debug for Panicked<L> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Panicked").field("message", &self.message).finish_non_exhaustive()
    }
}

impl<L> std::error::Error for Panicked<L> {}

/// The application is dropped without an orderly stop: SubDevices with watchdogs leave OP by themselves.
impl<L> From<Box<Panicked<L>>> for Error {
    fn from(panicked: Box<Panicked<L>>) -> Error {
        Error::Panicked(panicked.message)
    }
}

/// The message of a panic.
fn message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().map(|text| (*text).to_owned());
    let text = text.or_else(|| payload.downcast_ref::<String>().cloned());
    text.unwrap_or_else(|| "without a message".to_owned())
}

impl<L: Links> Application<L, SupervisorThread> {
    /// The acyclic half, also for other threads: the handle can be copied.
    pub fn supervisor(&self) -> &SupervisorThread {
        &self.acyclic
    }
}

impl<L: Links + Send + 'static> Application<L, SupervisorThread> {
    /// Runs the cycles in their own thread. Each cycle calls `work`, until it returns `Break` or [`CyclicThread::end`]
    /// is called. `prepare` runs in the thread first, for example to set its priority and processor. `work` is in the
    /// cyclic path: it must not allocate, lock or wait. After a panic it is not called again, and cycles continue with
    /// zero outputs.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub fn start_cycles(
        self,
        prepare: impl FnOnce() + Send + 'static,
        work: impl FnMut(&mut ProcessData<'_>) -> ControlFlow<()> + Send + 'static,
    ) -> Result<CyclicThread<L>, Error> {
        self.start_cycles_probed((), prepare, work)
    }

    /// As [`Application::start_cycles`], with a probe for the steps of each cycle.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub fn start_cycles_probed(
        mut self,
        mut probe: impl CycleProbe + Send + 'static,
        prepare: impl FnOnce() + Send + 'static,
        mut work: impl FnMut(&mut ProcessData<'_>) -> ControlFlow<()> + Send + 'static,
    ) -> Result<CyclicThread<L>, Error> {
        let end = Arc::new(AtomicBool::new(false));
        let panicked = Arc::new(AtomicBool::new(false));
        let (supervisor, cyclic_status) = (self.acyclic.clone(), self.cyclic_status().clone());
        let (ended, has_panicked) = (end.clone(), panicked.clone());
        let body = move || {
            prepare();
            while !ended.load(Ordering::Relaxed) {
                // The closure is not called again after a panic. Only the image may be half written, and its outputs
                // are set to zero.
                match catch_unwind(AssertUnwindSafe(|| self.cycle_probed(&mut probe, &mut work))) {
                    Ok(ControlFlow::Continue(())) => self.cyclic.publish_foreign(),
                    Ok(ControlFlow::Break(())) => break,
                    Err(payload) => {
                        let message = message(&*payload);
                        has_panicked.store(true, Ordering::Release);
                        while !ended.load(Ordering::Relaxed) {
                            self.cycle(|data| data.zero_outputs());
                            self.cyclic.publish_foreign();
                        }
                        return Err(Box::new(Panicked { message, application: self }));
                    }
                }
            }
            Ok(self)
        };
        let thread = std::thread::Builder::new().name("cycles".into()).spawn(body).map_err(Error::Thread)?;
        Ok(CyclicThread { supervisor, cyclic_status, end, panicked, thread: Some(thread) })
    }
}

impl<L> CyclicThread<L> {
    /// Figures that the cycles publish.
    pub fn cyclic_status(&self) -> &CyclicStatus {
        &self.cyclic_status
    }

    /// The same, also readable after the cycles have ended.
    pub fn cyclic_status_handle(&self) -> Arc<CyclicStatus> {
        self.cyclic_status.clone()
    }

    /// The acyclic half.
    pub fn supervisor(&self) -> &SupervisorThread {
        &self.supervisor
    }

    /// Whether the closure has ended: it has returned `Break`, or has panicked.
    pub fn has_ended(&self) -> bool {
        self.panicked.load(Ordering::Acquire) || self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Ends the cycles after the one that runs, and returns the application, which can be stopped or run cycles again.
    ///
    /// # Errors
    /// The closure has panicked; the application comes with the error.
    ///
    /// # Panics
    /// The thread itself has panicked: a fault of this crate, with the message of that panic.
    pub fn end(mut self) -> Ended<L> {
        self.end.store(true, Ordering::Relaxed);
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(ended)) => ended,
            Some(Err(payload)) => std::panic::resume_unwind(payload),
            None => unreachable!("only this and the drop take the thread"),
        }
    }
}

impl<L> Drop for CyclicThread<L> {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // The panic handler has reported a panic of the thread.
            let _ = thread.join();
        }
    }
}
