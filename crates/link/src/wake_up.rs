//! Ends the wait of another thread.
//!
//! Output: a [`Waker`], for any thread; its use costs one system call. The waiting thread sees it in the same `ppoll`
//! as its sockets ([`crate::waiting::wait_or_wake`]). A wake-up that comes before the wait ends it at once.

use std::os::fd::{AsRawFd, OwnedFd, RawFd};
use std::sync::Arc;
use std::task::{Wake, Waker};

use crate::error::LinkError;
use crate::kernel;

/// Ends the wait of one thread.
#[derive(Clone, Debug)]
pub struct WakeUp(Arc<Counter>);

#[derive(Debug)]
struct Counter(OwnedFd);

impl WakeUp {
    /// A wake-up that nothing has used yet.
    ///
    /// # Errors
    /// The process has no more descriptors.
    pub fn new() -> Result<WakeUp, LinkError> {
        let counter = kernel::event_counter();
        let counter = counter.map_err(|errno| LinkError::from_errno("", "making a wake-up for a thread", errno))?;
        Ok(WakeUp(Arc::new(Counter(counter))))
    }

    /// The handle for other threads.
    pub fn waker(&self) -> Waker {
        Waker::from(self.0.clone())
    }

    /// The descriptor, readable after a wake-up.
    pub(crate) fn fd(&self) -> RawFd {
        self.0.0.as_raw_fd()
    }

    /// Forgets the wake-ups so far.
    pub(crate) fn clear(&self) {
        kernel::clear_counter(self.fd());
    }
}

impl Wake for Counter {
    fn wake(self: Arc<Self>) {
        self.wake_by_ref();
    }

    fn wake_by_ref(self: &Arc<Self>) {
        kernel::count(self.0.as_raw_fd());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::monotonic::now_ns;
    use crate::waiting::wait_or_wake;

    // covers: links
    #[test]
    fn a_wake_up_ends_a_wait_also_if_it_comes_first_and_only_once() {
        let wake_up = WakeUp::new().expect("there are descriptors");
        let begin = now_ns();
        wake_up.waker().wake();
        wake_up.waker().wake_by_ref();
        assert!(!wait_or_wake(&[], &wake_up, now_ns(), now_ns() + 10_000_000_000));
        let waker = wake_up.waker();
        let other = std::thread::spawn(move || waker.wake());
        assert!(!wait_or_wake(&[], &wake_up, now_ns(), now_ns() + 10_000_000_000));
        other.join().expect("it does not panic");
        assert!(now_ns() < begin + 5_000_000_000);
        let until = now_ns() + 3_000_000;
        assert!(!wait_or_wake(&[], &wake_up, now_ns(), until));
        assert!(now_ns() >= until, "no wake-up is left");
    }
}
