//! The presence datagram of a frame: the AL status of each SubDevice whose process data shares a working counter
//! (protocol 1.4, 3.4, 3.10).
//!
//! Input: a copy of the frame that came back. Output: which SubDevices processed it, once each, and in which state. A
//! byte that stayed zero belongs to a SubDevice that is absent or has lost its FMMUs, because no AL status is zero. A
//! copy usually shows the same as the previous copy on its link: then it is not evaluated again.

use alloc::boxed::Box;
use alloc::vec;

use ringcat_wire::al::{AlState, AlStatus};
use ringcat_wire::datagram::WKC_LEN;

use crate::layout::{Delivers, PlannedPresence};

/// The presence datagram.
#[derive(Debug)]
pub(crate) struct Presence {
    /// Offset of its data in the frame.
    at: usize,
    members: Box<[(usize, Delivers)]>,
    /// Data and working counter of the last evaluated copy, by the link on which it was sent.
    seen: [Box<[u8]>; 2],
}

/// How a SubDevice processed a copy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Passed {
    /// Not processed, as far as its FMMUs show.
    Not,
    /// Processed in a state in which it may or may not deliver its inputs and take outputs.
    Somehow,
    /// Processed in a state in which it delivers its inputs.
    Delivering,
}

impl Presence {
    pub fn new(planned: &PlannedPresence, at: usize) -> Presence {
        let length = planned.members.len() + WKC_LEN;
        let seen = || vec![0; length].into_boxed_slice();
        Presence { at, members: planned.members.iter().copied().collect(), seen: [seen(), seen()] }
    }

    /// Index of a SubDevice among the bytes.
    pub fn place(&self, subdevice: usize) -> Option<usize> {
        self.members.iter().position(|(member, _)| *member == subdevice)
    }

    /// Whether a copy shows exactly the same as the last one evaluated.
    #[inline]
    pub fn is_as_seen(&self, link: usize, frame: &[u8]) -> bool {
        frame.get(self.at..self.at + self.seen[link].len()).is_some_and(|now| *now == *self.seen[link])
    }

    /// Evaluates a copy. False where SubDevices processed it more than once: its working counter is not the number of
    /// bytes.
    pub fn evaluate(&mut self, link: usize, frame: &[u8]) -> bool {
        let length = self.seen[link].len();
        let Some(now) = frame.get(self.at..self.at + length) else { return false };
        self.seen[link].copy_from_slice(now);
        let (data, wkc) = now.split_at(length - WKC_LEN);
        let present = data.iter().filter(|status| **status != 0).count();
        usize::from(u16::from_le_bytes([wkc[0], wkc[1]])) == present
    }

    /// A copy did not come back: it shows no SubDevice.
    pub fn forget(&mut self, link: usize) {
        self.seen[link].fill(0);
    }

    /// How the SubDevice at an index processed the last evaluated copy.
    pub fn passed(&self, link: usize, place: usize) -> Passed {
        let (Some((_, delivers)), Some(status)) = (self.members.get(place), self.seen[link].get(place)) else {
            return Passed::Not;
        };
        if *status == 0 {
            return Passed::Not;
        }
        match (AlStatus::from_bits(u16::from(*status)).al_state(), delivers) {
            (Some(AlState::Op), _) | (Some(AlState::SafeOp), Delivers::FromSafeOp) => Passed::Delivering,
            _ => Passed::Somehow,
        }
    }

    /// The AL status that a SubDevice showed last on either link; `None` for a SubDevice without a byte here.
    pub fn al_status(&self, subdevice: usize) -> Option<u8> {
        let place = self.place(subdevice)?;
        Some(self.seen.iter().fold(0, |status, seen| status | seen.get(place).copied().unwrap_or(0)))
    }
}
