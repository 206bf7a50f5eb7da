//! Increments of working counters by SubDevice, in the copies of a flight.

use super::CyclicFrame;
use crate::link::Link;

/// Place of an increment.
#[derive(Clone, Copy, Debug)]
pub(crate) struct IncrementAt {
    /// Index of the datagram in the frame.
    pub datagram: usize,
    /// Number of the datagram in the image.
    pub number: usize,
    /// Index of the SubDevice among the contributions of the datagram.
    pub contribution: usize,
}

impl CyclicFrame {
    /// Each SubDevice of each process data datagram, and its increment in the received copies; `None` where the working
    /// counter does not show it.
    pub(crate) fn each_increment(&self, mut found: impl FnMut(IncrementAt, usize, Option<u16>)) {
        let links = Link::ALL.map(|link| self.shown.arrivals.arrived & link.bit() != 0);
        for (datagram, place) in self.places.iter().enumerate() {
            for (contribution, (subdevice, increment)) in place.increments(links).enumerate() {
                found(IncrementAt { datagram, number: place.number(), contribution }, subdevice, increment);
            }
        }
    }

    /// Notes the copies that did not come back with a flight that is closed: for the status of links, and whether its
    /// supervision datagram is lost.
    #[cold]
    pub(crate) fn missing(&self) -> impl Iterator<Item = (Link, usize)> {
        let missing = self.all_links & !self.shown.arrivals.arrived;
        let links = Link::ALL.into_iter().filter(move |link| missing & link.bit() != 0);
        links.map(|link| (link, self.tx.len()))
    }

    /// Whether it has a supervision datagram of which no copy came back.
    pub(crate) fn has_lost_supervision(&self) -> bool {
        self.supervision_at.is_some() && self.shown.arrivals.arrived == 0
    }
}
