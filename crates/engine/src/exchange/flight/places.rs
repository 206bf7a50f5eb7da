//! Places of the image in a frame.

use core::ops::Range;

use super::CyclicFrame;

impl CyclicFrame {
    /// The SubDevice whose inputs contain all the given bytes of the image.
    pub(crate) fn whose_inputs(&self, bytes: Range<usize>) -> Option<usize> {
        self.places.iter().find_map(|place| place.whose_inputs(&bytes))
    }

    /// Whether outputs contain all the given bytes of the image.
    pub(crate) fn has_outputs(&self, bytes: Range<usize>) -> bool {
        self.places.iter().any(|place| place.has_outputs(&bytes))
    }
}
