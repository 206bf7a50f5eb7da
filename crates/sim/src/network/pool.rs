//! Frames in the segment, in reused slots: after the maximum number of simultaneous frames, sending does not allocate.

use crate::frame::SimFrame;

/// Number of buffers kept for later frames; further ones are freed.
const SPARE_BUFFERS: usize = 1_024;

/// Number of a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Slot(u32);

/// The frames in the segment.
#[derive(Debug, Default)]
pub(crate) struct FramePool {
    frames: Vec<SimFrame>,
    free: Vec<Slot>,
    spare: Vec<Vec<u8>>,
    last_id: u64,
}

impl FramePool {
    /// Adds a new frame with a new number.
    pub(crate) fn put(&mut self, bytes: &[u8]) -> Slot {
        let slot = self.empty_slot();
        self.last_id += 1;
        self.frames[slot.0 as usize].refill(self.last_id, bytes);
        slot
    }

    /// Adds a copy of a frame with a new number.
    pub(crate) fn put_copy(&mut self, of: Slot) -> Slot {
        let slot = self.empty_slot();
        self.last_id += 1;
        let (copy, original) = two_of(&mut self.frames, slot.0 as usize, of.0 as usize);
        copy.copy_from(original);
        copy.id = self.last_id;
        slot
    }

    /// The frame.
    pub(crate) fn frame(&self, slot: Slot) -> &SimFrame {
        &self.frames[slot.0 as usize]
    }

    /// The frame.
    pub(crate) fn frame_mut(&mut self, slot: Slot) -> &mut SimFrame {
        &mut self.frames[slot.0 as usize]
    }

    /// Number of frames in the segment.
    pub(crate) fn under_way(&self) -> usize {
        self.frames.len() - self.free.len()
    }

    /// Removes a frame.
    pub(crate) fn remove(&mut self, slot: Slot) {
        self.free.push(slot);
    }

    /// Removes a frame and returns its bytes.
    pub(crate) fn remove_bytes(&mut self, slot: Slot) -> Vec<u8> {
        self.free.push(slot);
        core::mem::take(&mut self.frames[slot.0 as usize].bytes)
    }

    /// Stores a buffer for later frames.
    pub(crate) fn give_back(&mut self, bytes: Vec<u8>) {
        if self.spare.len() < SPARE_BUFFERS && bytes.capacity() > 0 {
            self.spare.push(bytes);
        }
    }

    fn empty_slot(&mut self) -> Slot {
        let slot = self.free.pop().unwrap_or_else(|| {
            self.frames.push(SimFrame::new(0, Vec::new()));
            Slot((self.frames.len() - 1) as u32)
        });
        let bytes = &mut self.frames[slot.0 as usize].bytes;
        if bytes.capacity() == 0
            && let Some(spare) = self.spare.pop()
        {
            *bytes = spare;
        }
        slot
    }
}

/// Two different elements of a slice.
fn two_of<T>(items: &mut [T], one: usize, two: usize) -> (&mut T, &T) {
    if one < two {
        let (head, tail) = items.split_at_mut(two);
        (&mut head[one], &tail[0])
    } else {
        let (head, tail) = items.split_at_mut(one);
        (&mut tail[0], &head[two])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_and_buffers_are_reused() {
        let mut pool = FramePool::default();
        let first = pool.put(&[1; 60]);
        let bytes = pool.remove_bytes(first);
        let buffer = bytes.as_ptr();
        pool.give_back(bytes);
        let second = pool.put(&[2; 60]);
        assert_eq!((second, pool.frame(second).bytes.as_ptr()), (first, buffer));
        assert_eq!(pool.frame(second).id, 2);
    }

    #[test]
    fn a_copy_has_the_same_bytes_and_another_number() {
        let mut pool = FramePool::default();
        let original = pool.put(&[7; 60]);
        let spare = pool.put(&[0; 60]);
        pool.remove(spare);
        for _ in 0..2 {
            let copy = pool.put_copy(original);
            assert_eq!(pool.frame(copy).bytes, pool.frame(original).bytes);
            assert_ne!(pool.frame(copy).id, pool.frame(original).id);
        }
    }
}
