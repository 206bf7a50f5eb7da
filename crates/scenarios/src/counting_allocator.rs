//! An allocator that counts, per thread: number of calls, bytes held, and peak of bytes held.
//!
//! In: the allocations of a program with [`CountingAllocator`] as its global allocator. Out: [`Counts`] of the calling
//! thread. Memory that one thread allocates and another frees is not balanced; programs that use this measure
//! single-threaded work.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// Counts of a thread so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Allocations, including reallocations.
    pub allocations: u64,
    /// Deallocations, including reallocations.
    pub deallocations: u64,
    /// Bytes held.
    pub bytes: i64,
    /// Most bytes held since [`restart_peak`].
    pub peak: i64,
}

thread_local! {
    // Constant and without destructor, so that its use allocates nothing and works at any time.
    static COUNTS: Cell<Counts> =
        const { Cell::new(Counts { allocations: 0, deallocations: 0, bytes: 0, peak: 0 }) };
}

/// Counts of the calling thread.
pub fn counts() -> Counts {
    COUNTS.get()
}

/// Restarts the measurement of the peak.
pub fn restart_peak() {
    COUNTS.set(Counts { peak: COUNTS.get().bytes, ..COUNTS.get() });
}

/// The system's allocator, counting.
#[derive(Clone, Copy, Debug)]
pub struct CountingAllocator;

fn count(taken: usize, given_back: usize) {
    let mut counts = COUNTS.get();
    counts.allocations += u64::from(taken > 0);
    counts.deallocations += u64::from(given_back > 0);
    counts.bytes += taken as i64 - given_back as i64;
    counts.peak = counts.peak.max(counts.bytes);
    COUNTS.set(counts);
}

// SAFETY: every call goes to the system's allocator with the arguments as they came; counting touches a thread-local
// cell that neither allocates nor unwinds.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size(), 0);
        // SAFETY: the caller's obligations are those of the system's allocator.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size(), 0);
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(0, layout.size());
        // SAFETY: as above; the memory came from the system's allocator.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size, layout.size());
        // SAFETY: as above.
        unsafe { System.realloc(pointer, layout, size) }
    }
}
