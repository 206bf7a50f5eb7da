//! Telling when hot connect groups have joined, and when they have left; taking over the cabling with them.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::Cell;
use core::time::Duration;

use super::fleet::{Fleet, Phase, SharedFleet};
use super::strangers::rescan::follow_segment;
use crate::config::groups;
use crate::event::Event;
use crate::supervisor::Bus;

/// Pause between two looks.
const PAUSE: Duration = Duration::from_millis(1);
/// So long the segment may take to hold still.
const LIMIT: Duration = Duration::from_millis(200);
/// Pause before the cabling is looked at again where it could not be taken over, twice as long each time.
const AGAIN: Duration = Duration::from_millis(50);
/// The longest of these pauses.
const LONGEST: Duration = Duration::from_secs(2);

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

/// Runs for ever, where there are groups. `follow`: with who has joined or left the cabling is another one, which is taken
/// over as soon as nothing is broken that would be forgotten.
pub(crate) async fn watch_groups(bus: Bus, fleet: SharedFleet, follow: bool) {
    let mut joined = Vec::from_iter(counts(&fleet.access()).iter().map(|_| false));
    let changes = Rc::new(Cell::new(0));
    if follow && !joined.is_empty() {
        bus.spawn(follow_groups(bus.clone(), fleet.clone(), changes.clone()));
    }
    while !joined.is_empty() {
        let now = counts(&fleet.access());
        for (group, (was, (_, settled, of))) in joined.iter_mut().zip(now).enumerate() {
            let is = settled == of;
            if core::mem::replace(was, is) != is {
                bus.report(if is { Event::GroupJoined { group } } else { Event::GroupLeft { group } });
                changes.set(changes.get() + 1);
            }
        }
        bus.sleep(PAUSE).await;
    }
}

/// Takes over the cabling after each of these changes.
async fn follow_groups(bus: Bus, fleet: SharedFleet, changes: Rc<Cell<u64>>) {
    let mut followed = 0;
    let mut pause = AGAIN;
    loop {
        let now = changes.get();
        if now == followed {
            bus.sleep(PAUSE).await;
        } else if follow_segment(&bus, &fleet, LIMIT).await {
            (followed, pause) = (now, AGAIN);
        } else {
            bus.sleep(pause).await;
            pause = if changes.get() == now { (2 * pause).min(LONGEST) } else { AGAIN };
        }
    }
}
