//! Telling when hot connect groups have joined, and when they have left.

use alloc::vec::Vec;
use core::time::Duration;

use super::fleet::{Fleet, Phase, SharedFleet};
use crate::config::groups;
use crate::event::Event;
use crate::supervisor::Bus;

/// Pause between two looks.
const PAUSE: Duration = Duration::from_millis(1);

/// How many of a group's SubDevices answer, how many are in the states that were declared, and of how many.
pub(crate) fn counts(fleet: &Fleet) -> Vec<(usize, usize, usize)> {
    let groups = groups(fleet.members.iter().map(|member| &*member.config));
    let count = |members: &Vec<usize>| {
        let all = members.iter().map(|index| &fleet.members[*index]);
        let present = all.clone().filter(|member| member.phase != Phase::Absent).count();
        let settled = all.filter(|member| member.phase == Phase::Settled(member.config.target)).count();
        (present, settled, members.len())
    };
    groups.iter().map(count).collect()
}

/// Runs for ever, where there are groups.
pub(crate) async fn watch_groups(bus: Bus, fleet: SharedFleet) {
    let mut joined = Vec::from_iter(counts(&fleet.access()).iter().map(|_| false));
    while !joined.is_empty() {
        let now = counts(&fleet.access());
        for (group, (was, (_, settled, of))) in joined.iter_mut().zip(now).enumerate() {
            let is = settled == of;
            if core::mem::replace(was, is) != is {
                bus.report(if is { Event::GroupJoined { group } } else { Event::GroupLeft { group } });
            }
        }
        bus.sleep(PAUSE).await;
    }
}
