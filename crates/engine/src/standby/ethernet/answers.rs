//! What an INACTIVE has put into the last polls, for their second copies.

use alloc::boxed::Box;
use alloc::vec;

use ringcat_wire::master_frame::{EthernetHead, MAX_ETHERNET};

/// Answers that are kept for the second copy of their polls: more than the ACTIVE sends while a frame passes the ring.
const KEPT: usize = 16;

/// What this MainDevice has put into a poll: the same in both copies.
#[derive(Debug)]
pub(super) struct Answer {
    /// Stream of the ACTIVE and number of the poll.
    pub poll: Option<(u32, u32)>,
    pub length: usize,
    pub bytes: Box<[u8]>,
}

/// The last answers.
#[derive(Debug)]
pub(super) struct Answers {
    kept: [Answer; KEPT],
    /// The newest poll.
    pub newest: Option<(u32, u32)>,
}

impl Answers {
    pub fn new() -> Answers {
        let answer =
            || Answer { poll: None, length: 0, bytes: vec![0; EthernetHead::LEN + MAX_ETHERNET].into_boxed_slice() };
        Answers { kept: core::array::from_fn(|_| answer()), newest: None }
    }

    /// Whether a poll is later than all before.
    pub fn is_new(&self, (stream, number): (u32, u32)) -> bool {
        self.newest.is_none_or(|(of, newest)| of != stream || number.wrapping_sub(newest) as i32 > 0)
    }

    /// The place of a poll.
    pub fn of(&mut self, (_, number): (u32, u32)) -> &mut Answer {
        &mut self.kept[number as usize % KEPT]
    }
}
