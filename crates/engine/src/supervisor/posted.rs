//! Words of the cyclic half and of the links that change by events and not with each cycle.

use alloc::vec::Vec;

use super::task::TaskId;
use crate::board::{RingWord, Supervision};

/// Posted words that change by events and not with each cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Posted {
    /// Result of the latest supervision datagram.
    pub supervision: Option<Supervision>,
    /// Its number, for those that wait for the next result ([`Posted::with_next_result`]).
    pub result: Option<u32>,
    /// The state of the ring.
    pub ring: RingWord,
    /// Carriers by [`crate::link::Link::index`]; `None` if the links do not report them.
    pub carriers: [Option<bool>; 2],
    /// Number of requests that a cyclic thread has started or cancelled.
    pub requests: u32,
    /// Number of stops of the time distribution after changes of ports.
    pub holds: u32,
    /// Changes of the times of clocks and application.
    pub times: u32,
}

impl Posted {
    /// The same words; with `number` another one are those with another supervision result, also with an equal one.
    #[must_use]
    pub fn with_next_result(self, number: Option<u32>) -> Posted {
        Posted { result: number, ..self }
    }
}

/// Procedures that wait for a changed word.
#[derive(Debug, Default)]
pub(super) struct Watchers {
    /// Waiting procedures.
    pub waiting: Vec<TaskId>,
    /// One of them waits for the next supervision result, also for an equal one.
    pub wants_result: bool,
    /// Words posted when they were last woken, packed.
    pub seen: PostedWords,
    /// The carriers then.
    pub seen_carriers: [Option<bool>; 2],
}

/// [`Posted`] as the words of other threads lie on the board: compared several times per cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct PostedWords {
    /// The result of the latest supervision datagram, and whether there was any.
    pub supervision: (u64, bool),
    /// Its number, if a procedure waits for the next one.
    pub result: u32,
    pub ring: u64,
    pub requests: u32,
    pub holds: u32,
}
