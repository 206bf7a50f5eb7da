//! A value that one caller at a time uses. A second caller is refused at once: no lock, no waiting. After a panic of a
//! caller the value may be half changed: the claim is not given back, and every later caller is refused.

use std::cell::UnsafeCell;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::code::{Code, Outcome};

/// Pause between two tries of a caller that may wait.
const PAUSE: Duration = Duration::from_micros(50);

/// A value that one caller at a time uses.
#[derive(Debug)]
pub struct Claim<T> {
    is_taken: AtomicBool,
    /// A caller panicked: the claim stays taken.
    has_failed: AtomicBool,
    value: UnsafeCell<T>,
}

// SAFETY: `use_now` gives a reference to one caller at a time: the atomic is taken with acquire order before, and given
// back with release order after. When the caller panics it is not given back.
unsafe impl<T: Send> Sync for Claim<T> {}

/// Dropped by a panic alone: marks the claim as failed.
struct Failing<'a>(&'a AtomicBool);

impl Drop for Failing<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

impl<T> Claim<T> {
    /// A value that is not in use.
    pub const fn new(value: T) -> Claim<T> {
        let (is_taken, has_failed) = (AtomicBool::new(false), AtomicBool::new(false));
        Claim { is_taken, has_failed, value: UnsafeCell::new(value) }
    }

    /// Uses the value.
    ///
    /// # Errors
    /// [`Code::BUSY`]: another caller uses it. [`Code::IO`]: a caller panicked.
    #[inline(always)]
    pub fn use_now<R>(&self, work: impl FnOnce(&mut T) -> R) -> Outcome<R> {
        if self.is_taken.swap(true, Ordering::Acquire) {
            return Err(self.refusal());
        }
        let failing = Failing(&self.has_failed);
        // SAFETY: the swap made this caller the only one until the claim is given back below.
        let result = work(unsafe { &mut *self.value.get() });
        std::mem::forget(failing);
        self.is_taken.store(false, Ordering::Release);
        Ok(result)
    }

    #[cold]
    fn refusal(&self) -> Code {
        if self.has_failed.load(Ordering::Acquire) { Code::IO } else { Code::BUSY }
    }

    /// Takes the value out after a panic, half changed as it may be, and leaves another one, which may be used. `None`
    /// if nothing has failed.
    pub fn recover(&self, other: T) -> Option<T> {
        self.has_failed.swap(false, Ordering::AcqRel).then(|| {
            // SAFETY: the claim is still taken, and its caller has ended; of several callers the swap admits one.
            let failed = std::mem::replace(unsafe { &mut *self.value.get() }, other);
            self.is_taken.store(false, Ordering::Release);
            failed
        })
    }

    /// Uses the value; waits for another caller up to a limit. Not for the cyclic path.
    ///
    /// # Errors
    /// [`Code::BUSY`]: another caller uses it all the time. [`Code::IO`]: a caller panicked.
    pub fn use_within<R>(&self, limit: Duration, work: impl FnOnce(&mut T) -> R) -> Outcome<R> {
        let begin = Instant::now();
        let mut work = Some(work);
        loop {
            // Once the claim is given, there is work: it is taken only there.
            match self.use_now(|value| work.take().map(|work| work(value))) {
                Ok(Some(result)) => return Ok(result),
                Err(code) if code != Code::BUSY || begin.elapsed() >= limit => return Err(code),
                _ => {}
            }
            std::thread::sleep(PAUSE);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: c-interface
    #[test]
    fn a_second_caller_is_refused_while_the_first_one_works() {
        let claim = Claim::new(1);
        let inner = claim.use_now(|value| {
            *value += 1;
            (claim.use_now(|_| ()), claim.use_within(Duration::from_millis(1), |_| ()))
        });
        assert_eq!(inner, Ok((Err(Code::BUSY), Err(Code::BUSY))));
        assert_eq!(claim.use_within(Duration::ZERO, |value| *value), Ok(2));
    }

    // covers: c-interface
    #[test]
    fn after_a_panic_the_value_is_refused_until_it_is_taken_out() {
        let claim = Claim::new(1);
        assert_eq!(claim.recover(0), None);
        let panics = std::panic::AssertUnwindSafe(|| {
            claim.use_now(|value| {
                *value = 2;
                panic!("half changed");
            })
        });
        assert!(std::panic::catch_unwind(panics).is_err());
        assert_eq!(claim.use_now(|value| *value), Err(Code::IO));
        assert_eq!(claim.use_within(Duration::from_secs(60), |value| *value), Err(Code::IO));
        assert_eq!((claim.recover(3), claim.recover(4)), (Some(2), None));
        assert_eq!(claim.use_now(|value| *value), Ok(3));
    }

    // covers: c-interface
    #[test]
    fn several_threads_never_use_the_value_at_once() {
        let claim = Claim::new((0u64, 0u64));
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..10_000 {
                        let _ = claim.use_now(|(first, second)| {
                            *first += 1;
                            *second += 1;
                            assert_eq!(first, second);
                        });
                    }
                });
            }
        });
    }
}
