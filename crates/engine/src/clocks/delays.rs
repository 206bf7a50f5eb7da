//! What is known of propagation delays: those of all SubDevices of a segment, and where they cannot be told.

use alloc::vec::Vec;

use super::round;

/// What each SubDevice is away from where the frame came in.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Delays {
    /// By position, to the processing unit, with fraction; `None` without a clock or without times, and where it is not
    /// known.
    pub units: Vec<Option<i64>>,
    /// Those of clocks whose delay to the reference is not known, by position.
    pub unknown: Vec<Unknown>,
    /// By position, whose frame it processes: 0 for the main link, 1 for the redundant one.
    pub trees: Vec<usize>,
    /// Some way between two clocks is neither measured nor remembered.
    pub is_guessed: bool,
    /// Several cables share a time that was measured of them together: the members of a whole ring whose cables nobody
    /// knows.
    pub is_shared: bool,
    /// What is known of each cable of a branch does not make up the time that they took together.
    pub is_contradictory: bool,
    /// Some time between two arrivals cannot be: the frame has taken another way.
    pub is_implausible: bool,
}

/// A clock whose place on the way cannot be told from what was latched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unknown {
    /// Its position.
    pub node: usize,
    /// The fork without a clock that hides it, by position.
    pub fork: Option<usize>,
    /// The least and the most that its processing unit may be away from where the frame came in, with fraction.
    pub range: Option<(i64, i64)>,
}

impl Delays {
    /// Nanoseconds from the reference's processing unit to that of a SubDevice of the same link; negative where the
    /// frame meets that one first.
    pub fn between(&self, reference: usize, node: usize) -> Option<i64> {
        let of = |node: usize| self.units.get(node).copied().flatten();
        (self.trees.get(reference) == self.trees.get(node)).then_some(())?;
        Some(round(of(node)? - of(reference)?))
    }
}
