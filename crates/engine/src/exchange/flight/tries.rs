//! What a frame needs to be sent again within its cycle: the outputs of its first try, and what its copies prove.

use super::{CyclicFrame, Shown};
use crate::exchange::image::InputNumber;
use crate::exchange::proved::Proved;
use crate::link::Link;

impl CyclicFrame {
    /// Bits of the links on which copies leave.
    pub(crate) fn all_links(&self) -> u8 {
        self.all_links
    }

    /// Gives its process data datagrams other numbers in the image.
    pub(crate) fn renumber(&mut self, numbers: impl Iterator<Item = InputNumber>) {
        self.places.iter_mut().zip(numbers).for_each(|(place, number)| place.renumber(number));
    }

    /// Each SubDevice of each process data datagram: index of the datagram, index of the contribution, SubDevice,
    /// increment, what the increment proves.
    pub(crate) fn contributions(&self) -> impl Iterator<Item = (usize, usize, usize, u16, Proved)> {
        self.places.iter().enumerate().flat_map(|(datagram, place)| {
            let all = place.contributors().enumerate();
            all.map(move |(number, (subdevice, wkc, needed))| (datagram, number, subdevice, wkc, needed))
        })
    }

    /// What the received copies prove about a SubDevice in a process data datagram.
    pub(crate) fn proves(&self, datagram: usize, subdevice: usize) -> Proved {
        let links = Link::ALL.map(|link| self.shown.arrivals.arrived & link.bit() != 0);
        self.places.get(datagram).map_or(Proved::default(), |place| place.proves(subdevice, links))
    }

    /// Whether a contribution is required.
    pub(crate) fn requires(&self, datagram: usize, contribution: usize) -> bool {
        self.places.get(datagram).is_none_or(|place| place.requires(contribution))
    }

    /// Whether a contribution is of a SubDevice that delivered its inputs before.
    pub(crate) fn expects(&self, datagram: usize, contribution: usize) -> bool {
        self.places.get(datagram).is_some_and(|place| place.expects(contribution))
    }

    /// Whether a SubDevice processed both copies.
    pub(crate) fn is_doubled(&self) -> bool {
        self.views.are_doubled
    }

    /// Copies the outputs of the first try in, to leave in the same cycle. `datagrams`: for each process data datagram
    /// of this frame its index in the first try.
    pub(crate) fn load_again(&mut self, first: &CyclicFrame, datagrams: impl Iterator<Item = usize>) {
        for (place, datagram) in self.places.iter().zip(datagrams) {
            if let Some(origin) = first.places.get(datagram) {
                place.outputs.load_again(&origin.outputs, &first.tx, &mut self.tx);
            }
        }
        self.left = first.left;
        self.shown = Shown::default();
    }
}
