//! The latest frames of other MainDevices, kept for the application in memory that was reserved at activation.

use alloc::boxed::Box;
use alloc::vec;

use ringcat_wire::frame::MAX_FRAME_VLAN;

use crate::link::Link;

/// Number of frames kept; further ones are only counted. Enough to notice a collision, not to archive it.
const KEPT: usize = 4;

#[derive(Debug)]
struct Kept {
    arrived_on: Link,
    length: usize,
    bytes: Box<[u8]>,
}

/// A frame of another MainDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ForeignFrame<'a> {
    /// The link on which it arrived.
    pub arrived_on: Link,
    /// Its bytes without FCS.
    pub bytes: &'a [u8],
}

#[derive(Debug)]
pub(crate) struct ForeignFrames {
    kept: [Kept; KEPT],
    head: usize,
    count: usize,
}

impl ForeignFrames {
    pub(crate) fn new() -> ForeignFrames {
        let kept = core::array::from_fn(|_| Kept {
            arrived_on: Link::Main,
            length: 0,
            bytes: vec![0; MAX_FRAME_VLAN].into_boxed_slice(),
        });
        ForeignFrames { kept, head: 0, count: 0 }
    }

    pub(crate) fn keep(&mut self, arrived_on: Link, bytes: &[u8]) {
        if self.count == KEPT {
            return;
        }
        let kept = &mut self.kept[(self.head + self.count) % KEPT];
        let length = bytes.len().min(kept.bytes.len());
        kept.bytes[..length].copy_from_slice(&bytes[..length]);
        kept.length = length;
        kept.arrived_on = arrived_on;
        self.count += 1;
    }

    pub(crate) fn pop(&mut self) -> Option<ForeignFrame<'_>> {
        if self.count == 0 {
            return None;
        }
        let kept = &self.kept[self.head];
        self.head = (self.head + 1) % KEPT;
        self.count -= 1;
        Some(ForeignFrame { arrived_on: kept.arrived_on, bytes: &kept.bytes[..kept.length] })
    }
}
