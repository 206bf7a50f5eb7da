//! Ends the wait of a thread: by another thread, or by data at a descriptor.
//!
//! Output: a [`Waker`], for any thread; its use costs one system call. The waiting thread receives it in the same
//! `ppoll` as its sockets ([`crate::waiting::wait_or_wake`]). A wake-up that comes before the wait ends it at once. New
//! data at a watched descriptor ends one wait; what was not read then ends no further wait.

use std::os::fd::{AsFd, AsRawFd, OwnedFd, RawFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Wake, Waker};

use crate::error::LinkError;
use crate::kernel;

/// Ends the wait of one thread.
#[derive(Clone, Debug)]
pub struct WakeUp(Arc<Counter>);

#[derive(Debug)]
struct Counter {
    /// Written by other threads.
    counter: OwnedFd,
    /// The counter and the watched descriptors.
    set: OwnedFd,
    /// A wait was ended since the last [`WakeUp::take_call`].
    is_called: AtomicBool,
}

impl WakeUp {
    /// A wake-up that nothing has used yet.
    ///
    /// # Errors
    /// The process has no more descriptors.
    pub fn new() -> Result<WakeUp, LinkError> {
        let failed = |errno| LinkError::from_errno("", "making a wake-up for a thread", errno);
        let counter = kernel::event_counter().map_err(failed)?;
        let set = kernel::descriptor_set().map_err(failed)?;
        kernel::add_descriptor(set.as_raw_fd(), counter.as_raw_fd()).map_err(failed)?;
        Ok(WakeUp(Arc::new(Counter { counter, set, is_called: AtomicBool::new(false) })))
    }

    /// The handle for other threads.
    pub fn waker(&self) -> Waker {
        Waker::from(self.0.clone())
    }

    /// New data at this descriptor ends a wait, until it is closed. False if the kernel refuses that.
    pub fn watch(&self, descriptor: impl AsFd) -> bool {
        kernel::add_descriptor(self.0.set.as_raw_fd(), descriptor.as_fd().as_raw_fd()).is_ok()
    }

    /// Whether a wait was ended by this since the last call.
    pub fn take_call(&self) -> bool {
        self.0.is_called.swap(false, Ordering::Relaxed)
    }

    /// The descriptor, readable after a wake-up.
    pub(crate) fn fd(&self) -> RawFd {
        self.0.set.as_raw_fd()
    }

    /// Notes the wake-ups so far as a call.
    pub(crate) fn clear(&self) {
        kernel::take_events(self.fd());
        kernel::clear_counter(self.0.counter.as_raw_fd());
        self.0.is_called.store(true, Ordering::Relaxed);
    }
}

impl Wake for Counter {
    fn wake(self: Arc<Self>) {
        self.wake_by_ref();
    }

    fn wake_by_ref(self: &Arc<Self>) {
        kernel::count(self.counter.as_raw_fd());
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::os::unix::net::UnixStream;

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
        assert!(wake_up.take_call());
        assert!(!wake_up.take_call(), "no wait ended since");
    }

    // covers: links
    #[test]
    fn new_data_at_a_descriptor_ends_a_wait_and_data_that_stays_does_not() {
        let wake_up = WakeUp::new().expect("there are descriptors");
        let (mut near, far) = UnixStream::pair().expect("there are sockets");
        assert!(wake_up.watch(&far));
        for _ in 0..3 {
            near.write_all(&[1]).expect("there is room");
            let begin = now_ns();
            assert!(!wait_or_wake(&[], &wake_up, begin, begin + 10_000_000_000));
            assert!(now_ns() < begin + 5_000_000_000);
            assert!(wake_up.take_call());
            let until = now_ns() + 3_000_000;
            assert!(!wait_or_wake(&[], &wake_up, now_ns(), until));
            assert!(now_ns() >= until && !wake_up.take_call(), "the data was there before");
        }
        drop(far);
        let until = now_ns() + 3_000_000;
        assert!(!wait_or_wake(&[], &wake_up, now_ns(), until));
        assert!(now_ns() >= until, "a closed descriptor is not watched");
    }
}
