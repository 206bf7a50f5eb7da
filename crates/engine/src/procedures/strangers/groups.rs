//! Strangers that are members of hot connect groups: the head by its alias or identification at any place, the others by
//! whom they are behind.

use alloc::vec::Vec;

use super::{Fit, Knowledge, Stranger, fit};
use crate::config::groups;
use crate::procedures::fleet::{Fleet, Phase};
use crate::time::Instant;

/// Takes those strangers out that are members of groups, and says which. Also those that may be one as soon as they are
/// read are taken out, without being told anything.
pub(super) fn members(fleet: &Fleet, strangers: &mut Vec<Stranger>, now: Instant) -> Vec<(Stranger, Option<usize>)> {
    let groups = groups(fleet.members.iter().map(|member| &*member.config));
    if groups.is_empty() {
        return Vec::new();
    }
    let mut matched: Vec<(Stranger, Option<usize>)> = Vec::new();
    // By position who is there and waits to be read, or is told who it is.
    let mut before: Option<(u16, Option<usize>)> = None;
    let mut rest = Vec::new();
    for stranger in strangers.drain(..) {
        let at = stranger.position.0;
        let ahead = match before {
            Some((position, owner)) if position.checked_add(1) == Some(at) => owner,
            _ => stranger.behind,
        };
        let waits_behind = matches!(before, Some((position, None)) if position.checked_add(1) == Some(at));
        let member = head(fleet, &groups, &stranger).or_else(|| follower(fleet, &groups, &stranger, ahead?));
        match member {
            Some(index) => {
                before = Some((at, Some(index)));
                matched.push((stranger, Some(index)));
            }
            // Whose place is right behind one that is not known yet may belong to that one's group.
            None if stranger.is_awaited(now) || waits_behind => {
                before = Some((at, None));
                if !stranger.is_awaited(now) {
                    continue;
                }
                rest.push(stranger);
            }
            None => rest.push(stranger),
        }
    }
    *strangers = rest;
    matched
}

/// The head that a stranger is: absent, and alone with its alias or identification.
fn head(fleet: &Fleet, groups: &[Vec<usize>], stranger: &Stranger) -> Option<usize> {
    let heads = groups.iter().filter_map(|members| members.first().copied());
    heads.into_iter().find(|index| is_absent_and_fits(fleet, stranger, *index) && is_alone(fleet, stranger, *index))
}

/// Nobody else among the strangers has the mark.
fn is_alone(fleet: &Fleet, stranger: &Stranger, index: usize) -> bool {
    let address = fleet.members[index].config.address;
    let others = fleet.strangers.iter().filter(|other| other.station != stranger.station);
    others.into_iter().all(|other| match &other.knowledge {
        Knowledge::Known(info) => !address.is_borne_by(info),
        Knowledge::Reading(_) | Knowledge::Unreadable(_) => true,
    })
}

/// The next member of the group of whoever is right before a stranger.
fn follower(fleet: &Fleet, groups: &[Vec<usize>], stranger: &Stranger, ahead: usize) -> Option<usize> {
    let members = groups.iter().find(|members| members.contains(&ahead))?;
    let next = members.iter().skip_while(|index| **index != ahead).nth(1)?;
    is_absent_and_fits(fleet, stranger, *next).then_some(*next)
}

fn is_absent_and_fits(fleet: &Fleet, stranger: &Stranger, index: usize) -> bool {
    let known = matches!(stranger.knowledge, Knowledge::Known(_));
    known && fleet.members[index].phase == Phase::Absent && fit(fleet, stranger, index) != Fit::No
}
