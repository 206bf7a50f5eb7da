//! Mutexes outside of the cyclic path, and values of this process alone.

use std::sync::atomic::{AtomicPtr, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::host::generation;

/// Locks a mutex. A panic of another holder leaves plain data, which stays usable.
pub fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A value of this process, made when it is first used. A child made by `fork` makes its own: another thread of its
/// parent may have locked the parent's value at that moment, and unlocks it in the parent only.
pub struct OfProcess<T>(AtomicPtr<Made<T>>);

struct Made<T> {
    generation: u64,
    value: T,
}

impl<T: Send + Sync + 'static> OfProcess<T> {
    /// A value that is not made yet.
    pub const fn new() -> OfProcess<T> {
        OfProcess(AtomicPtr::new(std::ptr::null_mut()))
    }

    /// The value. That of a parent process stays in memory, unused.
    pub fn of(&'static self, make: impl Fn() -> T) -> &'static T {
        loop {
            let known = self.0.load(Ordering::Acquire);
            // SAFETY: null, or memory of a `Box` that was published below and is never freed.
            if let Some(made) = unsafe { known.as_ref() }
                && made.generation == generation()
            {
                return &made.value;
            }
            let new = Box::into_raw(Box::new(Made { generation: generation(), value: make() }));
            if self.0.compare_exchange(known, new, Ordering::AcqRel, Ordering::Acquire).is_err() {
                // SAFETY: the box of above, which was not published: another thread was faster.
                drop(unsafe { Box::from_raw(new) });
            }
        }
    }
}

impl<T: Default + Send + 'static> OfProcess<Mutex<T>> {
    /// Locks the value.
    pub fn lock(&'static self) -> MutexGuard<'static, T> {
        locked(self.of(Mutex::default))
    }
}
