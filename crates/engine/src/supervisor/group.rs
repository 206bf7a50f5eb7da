//! Procedures that are started together and awaited together.
//!
//! When the group is dropped, its procedures end, so that they do not disturb a new attempt.

use alloc::boxed::Box;
use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::{Cell, RefCell};
use core::future::{Future, poll_fn};
use core::task::Poll;
use core::time::Duration;

use super::bus::Bus;
use super::task::TaskId;

/// SubDevices per step of work without urgency: a frame of 32 us that reads four FMMUs of each.
pub(crate) const TURN: usize = 5;
/// Pause between two such steps.
pub(crate) const TURN_PAUSE: Duration = Duration::from_micros(250);

impl Bus {
    /// Runs a procedure for each item in parallel, and returns their results in the order of the items.
    pub async fn gather<I, T, F>(&self, items: impl IntoIterator<Item = I>, procedure: impl Fn(Bus, I) -> F) -> Vec<T>
    where
        T: 'static,
        F: Future<Output = T> + 'static,
    {
        let group = self.group();
        let results: Rc<RefCell<Vec<Option<T>>>> = Rc::default();
        for (index, item) in items.into_iter().enumerate() {
            results.borrow_mut().push(None);
            // In a box: an async block around it would keep its memory twice.
            let mut one = Box::pin(procedure(self.clone(), item));
            let results = results.clone();
            group.spawn(poll_fn(move |context| {
                one.as_mut().poll(context).map(|result| results.borrow_mut()[index] = Some(result))
            }));
        }
        group.done().await;
        results.take().into_iter().flatten().collect()
    }

    /// As [`Bus::gather`], in small steps with pauses: for work without urgency. Its frames are short, so that cyclic
    /// frames rarely wait for them.
    pub async fn gather_in_turns<I, T, F>(&self, items: Vec<I>, procedure: impl Fn(Bus, I) -> F) -> Vec<T>
    where
        T: 'static,
        F: Future<Output = T> + 'static,
    {
        let mut results = Vec::with_capacity(items.len());
        let mut items = items.into_iter().peekable();
        while items.peek().is_some() {
            results.extend(self.gather(items.by_ref().take(TURN), &procedure).await);
            self.sleep(TURN_PAUSE).await;
        }
        results
    }

    /// A group of procedures that can be awaited together.
    pub fn group(&self) -> Group {
        Group { bus: self.clone(), state: Rc::default() }
    }
}

#[derive(Default)]
struct State {
    running: Cell<usize>,
    waiter: Cell<Option<TaskId>>,
    /// The group was dropped.
    dropped: Cell<bool>,
}

/// Procedures started together. Waiting costs one wake when the last of them ends.
pub struct Group {
    bus: Bus,
    state: Rc<State>,
}

impl Group {
    /// Starts a procedure of the group.
    pub fn spawn(&self, procedure: impl Future<Output = ()> + 'static) {
        self.state.running.set(self.state.running.get() + 1);
        let state = self.state.clone();
        let shared = self.bus.shared.clone();
        let mut procedure = Box::pin(procedure);
        self.bus.spawn(poll_fn(move |context| {
            // A dropped procedure gives up its datagrams.
            if !state.dropped.get() && procedure.as_mut().poll(context).is_pending() {
                return Poll::Pending;
            }
            state.running.set(state.running.get() - 1);
            if state.running.get() == 0
                && let Some(task) = state.waiter.take()
            {
                shared.borrow_mut().wake(task);
            }
            Poll::Ready(())
        }));
    }

    /// Waits for all of them.
    pub async fn done(&self) {
        poll_fn(|_| {
            if self.state.running.get() == 0 {
                return Poll::Ready(());
            }
            self.state.waiter.set(Some(self.bus.shared.borrow().current));
            Poll::Pending
        })
        .await;
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        self.state.dropped.set(true);
    }
}
