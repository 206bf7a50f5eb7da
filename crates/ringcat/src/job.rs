//! Work in the thread of the acyclic half, with a result for another thread.
//!
//! A [`Job`] and its [`Reply`] share a slot for a typed result. The thread fills the slot once. The owner of the job
//! waits for the result, polls it, or awaits the job as a future.

use std::fmt;
use std::future::Future;
use std::pin::Pin;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Waker};
use std::time::{Duration, Instant as WallClock};

use ringcat_engine::main_device::{MainDevice as Engine, Pending};
use ringcat_engine::time::Instant;

use crate::error::Error;

/// Work under way in the thread of a [`SupervisorThread`](crate::SupervisorThread). Dropping the job aborts the work,
/// an SDO transfer also at the SubDevice.
///
/// ```
/// # use std::time::Duration;
/// # use ringcat::{Error, Job};
/// fn show(mut job: Job<u32>) -> Result<(), Error> {
///     // A poll, a wait with a limit, and a wait for the end; a job is a future as well.
///     if job.take().is_none() && job.wait_for(Duration::from_millis(10)).is_none() {
///         println!("it goes on");
///     }
///     Ok(())
/// }
/// ```
pub struct Job<T> {
    slot: Arc<Slot<T>>,
    thread: Box<dyn InOrder>,
}

/// Work under way in the thread. Each turn of the thread calls it; it returns true when it has ended.
pub(crate) type Task = Box<dyn FnMut(&mut Engine, Instant) -> bool>;

/// Access of jobs to the thread, which processes requests in order. The thread runs as long as one of these exists.
pub(crate) trait InOrder: Send + Sync {
    /// Waits until the thread has processed all earlier requests.
    fn catch_up(&self) -> Result<(), Error>;

    /// Ends a sleep of the thread.
    fn wake(&self);
}

/// The end of a job in the thread. If it is dropped without a result, the job fails.
pub(crate) struct Reply<T> {
    slot: Arc<Slot<T>>,
}

struct Slot<T> {
    state: Mutex<State<T>>,
    changed: Condvar,
}

enum State<T> {
    /// The work runs; waker of the task that awaits its end.
    Running(Option<Waker>),
    Done(T),
    /// No result will come: it was taken, or the work was ended before.
    Gone,
    /// The job was aborted: no result is needed.
    Aborted,
}

impl<T> Slot<T> {
    fn state(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn end(&self, end: State<T>) {
        let mut state = self.state();
        if let State::Running(waker) = &mut *state {
            let waker = waker.take();
            *state = end;
            drop(state);
            self.changed.notify_all();
            waker.into_iter().for_each(Waker::wake);
        }
    }
}

impl<T> State<T> {
    /// Takes the result, once; `None` while the work runs.
    fn take(&mut self) -> Option<Result<T, Error>> {
        match std::mem::replace(self, State::Gone) {
            State::Done(result) => Some(Ok(result)),
            State::Gone | State::Aborted => Some(Err(Error::Gone)),
            running @ State::Running(_) => {
                *self = running;
                None
            }
        }
    }
}

/// Both ends of a job.
pub(crate) fn job<T>(thread: impl InOrder + 'static) -> (Job<T>, Reply<T>) {
    let slot = Arc::new(Slot { state: Mutex::new(State::Running(None)), changed: Condvar::new() });
    (Job { slot: slot.clone(), thread: Box::new(thread) }, Reply { slot })
}

impl<T: 'static> Reply<T> {
    pub(crate) fn send(&self, result: T) {
        self.slot.end(State::Done(result));
    }

    fn is_wanted(&self) -> bool {
        matches!(*self.slot.state(), State::Running(_))
    }

    /// A task that runs until a procedure of the engine has ended.
    pub(crate) fn follow(self, mut pending: Pending<T>) -> Task {
        Box::new(move |_, _| {
            let is_running = pending.is_running();
            if let Some(result) = pending.take() {
                self.send(result);
                return true;
            }
            // A procedure that was ended by a stop or a change of the role has no result.
            !is_running || !self.is_wanted()
        })
    }

    /// A task that calls `question` until it returns a result.
    pub(crate) fn answer(self, mut question: impl FnMut(&mut Engine) -> Option<T> + 'static) -> Task {
        Box::new(move |engine, _| match question(engine) {
            Some(found) => {
                self.send(found);
                true
            }
            None => !self.is_wanted(),
        })
    }
}

impl<T> Drop for Reply<T> {
    fn drop(&mut self) {
        self.slot.end(State::Gone);
    }
}

impl<T> Job<T> {
    /// Waits for the end.
    ///
    /// # Errors
    /// [`Error::Gone`]: the thread has ended, the MainDevice was stopped meanwhile or is INACTIVE now, or the result
    /// was taken before.
    pub fn wait(self) -> Result<T, Error> {
        let mut state = self.slot.state();
        loop {
            if let Some(result) = state.take() {
                return result;
            }
            state = self.slot.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Waits for the end until a limit; `None` if the work still runs.
    pub fn wait_for(&mut self, limit: Duration) -> Option<Result<T, Error>> {
        let begin = WallClock::now();
        let mut state = self.slot.state();
        loop {
            let left = limit.saturating_sub(begin.elapsed());
            if let Some(result) = state.take() {
                return Some(result);
            }
            if left.is_zero() {
                return None;
            }
            state = self.slot.changed.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Takes the result, once; `None` while the work runs.
    pub fn take(&mut self) -> Option<Result<T, Error>> {
        self.slot.state().take()
    }

    /// Aborts the work, an SDO transfer also at the SubDevice. Waits until the abort has begun.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn abort(self) -> Result<(), Error> {
        self.slot.end(State::Aborted);
        // The thread works in order: this request is processed after the abort.
        self.thread.catch_up()
    }
}

impl<T, E> Job<Result<T, E>>
where
    Error: From<E>,
{
    /// Waits for the end, with one error type for failed work and for an ended thread.
    ///
    /// # Errors
    /// As [`Job::wait`], or the work failed.
    pub fn finish(self) -> Result<T, Error> {
        Ok(self.wait()??)
    }
}

impl<T> Future for Job<T> {
    type Output = Result<T, Error>;

    fn poll(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Result<T, Error>> {
        let mut state = self.slot.state();
        match state.take() {
            Some(result) => Poll::Ready(result),
            None => {
                *state = State::Running(Some(context.waker().clone()));
                Poll::Pending
            }
        }
    }
}

impl<T> Drop for Job<T> {
    fn drop(&mut self) {
        let is_running = matches!(*self.slot.state(), State::Running(_));
        self.slot.end(State::Aborted);
        if is_running {
            self.thread.wake();
        }
    }
}

impl<T> fmt::Debug for Job<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let is_running = matches!(*self.slot.state(), State::Running(_));
        f.debug_struct("Job").field("running", &is_running).finish_non_exhaustive()
    }
}
