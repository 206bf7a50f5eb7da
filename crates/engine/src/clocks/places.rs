//! Where on its way a frame comes to clocks, as far as that is known.
//!
//! Clocks between which a time is known are a group; from group to group only a range is known, or nothing. Delays are
//! those of the group of the reference.

use alloc::vec;
use alloc::vec::Vec;

use super::delays::{Delays, Unknown};

/// The least and the most, with fraction.
pub(super) type Range = (i64, i64);

/// On the way of a frame: the group, and the time since its beginning, with fraction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    group: usize,
    at: i64,
}

impl Place {
    /// So much later.
    pub(super) const fn after(self, time: i64) -> Place {
        Place { at: self.at + time, ..self }
    }
}

/// Clocks between which all is known.
#[derive(Clone, Copy, Debug, Default)]
struct Group {
    /// The fork that hides where it begins.
    fork: Option<usize>,
    /// It begins so much after that.
    begins: Option<(Place, Range)>,
}

/// What is known of one frame's way.
#[derive(Clone, Debug)]
pub(super) struct Places {
    /// Where the frame comes to the SubDevices, by position.
    pub entered: Vec<Option<Place>>,
    groups: Vec<Group>,
}

impl Places {
    pub(super) fn new(count: usize) -> Places {
        Places { entered: vec![None; count], groups: vec![Group::default()] }
    }

    /// Where the way begins.
    pub(super) const fn begin(&self) -> Place {
        Place { group: 0, at: 0 }
    }

    /// The beginning of a group, so much after a place, or of whose place nothing is known.
    pub(super) fn apart(&mut self, fork: Option<usize>, begins: Option<(Place, Range)>) -> Place {
        self.groups.push(Group { fork, begins });
        Place { group: self.groups.len() - 1, at: 0 }
    }

    /// Delays of the group of the reference, or else of the first clock; of the others, what is known of them.
    pub(super) fn conclude(&self, units: &[Option<Place>], reference: usize, delays: &mut Delays) {
        let first = || units.iter().flatten().min_by_key(|place| (place.group, place.at)).copied();
        let Some(chosen) = units.get(reference).copied().flatten().or_else(first) else { return };
        for (node, place) in units.iter().enumerate().filter_map(|(node, place)| Some((node, (*place)?))) {
            if place.group == chosen.group {
                delays.units[node] = Some(place.at);
            } else {
                let range = self.range(place, chosen.group);
                delays.unknown.push(Unknown { node, fork: self.fork(place, chosen), range });
            }
        }
    }

    /// What hides a place from another one: the innermost fork of either that the other does not have around it.
    fn fork(&self, place: Place, from: Place) -> Option<usize> {
        self.groups[place.group].fork.or(self.groups[from.group].fork)
    }

    /// Where a place may be, since the beginning of a group.
    fn range(&self, place: Place, group: usize) -> Option<Range> {
        let (mut place, mut least, mut most) = (place, 0, 0);
        // A group begins after an earlier one.
        while place.group != group {
            let (begins, range) = self.groups[place.group].begins?;
            (least, most) = (least + range.0 + place.at, most + range.1 + place.at);
            place = begins;
        }
        Some((least + place.at, most + place.at))
    }
}
