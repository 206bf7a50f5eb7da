//! Unassigned SubDevices that are members of hot connect groups: the head by its alias or identification at any place,
//! the others by the SubDevice before them.

use alloc::vec::Vec;

use super::fit::fit;
use crate::config::groups;
use crate::segment::matching::Fit;
use crate::segment::member::Phase;
use crate::segment::model::Segment;
use crate::segment::unassigned::UnassignedView;
use crate::time::Instant;

/// Removes members of groups from the candidates and returns them. Candidates that may be members once they are read
/// are removed too, without a result.
pub(super) fn members<'a>(
    segment: &'a Segment,
    unassigned: &mut Vec<UnassignedView<'a>>,
    now: Instant,
) -> Vec<(UnassignedView<'a>, usize)> {
    let groups = groups(segment.members().map(|member| &*member.member.config));
    if groups.is_empty() {
        return Vec::new();
    }
    let mut matched: Vec<(UnassignedView<'a>, usize)> = Vec::new();
    // By position: the present SubDevice that is not read yet, or the member that it is.
    let mut before: Option<(u16, Option<usize>)> = None;
    let mut rest = Vec::new();
    for candidate in unassigned.drain(..) {
        let at = candidate.position.0;
        let ahead = match before {
            Some((position, owner)) if position.checked_add(1) == Some(at) => owner,
            _ => candidate.behind,
        };
        let waits_behind = matches!(before, Some((position, None)) if position.checked_add(1) == Some(at));
        let member = head(segment, &groups, candidate).or_else(|| follower(segment, &groups, candidate, ahead?));
        match member {
            Some(index) => {
                before = Some((at, Some(index)));
                matched.push((candidate, index));
            }
            // A SubDevice directly behind one that is not identified yet may belong to the group of that one.
            None if candidate.is_awaited(now) || waits_behind => {
                before = Some((at, None));
                if !candidate.is_awaited(now) {
                    continue;
                }
                rest.push(candidate);
            }
            None => rest.push(candidate),
        }
    }
    *unassigned = rest;
    matched
}

/// The head that a candidate is: absent, and the only one with its alias or identification.
fn head(segment: &Segment, groups: &[Vec<usize>], candidate: UnassignedView<'_>) -> Option<usize> {
    let heads = groups.iter().filter_map(|members| members.first().copied());
    heads
        .into_iter()
        .find(|index| is_absent_and_fits(segment, candidate, *index) && is_alone(segment, candidate, *index))
}

/// No other SubDevice has the same alias or identification.
fn is_alone(segment: &Segment, candidate: UnassignedView<'_>, index: usize) -> bool {
    let Some(address) = segment.member(index).map(|member| member.config.address) else { return false };
    let mut others = segment.subdevices().unassigned().filter(|other| other.key != candidate.key);
    others.all(|other| other.knowledge.info().is_none_or(|info| !address.is_mark_of(info)))
}

/// The next member of the group of the member directly before the candidate.
fn follower(segment: &Segment, groups: &[Vec<usize>], candidate: UnassignedView<'_>, ahead: usize) -> Option<usize> {
    let members = groups.iter().find(|members| members.contains(&ahead))?;
    let next = members.iter().skip_while(|index| **index != ahead).nth(1)?;
    is_absent_and_fits(segment, candidate, *next).then_some(*next)
}

fn is_absent_and_fits(segment: &Segment, candidate: UnassignedView<'_>, index: usize) -> bool {
    let is_absent = segment.member(index).is_some_and(|member| member.phase == Phase::Absent);
    candidate.knowledge.info().is_some() && is_absent && fit(segment, candidate, index) != Fit::No
}
