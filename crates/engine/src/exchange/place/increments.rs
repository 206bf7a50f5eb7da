//! Increments of a working counter by SubDevice; wrong ones for the board.

use ringcat_wire::address::Wkc;

use super::Place;
use crate::board::Board;

impl Place {
    /// Number of the datagram in the image.
    pub fn number(&self) -> usize {
        self.datagram
    }

    /// Posts a cycle with a wrong working counter of the received copies.
    pub fn post_error(&self, board: &Board, domain: usize, links: [bool; 2]) {
        let expected = self.contributions.iter().filter(|it| it.is_proven || it.required);
        let expected = expected.fold(Wkc(0), |sum, it| sum.plus(it.wkc));
        board.commands.post(domain, self.datagram, expected, Wkc(self.sum(links) as u16));
    }

    /// Its SubDevices, and the increment of each in copies on these links, as last evaluated; `None` where the working
    /// counter does not show it.
    pub fn increments(&self, links: [bool; 2]) -> impl Iterator<Item = (usize, Option<u16>)> {
        let (sum, is_summed) = (self.sum(links), self.is_summed());
        let all = u32::from(self.expected.0);
        let processed =
            move |seen: &[bool; 2]| seen.iter().zip(links).any(|(processed, arrived)| *processed && arrived);
        let known = self.contributions.iter().filter(|it| processed(&it.processed)).map(|it| u32::from(it.wkc.0)).sum();
        let is_alone = self.contributions.len() == 1;
        self.contributions.iter().map(move |it| {
            let full = it.wkc.0;
            let increment = match sum {
                0 => Some(0),
                _ if is_alone => Some(sum.min(full.into()) as u16),
                _ if is_summed => (sum == all).then_some(full),
                _ if processed(&it.processed) => Some(full),
                // What is left was added by SubDevices that did not process the copy completely.
                _ => (sum == known).then_some(0),
            };
            (it.subdevice, increment)
        })
    }
}
