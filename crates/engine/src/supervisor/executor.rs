//! A single-threaded executor for procedures.
//!
//! Procedures wait only for transfers, timers, signals and groups of this engine. Each of these stores its waiting
//! tasks and wakes exactly these, so that neither wakers nor synchronisation are needed.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::task::{Context, Poll, Waker};

use super::shared_cell::SharedCell;
use super::task::{Task, TaskId};

pub(crate) struct Executor {
    shared: Rc<SharedCell>,
    tasks: Vec<Option<Task>>,
    free: Vec<u32>,
}

impl Executor {
    pub(crate) fn new(shared: Rc<SharedCell>) -> Executor {
        Executor { shared, tasks: Vec::new(), free: Vec::new() }
    }

    /// Number of tasks.
    pub(crate) fn count(&self) -> usize {
        self.tasks.len() - self.free.len()
    }

    /// Polls new and woken tasks until all of them wait.
    pub(crate) fn run(&mut self) {
        let mut context = Context::from_waker(Waker::noop());
        loop {
            self.adopt();
            let Some(id) = self.shared.borrow_mut().next_ready() else { return };
            let Some(mut task) = self.tasks.get_mut(id.0 as usize).and_then(Option::take) else { continue };
            self.shared.borrow_mut().current = id;
            match task.as_mut().poll(&mut context) {
                Poll::Pending => self.tasks[id.0 as usize] = Some(task),
                Poll::Ready(()) => self.free.push(id.0),
            }
        }
    }

    fn adopt(&mut self) {
        loop {
            let Some(task) = self.shared.borrow_mut().spawned.pop_front() else { return };
            let index = self.free.pop().unwrap_or_else(|| {
                self.tasks.push(None);
                (self.tasks.len() - 1) as u32
            });
            self.tasks[index as usize] = Some(task);
            self.shared.borrow_mut().wake(TaskId(index));
        }
    }
}

impl Drop for Executor {
    fn drop(&mut self) {
        self.tasks.clear();
        // Procedures that were spawned and never polled have handles to what holds them.
        loop {
            let task = self.shared.borrow_mut().spawned.pop_front();
            if task.is_none() {
                return;
            }
        }
    }
}
