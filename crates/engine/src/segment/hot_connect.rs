//! Events of hot connect groups that have joined or left, and the cabling with or without them.

use alloc::vec::Vec;

use super::effect::{Effects, Task};
use super::member::{Member, Phase};
use crate::config::groups;
use crate::declared::GroupId;
use crate::event::Event;

/// How many of a group's SubDevices answer, how many are in the states that were declared, and of how many.
pub fn counts(members: &[Member]) -> Vec<(usize, usize, usize)> {
    let groups = groups(members.iter().map(|member| &*member.config));
    let count = |group: &Vec<usize>| {
        let all = group.iter().map(|index| &members[*index]);
        let present = all.clone().filter(|member| member.phase != Phase::Absent).count();
        let settled = all.filter(|member| member.phase == Phase::Settled(member.config.target)).count();
        (present, settled, group.len())
    };
    groups.iter().map(count).collect()
}

/// The groups, and which of them were reported to have joined.
#[derive(Debug)]
pub(super) struct HotConnect {
    /// Members by group.
    groups: Vec<Vec<usize>>,
    joined: Vec<bool>,
    /// With each change the cabling is another one, which is taken over.
    follow: bool,
    /// Changes so far, and of these the ones that the cabling was taken over after.
    changes: u32,
    followed: u32,
    is_following: bool,
}

impl HotConnect {
    pub fn new(members: &[Member], follow: bool) -> HotConnect {
        let groups = groups(members.iter().map(|member| &*member.config));
        let joined = groups.iter().map(|_| false).collect();
        HotConnect { groups, joined, follow, changes: 0, followed: 0, is_following: false }
    }

    /// Changes so far.
    pub fn changes(&self) -> u32 {
        self.changes
    }

    /// Tells what has changed since the last time.
    pub fn observe(&mut self, members: &[Member], effects: &mut Effects) {
        for (number, group) in self.groups.iter().enumerate() {
            let settled = |index: &usize| members[*index].phase == Phase::Settled(members[*index].config.target);
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

    /// The cabling was taken over as it is after so many changes.
    pub fn follow(&mut self, changes: u32) {
        self.followed = changes;
        self.is_following = false;
    }
}
