//! What the acyclic half of an owner orders from the daemon: the thread that receives passes it on, so that the acyclic
//! half waits for nothing.

use std::io::{self, PipeReader, PipeWriter, Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ringcat_control::message::Content;
use ringcat_engine::link::Link;

use crate::packet::SwitchLinks;

/// Orders that wait; further ones are refused.
const MOST: usize = 64;

/// Orders that wait to be passed on.
#[derive(Debug)]
pub(super) struct Orders {
    waiting: Mutex<Vec<Content>>,
    /// Has a byte while orders wait.
    bell: (PipeReader, PipeWriter),
}

impl Orders {
    /// No order waits.
    ///
    /// # Errors
    /// The process has no more descriptors.
    pub fn new() -> io::Result<Arc<Orders>> {
        Ok(Arc::new(Orders { waiting: Mutex::default(), bell: io::pipe()? }))
    }

    fn waiting(&self) -> MutexGuard<'_, Vec<Content>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds an order; false if too many wait.
    pub fn push(&self, order: Content) -> bool {
        let mut waiting = self.waiting();
        if waiting.len() >= MOST {
            return false;
        }
        // One byte at most is in the pipe, so the write never waits.
        let is_rung = !waiting.is_empty() || (&self.bell.1).write_all(&[0]).is_ok();
        waiting.push(order);
        is_rung
    }

    /// Takes all orders.
    pub fn take(&self) -> Vec<Content> {
        let mut waiting = self.waiting();
        if !waiting.is_empty() {
            // The byte is there: it was written before the first order was added.
            let _ = (&self.bell.0).read(&mut [0]);
        }
        std::mem::take(&mut *waiting)
    }
}

impl AsFd for Orders {
    /// Readable while orders wait.
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.bell.0.as_fd()
    }
}

impl SwitchLinks for Orders {
    fn switch(&self, link: Link, up: bool) -> bool {
        self.push(Content::SwitchLink { is_redundant: link == Link::Redundant, up })
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use ringcat_link::process::wait_readable;

    use super::*;

    // covers: daemon
    #[test]
    fn orders_wait_in_their_order_and_are_few() {
        let orders = Orders::new().expect("there are descriptors");
        let is_rung = |orders: &Orders| wait_readable(&[orders.as_fd()], Duration::ZERO) == 1;
        for _ in 0..2 {
            assert!(!is_rung(&orders) && orders.take().is_empty());
            assert!(orders.switch(Link::Redundant, false) && orders.switch(Link::Main, true) && is_rung(&orders));
            let expected = [(true, false), (false, true)];
            let expected = expected.map(|(is_redundant, up)| Content::SwitchLink { is_redundant, up });
            assert_eq!(orders.take(), expected);
        }
        assert_eq!((0..100).filter(|_| orders.push(Content::Knowledge)).count(), MOST);
        assert_eq!(orders.take().len(), MOST);
        assert!(!is_rung(&orders));
    }
}
