//! What the cyclic half posts and the links tell, as far as it changes by events and not with each cycle.

use alloc::vec::Vec;

use super::task::TaskId;
use crate::board::{RingWord, Supervision};

/// What is posted, as far as it changes by events and not with each cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Posted {
    /// What the latest supervision datagram has brought back.
    pub supervision: Option<Supervision>,
    /// The state of the ring.
    pub ring: RingWord,
    /// By [`crate::link::Link::index`].
    pub carriers: [Option<bool>; 2],
    /// How often requests of a cyclic thread were started or cancelled.
    pub requests: u32,
    /// How often clocks are not told a time since ports have changed.
    pub holds: u32,
}

/// Procedures that wait for another word, and the words of when they were woken last.
#[derive(Debug, Default)]
pub(super) struct Watchers {
    /// Those that wait.
    pub waiting: Vec<TaskId>,
    /// What was posted when they were woken last.
    pub seen: Posted,
}
