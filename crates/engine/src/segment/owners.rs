//! The member at each position.

use alloc::vec::Vec;

/// The member at each position.
#[derive(Debug)]
pub struct Owners {
    all: Vec<Option<usize>>,
    /// Without members of groups, which have no fixed position.
    anchors: Vec<Option<usize>>,
}

impl Owners {
    /// Owners by position; `floats` is true for members of groups.
    pub fn new(all: Vec<Option<usize>>, floats: impl Fn(usize) -> bool) -> Owners {
        let anchors = all.iter().map(|owner| owner.filter(|index| !floats(*index))).collect();
        Owners { all, anchors }
    }

    /// The member at each position.
    pub fn all(&self) -> &[Option<usize>] {
        &self.all
    }

    /// The member at a position.
    pub fn at(&self, at: usize) -> Option<usize> {
        self.all.get(at).copied().flatten()
    }

    /// The member directly before a position.
    pub fn before(&self, at: usize) -> Option<usize> {
        self.at(at.checked_sub(1)?)
    }

    /// The nearest members before and behind a position, without those of groups.
    pub fn neighbours(&self, at: usize) -> (Option<usize>, Option<usize>) {
        neighbours(&self.anchors, at)
    }
}

/// The nearest members before and behind a position.
pub(super) fn neighbours(owners: &[Option<usize>], at: usize) -> (Option<usize>, Option<usize>) {
    let before = owners.iter().take(at).rev().copied().flatten().next();
    (before, owners.iter().skip(at + 1).copied().flatten().next())
}
