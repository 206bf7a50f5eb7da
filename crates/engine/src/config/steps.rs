//! Counts the work of a resolution in tests: it has to grow as networks do.

#[cfg(test)]
use core::cell::Cell;

#[cfg(test)]
std::thread_local! {
    static STEPS: Cell<usize> = const { Cell::new(0) };
}

/// A step.
#[inline]
pub(super) fn step() {
    #[cfg(test)]
    STEPS.set(STEPS.get() + 1);
}

/// The steps of this thread so far.
#[cfg(test)]
pub(super) fn so_far() -> usize {
    STEPS.get()
}
