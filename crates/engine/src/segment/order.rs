//! The order of members in the segment, and the member at each position according to it.

use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;

use super::member::MemberView;
use super::owners::{Owners, neighbours};
use super::subdevices::SubDevices;

/// The member at each position. If several SubDevices have the address of a member, the member is the one between its
/// neighbours; if that is ambiguous, none.
pub(super) fn owners_of(subdevices: &SubDevices, stations: &[StationAddress]) -> Owners {
    let floats = |index: usize| subdevices.member(index).is_some_and(|member| member.config.group.is_some());
    let all: Vec<Option<usize>> = stations.iter().map(|station| subdevices.member_of(*station)).collect();
    let is_single = |owner: &Option<usize>| all.iter().filter(|other| *other == owner).count() == 1;
    let mut owners: Vec<Option<usize>> = all.iter().map(|owner| owner.filter(|_| is_single(owner))).collect();
    let ranks = ranks(subdevices);
    for (index, member) in subdevices.members().enumerate() {
        let several = |at: &usize| all[*at] == Some(index) && owners[*at].is_none();
        let candidates: Vec<usize> = (0..all.len()).filter(several).collect();
        if candidates.is_empty() {
            continue;
        }
        let anchors: Vec<Option<usize>> = owners.iter().map(|owner| owner.filter(|owner| !floats(*owner))).collect();
        let is_between = |at: &usize| {
            let (before, behind) = neighbours(&anchors, *at);
            floats(index)
                || (before.is_none_or(|before| ranks[before] < ranks[index])
                    && behind.is_none_or(|behind| ranks[index] < ranks[behind]))
        };
        let between: Vec<usize> = candidates.iter().copied().filter(is_between).collect();
        let keeper = match between[..] {
            [only] => Some(only),
            // Its position at the scan, as no SubDevice has moved since.
            _ => between.into_iter().find(|at| member.node == Some(*at)),
        };
        if let Some(at) = keeper {
            owners[at] = Some(index);
        }
    }
    Owners::new(owners, floats)
}

/// The place of a member in the order of the segment, which may differ from the order of the declaration.
pub(super) type Rank = (Option<usize>, bool, usize);

/// The ranks of all members; those of groups have no meaning.
pub(super) fn ranks(subdevices: &SubDevices) -> Vec<Rank> {
    let mut last = None;
    let rank = |(index, member): (usize, MemberView<'_>)| {
        // A member that was never seen is placed behind the member declared before it.
        if member.config.group.is_none() {
            last = member.node.or(last);
        }
        (last, member.node.is_none(), index)
    };
    subdevices.members().enumerate().map(rank).collect()
}
