//! The INACTIVE: takes Ethernet frames of the ACTIVE, and puts its own ones into the room of its polls.

use alloc::boxed::Box;
use alloc::vec;

use ringcat_wire::master_frame::{Area, EthernetHead, MAX_ETHERNET, fragments_mut};

use super::PartnerEthernet;
use crate::ring::is_forwarded;
use crate::time::Instant;

/// Answers that are kept for the second copy of their polls: more than the ACTIVE sends while a frame passes the ring.
const KEPT: usize = 16;

/// What this MainDevice has put into a poll: the same in both copies.
#[derive(Debug)]
struct Answer {
    /// Stream of the ACTIVE and number of the poll.
    poll: Option<(u32, u32)>,
    length: usize,
    bytes: Box<[u8]>,
}

/// The last answers.
#[derive(Debug)]
pub(super) struct Answers {
    kept: [Answer; KEPT],
    /// The newest poll.
    newest: Option<(u32, u32)>,
}

impl Answers {
    pub fn new() -> Answers {
        let answer =
            || Answer { poll: None, length: 0, bytes: vec![0; EthernetHead::LEN + MAX_ETHERNET].into_boxed_slice() };
        Answers { kept: core::array::from_fn(|_| answer()), newest: None }
    }

    /// Whether a poll is later than all before.
    fn is_new(&self, (stream, number): (u32, u32)) -> bool {
        self.newest.is_none_or(|(of, newest)| of != stream || number.wrapping_sub(newest) as i32 > 0)
    }
}

impl PartnerEthernet {
    /// Works on a received master frame of the ACTIVE before it is forwarded, on its first pass. Any bytes are allowed.
    pub fn fill(&mut self, frame: &mut [u8], now: Instant) {
        if is_forwarded(frame) {
            return;
        }
        let mut poll = None;
        for mut fragment in fragments_mut(frame) {
            let is_done = match fragment.head.area {
                Area::EthernetToInactive => {
                    let Some((head, ethernet)) = EthernetHead::split(fragment.data) else { continue };
                    poll = Some((head.stream, fragment.head.cycle));
                    self.note_sign(now);
                    self.take(&head, ethernet, now);
                    true
                }
                Area::EthernetToActive => poll.is_some_and(|poll| self.answer(poll, fragment.data, now)),
                _ => false,
            };
            if is_done {
                fragment.count();
            }
        }
    }

    /// Fills the room of a poll: with the next frame, or with what its other copy has got. False if that is not known
    /// any more.
    fn answer(&mut self, poll: (u32, u32), room: &mut [u8], now: Instant) -> bool {
        let at = poll.1 as usize % KEPT;
        if self.answers.is_new(poll) {
            let Some(room) = room.len().checked_sub(EthernetHead::LEN) else { return false };
            self.answers.newest = Some(poll);
            let mut bytes = core::mem::take(&mut self.answers.kept[at].bytes);
            let length = self.put_next(room, &mut bytes, now);
            self.answers.kept[at] = Answer { poll: Some(poll), length, bytes };
        }
        let Answer { poll: of, length, bytes } = &self.answers.kept[at];
        if *of != Some(poll) || *length > room.len() {
            return false;
        }
        room[..*length].copy_from_slice(&bytes[..*length]);
        true
    }
}
