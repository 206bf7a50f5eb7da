//! Events of hot connect groups that have joined or left, and the cabling with or without them.

use alloc::vec::Vec;

use super::effect::{Effects, Task};
use super::member::Phase;
use super::subdevices::SubDevices;
use crate::config::groups;
use crate::declared::GroupId;
use crate::event::Event;

/// Per group: SubDevices that answer, SubDevices in their declared states, and all SubDevices.
pub fn counts(subdevices: &SubDevices) -> Vec<(usize, usize, usize)> {
    let groups = groups(subdevices.members().map(|member| &*member.member.config));
    let count = |group: &Vec<usize>| {
        let all = group.iter().filter_map(|index| subdevices.member(*index));
        let present = all.clone().filter(|member| member.phase != Phase::Absent).count();
        let settled = all.filter(|member| member.is_as_declared()).count();
        (present, settled, group.len())
    };
    groups.iter().map(count).collect()
}

/// The groups, and which of them were reported as joined.
#[derive(Debug)]
pub(super) struct HotConnect {
    /// Members by group.
    groups: Vec<Vec<usize>>,
    joined: Vec<bool>,
    /// The cabling changes with each join or leave, and has to be taken over.
    follow: bool,
    /// Changes so far, and the number of changes up to which the cabling was taken over.
    changes: u32,
    followed: u32,
    is_following: bool,
}

impl HotConnect {
    pub fn new(subdevices: &SubDevices, follow: bool) -> HotConnect {
        let groups = groups(subdevices.members().map(|member| &*member.member.config));
        let joined = groups.iter().map(|_| false).collect();
        HotConnect { groups, joined, follow, changes: 0, followed: 0, is_following: false }
    }

    /// Changes so far.
    pub fn changes(&self) -> u32 {
        self.changes
    }

    /// Reports changes since the last time.
    pub fn observe(&mut self, subdevices: &SubDevices, effects: &mut Effects) {
        for (number, group) in self.groups.iter().enumerate() {
            let settled = |index: &usize| subdevices.member(*index).is_some_and(|member| member.is_as_declared());
            let is = group.iter().all(settled);
            if core::mem::replace(&mut self.joined[number], is) != is {
                let group = number;
                effects.report(if is {
                    Event::GroupJoined { group: GroupId(group) }
                } else {
                    Event::GroupLeft { group: GroupId(group) }
                });
                self.changes = self.changes.wrapping_add(1);
            }
        }
        if self.follow && self.changes != self.followed && !core::mem::replace(&mut self.is_following, true) {
            effects.start(Task::FollowGroups);
        }
    }

    /// The task that takes the cabling over has ended without a result.
    #[cfg(feature = "standby")]
    pub fn end_following(&mut self) {
        self.is_following = false;
    }

    /// The cabling was taken over as of this number of changes.
    pub fn follow(&mut self, changes: u32) {
        self.followed = changes;
        self.is_following = false;
    }
}
