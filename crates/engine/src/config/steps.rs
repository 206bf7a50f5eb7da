//! Counts the steps of a resolution, in tests only: they must grow linearly with the network.

#[cfg(test)]
use core::cell::Cell;

#[cfg(test)]
std::thread_local! {
    static STEPS: Cell<usize> = const { Cell::new(0) };
}

/// Counts a step.
#[inline]
pub(super) fn step() {
    #[cfg(test)]
    STEPS.set(STEPS.get() + 1);
}

/// Steps that this thread has counted so far.
#[cfg(test)]
pub(super) fn so_far() -> usize {
    STEPS.get()
}
