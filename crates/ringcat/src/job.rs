//! Work in the thread of the acyclic half whose result is asked for from another thread.
//!
//! A [`Job`] and the [`Reply`] to it share a slot. The thread fills it, once; the job waits for it, polls it or is
//! awaited as a future. The type of the result is known at both ends.

use std::fmt;
use std::future::Future;
use std::pin::Pin;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Waker};
use std::time::{Duration, Instant as WallClock};

use ringcat_engine::main_device::{MainDevice as Engine, Pending};
use ringcat_engine::time::Instant;

use crate::error::Error;

/// Work under way in the thread of a [`SupervisorThread`](crate::SupervisorThread). Dropped, it is aborted: an SDO
/// transfer at the SubDevice, too.
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

/// Work under way in the thread: it has a turn in each of the thread's turns, until it has ended.
pub(crate) type Task = Box<dyn FnMut(&mut Engine, Instant) -> bool>;

/// The thread, as jobs see it: requests are processed in order. It runs as long as one of these exists.
pub(crate) trait InOrder: Send + Sync {
    /// Waits until the thread has processed all earlier requests.
    fn catch_up(&self) -> Result<(), Error>;

    /// Ends a sleep of the thread.
    fn wake(&self);
}

/// The other end of a job, in the thread. Dropped without a result, it reports that there will be none.
pub(crate) struct Reply<T> {
    slot: Arc<Slot<T>>,
}

struct Slot<T> {
    state: Mutex<State<T>>,
    changed: Condvar,
}

enum State<T> {
    /// The work goes on; the waker of the task that awaits its end.
    Running(Option<Waker>),
    Done(T),
    /// There will be no result: it was taken, or the work was ended before it had one.
    Gone,
    /// The result is not wanted.
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
    /// The result, once; `None` while the work goes on.
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

    /// Work of the engine, as a task that ends with it.
    pub(crate) fn follow(self, mut pending: Pending<T>) -> Task {
        Box::new(move |_, _| {
            let is_running = pending.is_running();
            if let Some(result) = pending.take() {
                self.send(result);
                return true;
            }
            // What the MainDevice has ended by a stop has no result.
            !is_running || !self.is_wanted()
        })
    }

    /// A question to the engine, as a task that ends with its answer.
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
    /// [`Error::Gone`]: the thread is gone, the MainDevice was stopped meanwhile, or the result was taken before.
    pub fn wait(self) -> Result<T, Error> {
        let mut state = self.slot.state();
        loop {
            if let Some(result) = state.take() {
                return result;
            }
            state = self.slot.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Waits for the end, for so long at most; `None` where the work goes on.
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

    /// The result, once; `None` while the work goes on.
    pub fn take(&mut self) -> Option<Result<T, Error>> {
        self.slot.state().take()
    }

    /// Ends the work: an SDO transfer is aborted at the SubDevice, too. Waits until that has begun.
    ///
    /// # Errors
    /// The thread is gone.
    pub fn abort(self) -> Result<(), Error> {
        self.slot.end(State::Aborted);
        // The thread looks at what it has under way in order: this comes behind the work.
        self.thread.catch_up()
    }
}

impl<T, E> Job<Result<T, E>>
where
    Error: From<E>,
{
    /// Waits for the end, with one error for what failed and for a thread that is gone.
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
