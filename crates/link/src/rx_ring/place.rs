//! The slot of a ring that the kernel fills next, for a process that has not read the ring from its beginning.
//!
//! The kernel fills the slots in turn. Slots with frames that were not read are one run, which begins behind a slot
//! of the kernel. Without such frames the times of the frames that were there before show the last slot that was
//! filled; they lead astray if the host's clock was set back.

use std::sync::atomic::{AtomicU32, Ordering};

use super::{RxRing, SLOT, stamp};
use crate::kernel::TP_STATUS_USER;

/// Where a process begins to read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// The slot.
    pub slot: u32,
    /// Whether it is certain: a frame waits there.
    pub is_certain: bool,
}

impl RxRing {
    /// The slot that is read next.
    pub fn next_slot(&self) -> u32 {
        ((self.head.as_ptr().addr() - self.base.as_ptr().addr()) / SLOT) as u32
    }

    /// Reads from this slot on; the number is taken modulo the number of slots.
    pub fn go_to(&mut self, slot: u32) {
        let slot = slot as usize % self.slots;
        // SAFETY: the slot lies within the mapping.
        self.head = unsafe { self.base.add(slot * SLOT) };
    }

    /// Looks at all slots for the oldest frame, or else for the newest one that was read.
    pub fn find(&self) -> Place {
        let slots: Vec<(bool, u64)> = (0..self.slots).map(|slot| self.state(slot)).collect();
        next(&slots)
    }

    /// Whether a frame waits in a slot, and the time of the last frame in it.
    fn state(&self, slot: usize) -> (bool, u64) {
        // SAFETY: the slot lies within the mapping and is aligned; its first word is shared with the kernel.
        let status = unsafe { AtomicU32::from_ptr(self.base.as_ptr().add(slot * SLOT).cast()) };
        let waits = status.load(Ordering::Acquire) & TP_STATUS_USER != 0;
        // The times may change while they are read; a slot that the kernel fills now waits in the next look.
        // SAFETY: the mapping lives as long as `self`; volatile reads of bytes allow any value.
        let byte = |at: usize| unsafe { self.base.as_ptr().add(slot * SLOT + at).read_volatile() };
        let header: [u8; 24] = std::array::from_fn(byte);
        (waits, stamp(&header))
    }
}

/// The place, by slot: whether a frame waits, and its time.
fn next(slots: &[(bool, u64)]) -> Place {
    let before = |at: usize| slots[(at + slots.len() - 1) % slots.len()];
    let waits = |at: &usize| slots[*at].0;
    if let Some(first) = (0..slots.len()).find(|at| waits(at) && !before(*at).0) {
        return Place { slot: first as u32, is_certain: true };
    }
    let times = || slots.iter().enumerate().filter(|(_, (_, time))| *time > 0);
    if slots.iter().all(|(waits, _)| *waits) {
        // Full: the oldest frame.
        let oldest = times().min_by_key(|(_, (_, time))| *time).map_or(0, |(at, _)| at);
        return Place { slot: oldest as u32, is_certain: true };
    }
    let newest = times().max_by_key(|(_, (_, time))| *time);
    Place { slot: newest.map_or(0, |(at, _)| (at + 1) % slots.len()) as u32, is_certain: false }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_that_wait_are_read_from_the_oldest_on() {
        let slots = [(true, 9), (false, 2), (false, 3), (true, 8)];
        assert_eq!(next(&slots), Place { slot: 3, is_certain: true });
        let full = [(true, 9), (true, 6), (true, 7), (true, 8)];
        assert_eq!(next(&full), Place { slot: 1, is_certain: true });
    }

    #[test]
    fn without_frames_the_place_is_behind_the_newest_one() {
        let slots = [(false, 5), (false, 6), (false, 3), (false, 4)];
        assert_eq!(next(&slots), Place { slot: 2, is_certain: false });
        assert_eq!(next(&[(false, 5), (false, 6)]), Place { slot: 0, is_certain: false });
        assert_eq!(next(&[(false, 0); 4]), Place { slot: 0, is_certain: false });
        assert_eq!(next(&[(false, 7), (false, 0)]), Place { slot: 1, is_certain: false });
    }
}
