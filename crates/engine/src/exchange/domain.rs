//! A domain: image, judgement of its working counters, freshness of its SubDevices.
//!
//! When all SubDevices answered, all inputs are new. When just those answered that are known to take part, theirs are
//! new and those of the missing ones keep their last value. While it is not known who is missing, nothing is new.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;
use core::time::Duration;

use super::flight::CyclicFrame;
use crate::domain::{DomainState, DomainStatus, Freshness};
use crate::layout::PlannedDomain;

/// What is kept per SubDevice.
#[derive(Debug)]
struct Member {
    subdevice: usize,
    takes_part: bool,
    /// Cycle, plus one, before which deliveries to those taking part did not include this one.
    part_since: u64,
    /// Cycle, plus one, of the last delivery before it last stopped taking part.
    delivered_before: u64,
}

/// A domain of the exchange.
#[derive(Debug)]
pub struct Domain {
    image: Box<[u8]>,
    frames: Range<usize>,
    expected: u32,
    timeout_ns: u64,
    members: Vec<Member>,
    status: DomainStatus,
    queued: bool,
    /// Its frames have not left since it was queued.
    waiting: bool,
    /// Cycle, plus one, of the last judgement.
    judged: u64,
    /// Changes on the board that were taken over.
    followed: u32,
}

impl Domain {
    pub(crate) fn new(planned: &PlannedDomain, frames: Range<usize>) -> Domain {
        let contributions =
            planned.frames.iter().flat_map(|frame| &frame.datagrams).flat_map(|datagram| &datagram.contributions);
        let expected = contributions.map(|(_, wkc)| u32::from(wkc.0)).sum();
        let mut subdevices: Vec<usize> = planned.areas.iter().map(|placed| placed.area.subdevice).collect();
        subdevices.sort_unstable();
        subdevices.dedup();
        let member = |subdevice| Member { subdevice, takes_part: false, part_since: u64::MAX, delivered_before: 0 };
        Domain {
            image: vec![0; planned.image_len as usize].into_boxed_slice(),
            frames,
            expected,
            timeout_ns: whole_ns(planned.period * 3 / 4),
            members: subdevices.into_iter().map(member).collect(),
            status: DomainStatus { expected, ..DomainStatus::default() },
            queued: false,
            waiting: false,
            judged: 0,
            followed: 0,
        }
    }

    pub(crate) fn image(&self) -> &[u8] {
        &self.image
    }

    pub(crate) fn image_mut(&mut self) -> &mut [u8] {
        &mut self.image
    }

    pub(crate) fn frames(&self) -> Range<usize> {
        self.frames.clone()
    }

    pub(crate) fn timeout_ns(&self) -> u64 {
        self.timeout_ns
    }

    pub(crate) fn set_timeout(&mut self, timeout: Duration) {
        self.timeout_ns = whole_ns(timeout);
    }

    pub(crate) fn was_queued(&self) -> bool {
        self.queued
    }

    /// Notes that it is queued; false where it was already, and its frames have not left.
    pub(crate) fn note_queued(&mut self) -> bool {
        self.queued = true;
        !core::mem::replace(&mut self.waiting, true)
    }

    pub(crate) fn note_sent(&mut self) {
        self.waiting = false;
    }

    pub(crate) fn count_skip(&mut self) {
        self.status.skipped += 1;
    }

    /// The last judgement.
    pub(crate) fn state(&self) -> DomainState {
        self.status.state
    }

    pub(crate) fn status(&self, pending: bool) -> DomainStatus {
        DomainStatus { pending, ..self.status }
    }

    /// Judges the flights since the last judgement: the sum of their working counters, and whether each datagram had
    /// just what it should.
    pub(crate) fn judge(&mut self, wkc: u32, complete: bool, cycle: u64) -> DomainStatus {
        let state = match (wkc, complete) {
            (0, _) if self.expected > 0 => DomainState::Zero,
            (_, true) => DomainState::Complete,
            (_, false) => DomainState::Incomplete,
        };
        self.status = DomainStatus { wkc, expected: self.expected, state, ..self.status };
        self.queued = false;
        self.judged = cycle + 1;
        self.status
    }

    /// How many changes on the board were taken over.
    pub(crate) fn followed(&self) -> u32 {
        self.followed
    }

    /// Takes over who takes part, after so many `changes` on the board.
    pub(crate) fn follow(
        &mut self,
        cycle: u64,
        changes: u32,
        takes_part: impl Fn(usize) -> bool,
        frames: &[CyclicFrame],
    ) {
        self.followed = changes;
        for member in &mut self.members {
            let now = takes_part(member.subdevice);
            if now == member.takes_part {
                continue;
            }
            if now {
                // A partial delivery of this very cycle came before the change.
                member.part_since = cycle + 2;
            } else {
                member.delivered_before = member.delivered(frames);
                member.part_since = u64::MAX;
            }
            member.takes_part = now;
        }
    }

    /// Number of a SubDevice among those of the domain.
    pub(crate) fn member(&self, subdevice: usize) -> Option<usize> {
        self.members.binary_search_by_key(&subdevice, |member| member.subdevice).ok()
    }

    /// From when on deliveries to those that take part include a member: a cycle, plus one.
    pub(crate) fn part_since(&self, member: usize) -> u64 {
        self.members.get(member).map_or(u64::MAX, |member| member.part_since)
    }

    pub(crate) fn freshness(&self, subdevice: usize, frames: &[CyclicFrame]) -> Freshness {
        let Ok(at) = self.members.binary_search_by_key(&subdevice, |member| member.subdevice) else {
            return Freshness::Never;
        };
        match self.members[at].delivered(frames) {
            0 => Freshness::Never,
            delivered if delivered >= self.judged => Freshness::Fresh,
            delivered => Freshness::Stale { cycles: self.judged - delivered },
        }
    }
}

impl Member {
    /// Cycle, plus one, of the last delivery of this SubDevice's inputs.
    fn delivered(&self, frames: &[CyclicFrame]) -> u64 {
        let Some((all, part)) = frames.iter().find_map(|frame| frame.delivered(self.subdevice)) else { return 0 };
        let part = if part >= self.part_since { part } else { 0 };
        all.max(part).max(self.delivered_before)
    }
}

/// A duration in the unit of the hot path, as long as it gets.
fn whole_ns(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}
