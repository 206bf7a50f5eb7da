//! Identifies unassigned SubDevices as absent members.

use alloc::format;
use alloc::vec::Vec;

use super::fit::fit;
use super::group_matching;
use crate::config::IdentityMismatch;
use crate::declared::SubDeviceId;
use crate::event::Event;
use crate::info::SubDeviceInfo;
use crate::order::InOrder;
use crate::segment::effect::Effects;
use crate::segment::key::SubDeviceKey;
use crate::segment::matching::{Fit, assign};
use crate::segment::model::Segment;
use crate::segment::order::ranks;
use crate::segment::unassigned::{ByCables, HOLD, Matches, UnassignedView};
use crate::time::Instant;

impl Segment {
    /// Matches all unassigned SubDevices with absent members. To be called when it is known of all members whether they
    /// are present: otherwise a SubDevice might be taken for another member of the same type. `identified`: matches
    /// proven by cables.
    pub fn match_all(&self, by_cables: &ByCables, now: Instant) -> Matches {
        let identified = &by_cables.members[..];
        let mut unassigned: Vec<UnassignedView<'_>> = self.subdevices.unassigned().collect();
        unassigned.put_in_order_by_key(|it| it.position);
        let of_groups = group_matching::members(self, &mut unassigned, now);
        let by_cable = |it: &UnassignedView<'_>| identified.iter().find(|(station, _)| *station == it.key.station);
        let connected = unassigned.iter().filter_map(|it| Some((*it, by_cable(it)?.1)));
        let sure = of_groups.into_iter().chain(connected).map(|(it, index)| (it.key, Some(index)));
        let mut matched: Vec<(SubDeviceKey, Option<usize>)> = sure.collect();
        unassigned.retain(|it| by_cable(it).is_none());
        let is_other = |it: &UnassignedView<'_>| by_cables.others.contains(&it.key.station) && self.has_a_place(*it);
        matched.extend(unassigned.iter().filter(|it| is_other(it)).map(|it| (it.key, None)));
        unassigned.retain(|it| !is_other(it));
        let mut held = Vec::new();
        for gap in unassigned.chunk_by(|one, other| one.between == other.between) {
            if gap.iter().any(|it| it.is_awaited(now)) {
                continue;
            }
            let mut absent = self.absent_between(gap[0].between);
            absent.retain(|index| identified.iter().all(|(_, other)| other != index));
            let from_main: Vec<bool> = gap.iter().map(|it| it.from_main).collect();
            let fit = |candidate: usize, place: usize| fit(self, gap[candidate], absent[place]);
            for (it, place) in gap.iter().copied().zip(assign(&from_main, absent.len(), fit)) {
                let member = place.map(|place| absent[place]);
                match member.filter(|index| self.is_doubtful(it, *index, gap, &absent)) {
                    Some(index) => held.push((it.key, index)),
                    None => matched.push((it.key, member)),
                }
            }
        }
        Matches { matched, held }
    }

    /// All absent members that it may be were at places of their own, and none has its serial number.
    fn has_a_place(&self, it: UnassignedView<'_>) -> bool {
        self.absent().all(|index| match fit(self, it, index) {
            Fit::No | Fit::Unreadable => true,
            Fit::Seen => self.member(index).is_some_and(|member| member.node.is_some()),
            Fit::NeverSeen | Fit::Serial => false,
        })
    }

    /// Another absent member matches as well: there are several members of the type, no serial number, and fewer
    /// SubDevices present than members missing. Outputs of one must not go to another one.
    fn is_doubtful(&self, it: UnassignedView<'_>, index: usize, gap: &[UnassignedView<'_>], absent: &[usize]) -> bool {
        if fit(self, it, index) != Fit::Seen {
            return false;
        }
        let alike = |index: &usize| self.may_be(it, *index);
        let missed = self.absent().filter(alike).count();
        let here = absent.iter().filter(|index| alike(index)).count();
        let there = gap.iter().filter(|other| self.may_be(**other, index)).count();
        // With crossed SubDevices in a closed ring, the order changes when it opens.
        missed > 1 && (self.cabling.topology.is_assumed() || here != missed || there != missed)
    }

    /// The SubDevice is not configured until it is known which of several members it is; if this lasts, it is reported.
    pub(in crate::segment) fn hold(
        &mut self,
        key: SubDeviceKey,
        (index, attempt): (usize, u32),
        now: Instant,
        effects: &mut Effects,
    ) {
        if self.current(index, attempt).is_none() {
            return;
        }
        let Some((_, it)) = self.subdevices.unassigned_mut(key) else { return };
        let since = *it.held_since.get_or_insert(now);
        if now.since(since) >= HOLD && !core::mem::replace(&mut it.reported, true) {
            let reason = format!(
                "the SubDevice at position {} may be this one or another one of its kind that is missed: no cable \
                 shows which, and it has no serial number",
                it.position.0
            );
            effects.failed(index, reason);
        }
    }

    /// Whether an absent member is between the same two known members.
    pub(in crate::segment) fn is_between(&self, it: UnassignedView<'_>, index: usize) -> bool {
        self.absent_between(it.between).contains(&index)
    }

    /// Absent members between two others, in the order of the segment.
    fn absent_between(&self, between: (Option<usize>, Option<usize>)) -> Vec<usize> {
        let rank = ranks(&self.subdevices);
        let mut absent: Vec<usize> = self
            .absent()
            .filter(|index| between.0.is_none_or(|before| rank[before] < rank[*index]))
            .filter(|index| between.1.is_none_or(|behind| rank[*index] < rank[behind]))
            .collect();
        absent.put_in_order_by_key(|index| rank[*index]);
        absent
    }

    /// If a SubDevice is in the place of the only absent member there: the difference to its declaration.
    pub(in crate::segment) fn mismatch(&self, it: UnassignedView<'_>, info: &SubDeviceInfo) -> Option<Event> {
        let [subdevice] = self.absent_between(it.between)[..] else { return None };
        let IdentityMismatch { field, expected, got } = self.member(subdevice)?.config.expected.mismatch(info)?;
        Some(Event::Mismatch { subdevice: SubDeviceId(subdevice), position: it.position, field, expected, got })
    }
}
