//! Times at which a frame reaches the clocks, as far as they are known.
//!
//! Clocks with known times between each other form a group; between groups only a range is known, or nothing. Delays
//! are known for the group of the reference clock.

use alloc::vec;
use alloc::vec::Vec;

use super::delays::{Delays, Unknown};

/// Smallest and largest possible time, with fraction.
pub(super) type Range = (i64, i64);

/// A place on the path of a frame: the group, and the time since the beginning of the group, with fraction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    group: usize,
    at: i64,
}

impl Place {
    /// The place that the frame reaches `time` later.
    pub(super) const fn after(self, time: i64) -> Place {
        Place { at: self.at + time, ..self }
    }
}

/// Clocks with known times between each other.
#[derive(Clone, Copy, Debug, Default)]
struct Group {
    /// The fork without a clock that hides the beginning of the group.
    fork: Option<usize>,
    /// The group begins within this range after a place of another group.
    begins: Option<(Place, Range)>,
}

/// The known times of one frame.
#[derive(Clone, Debug)]
pub(super) struct Places {
    /// By position: place at which the frame first enters the SubDevice.
    pub entered: Vec<Option<Place>>,
    groups: Vec<Group>,
}

impl Places {
    pub(super) fn new(count: usize) -> Places {
        Places { entered: vec![None; count], groups: vec![Group::default()] }
    }

    /// The beginning of the path.
    pub(super) const fn begin(&self) -> Place {
        Place { group: 0, at: 0 }
    }

    /// Adds a group and returns its beginning; `begins` is `None` if nothing is known about it.
    pub(super) fn apart(&mut self, fork: Option<usize>, begins: Option<(Place, Range)>) -> Place {
        self.groups.push(Group { fork, begins });
        Place { group: self.groups.len() - 1, at: 0 }
    }

    /// Sets the delays of the clocks in the group of the reference (or, if this has no place, of the first clock), and
    /// the ranges of all others.
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

    /// The fork that hides the time between two places: that of the group of `place`, otherwise that of `from`.
    fn fork(&self, place: Place, from: Place) -> Option<usize> {
        self.groups[place.group].fork.or(self.groups[from.group].fork)
    }

    /// Range of a place's time since the beginning of a group.
    fn range(&self, place: Place, group: usize) -> Option<Range> {
        let (mut place, mut least, mut most) = (place, 0, 0);
        // Each group begins after a place of an earlier group, so this ends.
        while place.group != group {
            let (begins, range) = self.groups[place.group].begins?;
            (least, most) = (least + range.0 + place.at, most + range.1 + place.at);
            place = begins;
        }
        Some((least + place.at, most + place.at))
    }
}
