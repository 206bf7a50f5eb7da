//! What copies of a datagram prove about its SubDevices, and its outputs in a frame that is sent again.

use ringcat_wire::address::Wkc;
use ringcat_wire::command::Command;

use super::{Contribution, INPUTS_OF_LRW, Place, Span, copy};
use crate::exchange::image::InputNumber;
use crate::exchange::proved::Proved;

/// Increment of an LRW for outputs alone.
const OUTPUTS_OF_LRW: Wkc = Wkc(2);

impl Place {
    /// Gives it other numbers in the image.
    pub fn renumber(&mut self, number: InputNumber) {
        (self.datagram, self.first_part) = (number.datagram, number.part);
    }

    /// Its SubDevices: number, increment, and what the increment proves.
    pub fn contributors(&self) -> impl Iterator<Item = (usize, u16, Proved)> {
        self.contributions.iter().map(|it| (it.subdevice, it.wkc.0, self.proof_of(it)))
    }

    /// What the full increment of a SubDevice proves.
    fn proof_of(&self, contribution: &Contribution) -> Proved {
        let increment = contribution.wkc;
        let (writes, reads) = match self.command {
            Command::Lrd => (false, true),
            Command::Lrw => (increment != INPUTS_OF_LRW, increment != OUTPUTS_OF_LRW),
            _ => (true, false),
        };
        Proved::new(writes, reads)
    }

    /// What copies on these links prove about a SubDevice.
    pub fn proves(&self, subdevice: usize, links: [bool; 2]) -> Proved {
        let Some(it) = self.contributions.iter().find(|it| it.subdevice == subdevice) else { return Proved::default() };
        let on_any = |seen: &[bool; 2]| seen.iter().zip(links).any(|(seen, arrived)| *seen && arrived);
        let is_proved = if self.is_summed() {
            // A sum without an optional SubDevice proves nothing about that one.
            self.is_complete(links) && (it.required || self.sum(links) == u32::from(self.expected.0))
        } else {
            on_any(&it.processed) && (!it.has_inputs || on_any(&it.delivered))
        };
        if is_proved { self.proof_of(it) } else { Proved::default() }
    }

    /// Whether a contribution is required.
    pub fn requires(&self, contribution: usize) -> bool {
        self.contributions.get(contribution).is_none_or(|it| it.required)
    }

    /// Whether a contribution is of a SubDevice that delivered its inputs before.
    pub fn expects(&self, contribution: usize) -> bool {
        self.contributions.get(contribution).is_some_and(|it| it.is_proven)
    }
}

impl Span {
    /// Copies from a frame with more bytes around into another one.
    pub fn load_again(&self, origin: &Span, from: &[u8], to: &mut [u8]) {
        let from_at = usize::from(origin.frame_at) + self.image_at.saturating_sub(origin.image_at) as usize;
        copy(from, from_at, to, self.frame_at.into(), self.length);
    }
}
