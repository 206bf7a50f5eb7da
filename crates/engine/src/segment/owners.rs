//! The member at each position, and the order of members in the segment.

use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;

use super::member::Member;

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

    /// By position.
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

/// The member at each position. If several SubDevices have the address of a member, the member is the one between its
/// neighbours; if that is ambiguous, none.
pub(super) fn owners_of(members: &[Member], stations: &[StationAddress]) -> Owners {
    let floats = |index: usize| members[index].config.group.is_some();
    let member = |station: &StationAddress| members.iter().position(|member| member.station == *station);
    let all: Vec<Option<usize>> = stations.iter().map(member).collect();
    let is_single = |owner: &Option<usize>| all.iter().filter(|other| *other == owner).count() == 1;
    let mut owners: Vec<Option<usize>> = all.iter().map(|owner| owner.filter(|_| is_single(owner))).collect();
    let ranks = ranks(members);
    for index in 0..members.len() {
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
            _ => between.into_iter().find(|at| members[index].node == Some(*at)),
        };
        if let Some(at) = keeper {
            owners[at] = Some(index);
        }
    }
    Owners::new(owners, floats)
}

/// The nearest members before and behind a position.
fn neighbours(owners: &[Option<usize>], at: usize) -> (Option<usize>, Option<usize>) {
    let before = owners.iter().take(at).rev().copied().flatten().next();
    (before, owners.iter().skip(at + 1).copied().flatten().next())
}

/// The place of a member in the order of the segment, which may differ from the order of the declaration.
pub(super) type Rank = (Option<usize>, bool, usize);

/// The ranks of all members; those of groups have no meaning.
pub(super) fn ranks(members: &[Member]) -> Vec<Rank> {
    let mut last = None;
    let rank = |(index, member): (usize, &Member)| {
        // A member that was never seen is placed behind the member declared before it.
        if member.config.group.is_none() {
            last = member.node.or(last);
        }
        (last, member.node.is_none(), index)
    };
    members.iter().enumerate().map(rank).collect()
}
