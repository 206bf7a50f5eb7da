//! Signals between procedures.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::fmt;
use core::future::poll_fn;
use core::task::Poll;

use super::shared_cell::SharedCell;
use super::task::TaskId;

/// Wakes procedures that wait for a condition.
#[derive(Clone)]
pub struct Signal {
    shared: Rc<SharedCell>,
    waiting: Rc<RefCell<Vec<TaskId>>>,
}

impl Signal {
    pub(super) fn new(shared: Rc<SharedCell>) -> Signal {
        Signal { shared, waiting: Rc::default() }
    }

    /// Makes all waiting procedures check their condition again.
    pub fn notify(&self) {
        let mut shared = self.shared.borrow_mut();
        for task in self.waiting.borrow_mut().drain(..) {
            shared.wake(task);
        }
    }

    /// Registers a procedure for the next [`Signal::notify`].
    pub(super) fn register(&self, task: TaskId) {
        let mut waiting = self.waiting.borrow_mut();
        if !waiting.contains(&task) {
            waiting.push(task);
        }
    }

    /// Waits until `ready` returns a value; it is called now and after each [`Signal::notify`].
    pub async fn until<T>(&self, mut ready: impl FnMut() -> Option<T>) -> T {
        poll_fn(|_| {
            if let Some(value) = ready() {
                return Poll::Ready(value);
            }
            self.register(self.shared.borrow().current);
            Poll::Pending
        })
        .await
    }
}

impl fmt::Debug for Signal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Signal").field("waiting", &self.waiting.borrow().len()).finish()
    }
}
