//! Variants of a frame with the same process data, which take each other's place: without process data while no
//! SubDevice can answer it, with or without the datagrams of supervision and clocks.

use alloc::vec::Vec;

use super::CyclicFrame;
use crate::exchange::place::Place;
use crate::layout::PlannedFrame;
use crate::ring::Identity;

impl CyclicFrame {
    /// A frame that replaces this one while none of its SubDevices has its FMMUs: without process data, which no
    /// SubDevice would answer. Its working counters are zero, and it represents the same inputs and outputs.
    pub(crate) fn vacant(&self, identity: &Identity, planned: &PlannedFrame) -> CyclicFrame {
        let bare = PlannedFrame { datagrams: Vec::new(), presence: None, ..*planned };
        // The working counters of places outside are zero: they need no check.
        let places = self.places.iter().map(Place::outside).collect();
        CyclicFrame {
            places,
            has_outputs_apart: false,
            ..CyclicFrame::new(identity, self.all_links, self.domain, &bare, self.first)
        }
    }

    /// Replaces a loaded frame with the same process data, which does not leave.
    pub(crate) fn take_over(&mut self, loaded: &CyclicFrame) {
        self.clear(loaded.left);
        for place in &self.places {
            place.outputs_in_frame().for_each(|span| span.take_over(&loaded.tx, &mut self.tx));
        }
    }

    /// Whether datagrams of supervision or of distributed clocks are in it.
    pub(crate) fn carries_service(&self) -> bool {
        self.supervision_at.is_some() || self.clocks.is_some()
    }

    /// Whether it leaves without process data.
    pub(crate) fn is_vacant(&self) -> bool {
        self.places.iter().any(Place::is_outside)
    }

    /// Copies outputs in that lie in several places of the image.
    #[inline(never)]
    pub(super) fn load_apart(&mut self, image: &[u8]) {
        for span in self.places.iter().flat_map(|place| &place.outputs_apart) {
            span.load(image, &mut self.tx);
        }
    }
}
