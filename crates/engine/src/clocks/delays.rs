//! Propagation delays of a segment: the known ones, and the ranges of those that cannot be determined.

use alloc::vec::Vec;

use super::round;

/// Propagation delays of all SubDevices, from the port at which the frame enters the segment.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Delays {
    /// By position: delay to the processing unit, with fraction; `None` without a clock or without times, and if the
    /// delay is not known.
    pub units: Vec<Option<i64>>,
    /// Clocks with an unknown delay to the reference clock, by position.
    pub unknown: Vec<Unknown>,
    /// By position: the link with the frames that the SubDevice processes, 0 for the main link, 1 for the redundant
    /// link.
    pub trees: Vec<usize>,
    /// The time between some two clocks is neither measured nor remembered.
    pub is_guessed: bool,
    /// Some cables were only measured together: members of an intact local ring with unknown cables.
    pub is_shared: bool,
    /// The known times of the cables of a branch contradict the time measured for all of them.
    pub is_contradictory: bool,
    /// Some time between two arrivals is impossible: the frame has taken another path.
    pub is_implausible: bool,
}

/// A clock with a delay that does not follow from the latched times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unknown {
    /// Its position.
    pub node: usize,
    /// The fork without a clock that hides it, by position.
    pub fork: Option<usize>,
    /// Smallest and largest possible delay to its processing unit, with fraction.
    pub range: Option<(i64, i64)>,
}

impl Delays {
    /// Nanoseconds from the processing unit of the reference clock to that of a SubDevice on the same link; negative if
    /// the frame passes that SubDevice first.
    pub fn between(&self, reference: usize, node: usize) -> Option<i64> {
        let of = |node: usize| self.units.get(node).copied().flatten();
        (self.trees.get(reference) == self.trees.get(node)).then_some(())?;
        Some(round(of(node)? - of(reference)?))
    }
}
