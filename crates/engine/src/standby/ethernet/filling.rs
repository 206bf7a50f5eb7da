//! The INACTIVE: takes Ethernet frames of the ACTIVE, and puts its own ones into the room of its polls.

use ringcat_wire::master_frame::{Area, EthernetHead, fragments_mut};

use super::answers::Answer;
use super::state::PartnerEthernet;
use crate::ring::is_forwarded;
use crate::time::Instant;

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
        if self.answers.is_new(poll) {
            let Some(room) = room.len().checked_sub(EthernetHead::LEN) else { return false };
            self.answers.newest = Some(poll);
            let mut bytes = core::mem::take(&mut self.answers.of(poll).bytes);
            let length = self.put_next(room, &mut bytes, now);
            *self.answers.of(poll) = Answer { poll: Some(poll), length, bytes };
        }
        let Answer { poll: of, length, bytes } = self.answers.of(poll);
        if *of != Some(poll) || *length > room.len() {
            return false;
        }
        room[..*length].copy_from_slice(&bytes[..*length]);
        true
    }
}
