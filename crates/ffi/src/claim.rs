//! A value that one caller at a time uses. A second caller is refused at once: no lock, no waiting.

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
    value: UnsafeCell<T>,
}

// SAFETY: `use_now` gives a reference to one caller at a time: the atomic is taken with acquire order before, and given
// back with release order after, also when the caller panics.
unsafe impl<T: Send> Sync for Claim<T> {}

/// Gives the claim back.
struct Taken<'a>(&'a AtomicBool);

impl Drop for Taken<'_> {
    fn drop(&mut self) {
        self.0.store(false, Ordering::Release);
    }
}

impl<T> Claim<T> {
    /// A value that is not in use.
    pub const fn new(value: T) -> Claim<T> {
        Claim { is_taken: AtomicBool::new(false), value: UnsafeCell::new(value) }
    }

    /// Uses the value.
    ///
    /// # Errors
    /// [`Code::BUSY`]: another caller uses it.
    #[inline(always)]
    pub fn use_now<R>(&self, work: impl FnOnce(&mut T) -> R) -> Outcome<R> {
        if self.is_taken.swap(true, Ordering::Acquire) {
            return Err(Code::BUSY);
        }
        let _taken = Taken(&self.is_taken);
        // SAFETY: the swap made this caller the only one until `_taken` is dropped.
        Ok(work(unsafe { &mut *self.value.get() }))
    }

    /// Uses the value; waits for another caller up to a limit. Not for the cyclic path.
    ///
    /// # Errors
    /// [`Code::BUSY`]: another caller uses it all the time.
    pub fn use_within<R>(&self, limit: Duration, work: impl FnOnce(&mut T) -> R) -> Outcome<R> {
        let begin = Instant::now();
        let mut work = Some(work);
        loop {
            // Once the claim is given, there is work: it is taken only there.
            if let Ok(Some(result)) = self.use_now(|value| work.take().map(|work| work(value))) {
                return Ok(result);
            }
            if begin.elapsed() >= limit {
                return Err(Code::BUSY);
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
