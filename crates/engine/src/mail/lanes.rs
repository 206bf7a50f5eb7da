//! The lanes of one mailbox. A lane has a state, and takes memory, from its first use on: most SubDevices have no
//! mailbox, and most others use one lane.

use alloc::boxed::Box;

use super::lane::{Lane, LaneState};

/// The lanes in use.
#[derive(Debug, Default)]
pub(super) struct Lanes {
    used: [Option<Box<LaneState>>; Lane::COUNT],
}

impl Lanes {
    /// The state of a lane that was used.
    pub(super) fn of(&self, lane: Lane) -> Option<&LaneState> {
        self.used[lane.index()].as_deref()
    }

    /// The state of a lane, which is used from now on.
    pub(super) fn of_mut(&mut self, lane: Lane) -> &mut LaneState {
        self.used[lane.index()].get_or_insert_default()
    }

    /// The state of a lane by its index, which is used from now on; `None` if there is no such lane.
    pub(super) fn at_mut(&mut self, index: usize) -> Option<&mut LaneState> {
        Some(self.used.get_mut(index)?.get_or_insert_default())
    }

    /// The state of a lane that was used, by its index.
    pub(super) fn used_at_mut(&mut self, index: usize) -> Option<&mut LaneState> {
        self.used.get_mut(index)?.as_deref_mut()
    }

    /// The states of all lanes that were used, with their indices.
    pub(super) fn numbered(&self) -> impl Iterator<Item = (u8, &LaneState)> {
        (0_u8..).zip(&self.used).filter_map(|(index, lane)| Some((index, lane.as_deref()?)))
    }

    /// The states of all lanes that were used.
    pub(super) fn iter(&self) -> impl Iterator<Item = &LaneState> {
        self.used.iter().filter_map(Option::as_deref)
    }

    /// The same, to be changed.
    pub(super) fn iter_mut(&mut self) -> impl Iterator<Item = &mut LaneState> {
        self.used.iter_mut().filter_map(Option::as_deref_mut)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lane_takes_memory_from_its_first_use_on() {
        let mut lanes = Lanes::default();
        assert_eq!(lanes.iter().count(), 0);
        assert!(lanes.of(Lane::Coe).is_none() && lanes.used_at_mut(Lane::Coe.index()).is_none());
        lanes.of_mut(Lane::Foe).mark = 7;
        assert_eq!(lanes.numbered().map(|(index, lane)| (index, lane.mark)).collect::<alloc::vec::Vec<_>>(), [(1, 7)]);
        assert!(lanes.at_mut(Lane::COUNT).is_none(), "a number from another process may be any");
        assert!(size_of::<Lanes>() <= 64, "a mailbox without a lane is small");
    }
}
