//! The smallest global allocator: a static block, handed out from the front, never taken back.

use core::alloc::{GlobalAlloc, Layout};
use core::cell::UnsafeCell;
use core::ptr;
use core::sync::atomic::{AtomicUsize, Ordering};

/// Enough for one engine with a segment of a few SubDevices.
const SIZE: usize = 4 << 20;
/// Alignment of the block; more is refused.
const ALIGN: usize = 16;

#[repr(align(16))]
struct Block(UnsafeCell<[u8; SIZE]>);

struct Bump {
    block: Block,
    used: AtomicUsize,
}

#[global_allocator]
static ALLOCATOR: Bump = Bump { block: Block(UnsafeCell::new([0; SIZE])), used: AtomicUsize::new(0) };

// SAFETY: no byte of the block is handed out twice, since `used` only grows and grows atomically.
unsafe impl Sync for Bump {}

// SAFETY: what is handed out lies inside the block, is aligned as requested, and overlaps no other block.
unsafe impl GlobalAlloc for Bump {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if layout.align() > ALIGN {
            return ptr::null_mut();
        }
        let place = |used: usize| used.checked_next_multiple_of(layout.align())?.checked_add(layout.size());
        let fits = |used: usize| place(used).filter(|end| *end <= SIZE);
        match self.used.fetch_update(Ordering::Relaxed, Ordering::Relaxed, fits) {
            Ok(used) => self.block.0.get().cast::<u8>().wrapping_add(used.next_multiple_of(layout.align())),
            Err(_) => ptr::null_mut(),
        }
    }

    unsafe fn dealloc(&self, _: *mut u8, _: Layout) {}
}
