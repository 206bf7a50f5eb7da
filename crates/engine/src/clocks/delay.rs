//! Propagation delays of any segment, from the times at which one frame came in at each port (facts 7.1).
//!
//! The frame's way is followed port by port ([`Wiring::way`]). Between two arrivals at a SubDevice with a clock lies a
//! branch: what its clock says the branch took, less what the SubDevices in the branch say that they took, is the time
//! on cables. What is known about cables ([`Cables`]) counts, and the rest is shared evenly among the others.
//! SubDevices without a clock are part of the cable.

use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;

use super::cables::{Cables, End};
use super::wiring::{Arrival, TREES, Wiring, processed_in};
use super::{FRACTION, round};
use crate::topology::PortOf;

/// Longer than this no frame is on its way: a thousand SubDevices take 2 ms.
pub(super) const MOST_NS: i64 = 20_000_000;

/// Cables that take as long together as they are known to, to within this and so much for each, are those that are
/// known.
const SAME: i64 = 30 << FRACTION;
const SAME_CABLE: i64 = 10 << FRACTION;

/// Times at which the frame came in at port 0..3 after it came in at the port of entry, with fraction
/// ([`super::FRACTION`]). Those of ports that it did not come in at say nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PortTimes(pub [i64; 4]);

/// What each SubDevice is away from where the frame came in.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Delays {
    /// By position, to the processing unit, with fraction; `None` without a clock or without times.
    pub units: Vec<Option<i64>>,
    /// By position, whose frame it processes: 0 for the main link, 1 for the redundant one.
    pub trees: Vec<usize>,
    /// Some way between two clocks is neither measured nor remembered.
    pub is_guessed: bool,
    /// Several cables share a time that was measured of them together: the members of a whole ring whose cables nobody
    /// knows.
    pub is_shared: bool,
    /// Some time between two arrivals cannot be: the frame has taken another way.
    pub is_implausible: bool,
}

impl Delays {
    /// Nanoseconds from the reference's processing unit to that of a SubDevice of the same link; negative where the
    /// frame meets that one first.
    pub fn between(&self, reference: usize, node: usize) -> Option<i64> {
        let of = |node: usize| self.units.get(node).copied().flatten();
        (self.trees.get(reference) == self.trees.get(node)).then_some(())?;
        Some(round(of(node)? - of(reference)?))
    }
}

/// What a measurement is about.
#[derive(Clone, Copy, Debug)]
pub struct Segment<'a> {
    /// Who is connected to whom.
    pub wiring: &'a Wiring,
    /// Station addresses by position.
    pub stations: &'a [StationAddress],
    /// What is known of passages by position, see [`Passage`]; those without one take nothing beyond what all do.
    pub passages: &'a [Passage],
}

/// What a frame takes through a SubDevice from port to port, with fraction, less what it takes through all (facts 7.1:
/// there, tDiff is the difference of both).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Passage {
    /// Where its processing unit meets the frame.
    pub processed: i64,
    /// Where it does not.
    pub forwarded: i64,
}

impl Segment<'_> {
    fn end(&self, at: PortOf) -> Option<End> {
        Some((*self.stations.get(at.node)?, at.port))
    }

    /// Notes which cables are there.
    pub fn see(&self, cables: &mut Cables) {
        cables.see(self.wiring.cables().filter_map(|(near, far)| Some((self.end(near)?, self.end(far)?))));
    }

    /// Propagation delays. `times` by position, on one clock (see [`super::Measurements::mean`]); `None` without a
    /// clock. What was measured of cables is learned.
    pub fn propagation(&self, times: &[Option<PortTimes>], cables: &mut Cables) -> Delays {
        let count = self.wiring.count();
        let mut delays = Delays { units: vec![None; count], trees: vec![0; count], ..Delays::default() };
        for tree in 0..TREES {
            let way = self.wiring.way(tree);
            let processed = processed_in(&way, count);
            let is_here = |node: &usize| processed[*node] && delays.units[*node].is_none();
            let here: Vec<bool> = (0..count).map(|node| is_here(&node)).collect();
            here.iter().zip(&mut delays.trees).filter(|(is, _)| **is).for_each(|(_, of)| *of = tree);
            let clock = |node: usize| times.get(node).copied().flatten().filter(|_| here[node]);
            Walk::new(self, &way, &clock).run(&mut delays, cables);
        }
        delays
    }
}

/// The arrivals of one frame, with what clocks say about them.
struct Walk<'a, C: Fn(usize) -> Option<PortTimes>> {
    segment: &'a Segment<'a>,
    way: &'a [Arrival],
    clock: &'a C,
    /// Place of each SubDevice's last arrival.
    last: Vec<usize>,
    /// Place of its next arrival, by place.
    next: Vec<Option<usize>>,
}

/// From one arrival at a clock to the next, with nothing but cables and SubDevices without a clock in between.
#[derive(Clone, Copy, Debug)]
struct Gap {
    from: usize,
    to: usize,
    /// What its cables are known to take.
    known: Option<i64>,
    /// What the SubDevice at its end takes for what lies behind it.
    span: i64,
}

impl Gap {
    const fn hops(&self) -> i64 {
        (self.to - self.from) as i64
    }
}

impl<'a, C: Fn(usize) -> Option<PortTimes>> Walk<'a, C> {
    fn new(segment: &'a Segment<'a>, way: &'a [Arrival], clock: &'a C) -> Walk<'a, C> {
        let count = segment.wiring.count();
        let mut last = vec![0; count];
        let mut seen: Vec<Option<usize>> = vec![None; count];
        let mut next = vec![None; way.len()];
        for (place, arrival) in way.iter().enumerate() {
            if let Some(before) = seen[arrival.at.node].replace(place) {
                next[before] = Some(place);
            }
            last[arrival.at.node] = place;
        }
        Walk { segment, way, clock, last, next }
    }

    fn run(&self, delays: &mut Delays, cables: &mut Cables) {
        let mut entered = vec![None; delays.units.len()];
        // What comes before the first clock, and between the branches in front of it, nobody measures.
        delays.is_guessed |= self.trunk(cables, &mut entered);
        for place in 0..self.way.len() {
            let PortOf { node, port } = self.way[place].at;
            let (Some(delay), Some(times)) = (entered[node], (self.clock)(node)) else { continue };
            let is_first = delays.units[node].is_none();
            if is_first {
                delays.units[node] = Some(delay + self.to_unit(place, &times));
            }
            if let Some(next) = self.next[place] {
                let at = |port: u8| times.0[usize::from(port & 3)];
                let from = if is_first { 0 } else { at(port) };
                let took = at(self.way[next].at.port) - from;
                delays.is_implausible |= !(0..=MOST_NS << FRACTION).contains(&took);
                delays.is_shared |= self.branch(place, next, took, delay + from, cables, &mut entered);
            }
        }
    }

    /// From the port of entry to the processing unit.
    fn to_unit(&self, first: usize, times: &PortTimes) -> i64 {
        let mut place = first;
        while !self.way[place].processed {
            let Some(next) = self.next[place] else { break };
            place = next;
        }
        if place == first { 0 } else { times.0[usize::from(self.way[place].at.port & 3)] }
    }

    /// The way that nobody measures as a whole. Returns whether something in it is not known.
    fn trunk(&self, cables: &Cables, entered: &mut [Option<i64>]) -> bool {
        let (mut at, mut is_guessed) = (0, false);
        for gap in self.gaps(0, self.way.len(), &|_, _| None) {
            let first_clock = gap.from == 0 && (self.clock)(self.way[0].at.node).is_none();
            for hop in gap.from..gap.to {
                let time = self.cable(hop).and_then(|(one, other)| cables.remembered(one, other));
                is_guessed |= time.is_none() && !first_clock;
                at += time.unwrap_or(0) + self.passage(hop);
            }
            if let Some(arrival) = self.way.get(gap.to) {
                entered[arrival.at.node] = Some(at);
            }
            at += gap.span;
        }
        is_guessed
    }

    /// Shares the time from one arrival at a SubDevice to its next one among the cables of the branch. `begin` is the
    /// delay at the first one. Returns whether it is not known which of several cables takes what.
    fn branch(
        &self,
        from: usize,
        to: usize,
        took: i64,
        begin: i64,
        cables: &mut Cables,
        entered: &mut [Option<i64>],
    ) -> bool {
        let mut gaps = self.gaps(from, to, &|one, other| cables.measured(one, other));
        let in_passages: i64 = gaps.iter().flat_map(|gap| gap.from..gap.to).map(|hop| self.passage(hop)).sum();
        let total = (took - in_passages - gaps.iter().map(|gap| gap.span).sum::<i64>()).max(0);
        let known = |gaps: &[Gap]| gaps.iter().filter_map(|gap| gap.known).sum::<i64>();
        let fits = |gaps: &[Gap]| {
            let all: Option<i64> = gaps.iter().map(|gap| gap.known).sum();
            all.is_some_and(|all| (all - total).abs() <= SAME + gaps.len() as i64 * SAME_CABLE)
        };
        if gaps.iter().any(|gap| gap.known.is_none()) {
            // Cables that were away are those from before where all of them take as long together.
            let before = self.gaps(from, to, &|one, other| cables.remembered(one, other));
            gaps = if fits(&before) { before } else { gaps };
        }
        if known(&gaps) > total && gaps.iter().any(|gap| gap.known.is_none()) {
            // What is known cannot be right.
            gaps.iter_mut().for_each(|gap| gap.known = None);
        }
        // Where all is known, the difference to what was measured now is shared by all.
        let all_known = gaps.iter().all(|gap| gap.known.is_some());
        let takes_rest = |gap: &Gap| all_known || gap.known.is_none();
        let rest = total - known(&gaps);
        let sharing: i64 = gaps.iter().filter(|gap| takes_rest(gap)).map(Gap::hops).sum();
        let is_shared = if all_known { !fits(&gaps) } else { self.are_several(&gaps) };
        let is_one_cable = gaps.len() == 2 && gaps.iter().all(|gap| gap.hops() == 1);
        let (mut spent, mut shared, mut done) = (begin, 0, 0);
        for gap in &gaps {
            let mut on_cables = gap.known.unwrap_or(0);
            if takes_rest(gap) {
                done += gap.hops();
                let until = rest * done / sharing.max(1);
                on_cables += until - shared;
                shared = until;
            }
            spent += on_cables + (gap.from..gap.to).map(|hop| self.passage(hop)).sum::<i64>();
            if gap.to < to {
                entered[self.way[gap.to].at.node] = Some(spent);
            }
            spent += gap.span;
            if (gap.known.is_none() && !is_shared) || is_one_cable {
                for (one, other) in (gap.from..gap.to).filter_map(|hop| self.cable(hop)) {
                    cables.learn(one, other, on_cables / gap.hops().max(1));
                }
            }
        }
        is_shared
    }

    /// Whether the gaps that are not known are several, and some of a cable on which the frame goes one way only: there
    /// and back the same cable takes as long.
    fn are_several(&self, gaps: &[Gap]) -> bool {
        let unknown = || gaps.iter().filter(|gap| gap.known.is_none());
        let sorted = |(one, other): (End, End)| (one.min(other), one.max(other));
        let mut cables: Vec<_> =
            unknown().flat_map(|gap| gap.from..gap.to).filter_map(|hop| self.cable(hop)).map(sorted).collect();
        cables.sort_unstable();
        unknown().count() > 1 && cables.chunk_by(|one, other| one == other).any(|same| same.len() == 1)
    }

    /// What is known of the passage behind an arrival.
    fn passage(&self, place: usize) -> i64 {
        let Arrival { at, processed } = self.way[place];
        let passage = self.segment.passages.get(at.node).copied().unwrap_or_default();
        if processed { passage.processed } else { passage.forwarded }
    }

    /// Both ends of the cable behind an arrival.
    fn cable(&self, place: usize) -> Option<(End, End)> {
        let far = self.way.get(place + 1)?.at;
        let near = self.segment.wiring.far(far)?;
        Some((self.segment.end(near)?, self.segment.end(far)?))
    }

    /// The gaps between two places of which the first one counts only where it is the beginning of the way or a
    /// SubDevice with a clock.
    fn gaps(&self, from: usize, to: usize, known: &dyn Fn(End, End) -> Option<i64>) -> Vec<Gap> {
        let mut gaps = Vec::new();
        let mut begin = from;
        // The SubDevice at the beginning of a branch is not part of it; one at the beginning of the way is.
        let mut place = if from == 0 && to == self.way.len() { from } else { from + 1 };
        let gap = |from: usize, to: usize, span: i64| {
            let cable = |hop: usize| self.cable(hop).and_then(|(one, other)| known(one, other));
            Gap { from, to, known: (from..to).map(cable).sum(), span }
        };
        while place < to {
            let node = self.way[place].at.node;
            let Some(times) = (self.clock)(node) else {
                place += 1;
                continue;
            };
            let last = self.last[node].min(to.saturating_sub(1)).max(place);
            let span = if last == place { 0 } else { times.0[usize::from(self.way[last].at.port & 3)] };
            gaps.push(gap(begin, place, span));
            (begin, place) = (last, last + 1);
        }
        if to < self.way.len() {
            gaps.push(gap(begin, to, 0));
        }
        gaps
    }
}

#[cfg(test)]
mod tests;
