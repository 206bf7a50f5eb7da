//! Propagation delays of any segment, from the times at which one frame came in at each port (protocol 7.1).
//!
//! The path of the frame is followed port by port ([`Wiring::path`]). Between two arrivals at a SubDevice with a clock
//! lies a branch. The clock measures the time of the branch; without the times that the SubDevices in the branch
//! measured themselves, the rest is the time on cables. SubDevices without a clock are part of the cable. A cable takes
//! the same time in both directions; with this and the known times of cables ([`Cables`]) the delays follow. Behind a
//! fork without a clock they may not follow: then the clocks there form a group with an unknown place within the branch
//! (`clocks::places`).

use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;

use super::FRACTION;
use super::cable_ends::{End, Ends, ends};
use super::cables::Cables;
use super::delays::Delays;
use super::places::{Place, Places, Range};
use super::wiring::{Arrival, TREES, Wiring, processed_in};
use crate::order::InOrder;
use crate::topology::PortOf;

/// Longest possible round trip of a frame: a thousand SubDevices take 2 ms.
pub(super) const MOST_NS: i64 = 20_000_000;

/// Tolerance between a measured sum and the remembered times of its cables, and further tolerance per section: within
/// it, the cables are the remembered ones.
const SAME: i64 = 30 << FRACTION;
const SAME_CABLE: i64 = 10 << FRACTION;

/// Times at which the frame came in at port 0..3, relative to the entry port, with fraction ([`super::FRACTION`]).
/// Times of ports at which it did not come in have no meaning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PortTimes(pub [i64; 4]);

/// The segment that was measured.
#[derive(Clone, Copy, Debug)]
pub struct Segment<'a> {
    /// The connections between ports.
    pub wiring: &'a Wiring,
    /// Station addresses by position.
    pub stations: &'a [StationAddress],
    /// Known passages by position, see [`Passage`]; a SubDevice without one takes no additional time.
    pub passages: &'a [Passage],
}

/// Time of a frame through a SubDevice from port to port, with fraction, beyond a base time that all SubDevices have in
/// common (protocol 7.1: tDiff is the difference between both fields).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Passage {
    /// Path through the processing unit.
    pub processed: i64,
    /// Path without the processing unit.
    pub forwarded: i64,
}

impl Segment<'_> {
    fn end(&self, at: PortOf) -> Option<End> {
        Some((*self.stations.get(at.node)?, at.port))
    }

    /// Sets the connected cables ([`Cables::set_present`]).
    pub fn set_present(&self, cables: &mut Cables) {
        cables.set_present(self.wiring.cables().filter_map(|(near, far)| Some((self.end(near)?, self.end(far)?))));
    }

    /// Propagation delays. `times` by position, in units of one clock (see [`super::Measurements::mean`]); `None`
    /// without a clock. Delays are known if the time to the reference clock is known or, if that is on the other link,
    /// to the first clock. Measured times of cables are stored in `cables`.
    pub fn propagation(&self, times: &[Option<PortTimes>], reference: usize, cables: &mut Cables) -> Delays {
        let count = self.wiring.count();
        let mut delays = Delays { units: vec![None; count], trees: vec![0; count], ..Delays::default() };
        for tree in 0..TREES {
            let path = self.wiring.path(tree);
            let processed = processed_in(&path, count);
            let is_here = |node: &usize| processed[*node] && delays.units[*node].is_none();
            let here: Vec<bool> = (0..count).map(|node| is_here(&node)).collect();
            here.iter().zip(&mut delays.trees).filter(|(is, _)| **is).for_each(|(_, of)| *of = tree);
            let clock = |node: usize| times.get(node).copied().flatten().filter(|_| here[node]);
            Walk::new(self, &path, &clock).run(&mut delays, reference, cables);
        }
        delays
    }
}

/// The arrivals of one frame, with the times that the clocks measured.
struct Walk<'a, C: Fn(usize) -> Option<PortTimes>> {
    segment: &'a Segment<'a>,
    path: &'a [Arrival],
    clock: &'a C,
    /// By position: index of the last arrival at the SubDevice.
    last: Vec<usize>,
    /// By index of an arrival: index of the next arrival at the same SubDevice.
    next: Vec<Option<usize>>,
}

/// The path from one clock to the next, with only cables and SubDevices without a clock in between.
#[derive(Clone, Copy, Debug)]
struct Section {
    from: usize,
    to: usize,
    /// Known time of its cables.
    known: Option<i64>,
    /// Time of its cables, known or derived.
    time: Option<i64>,
    /// Time that the SubDevice at its end measured for the branches behind it.
    span: i64,
}

/// Result for the cables of a branch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum BranchTimes {
    /// All times follow, except those that a fork without a clock hides.
    Exact,
    /// Several cables of a ring share a time; the single times are unknown.
    Shared,
    /// The known times of all cables contradict the measured sum.
    Contradictory,
}

impl Section {
    const fn hops(&self) -> i64 {
        (self.to - self.from) as i64
    }
}

impl<'a, C: Fn(usize) -> Option<PortTimes>> Walk<'a, C> {
    fn new(segment: &'a Segment<'a>, path: &'a [Arrival], clock: &'a C) -> Walk<'a, C> {
        let count = segment.wiring.count();
        let mut last = vec![0; count];
        let mut seen: Vec<Option<usize>> = vec![None; count];
        let mut next = vec![None; path.len()];
        for (place, arrival) in path.iter().enumerate() {
            if let Some(before) = seen[arrival.at.node].replace(place) {
                next[before] = Some(place);
            }
            last[arrival.at.node] = place;
        }
        Walk { segment, path, clock, last, next }
    }

    fn run(&self, delays: &mut Delays, reference: usize, cables: &mut Cables) {
        let count = delays.units.len();
        let mut places = Places::new(count);
        let mut units: Vec<Option<Place>> = vec![None; count];
        // The path before the first clock, and between branches before it, is not measured.
        delays.is_guessed |= self.trunk(cables, &mut places);
        for place in 0..self.path.len() {
            let PortOf { node, port } = self.path[place].at;
            let (Some(entered), Some(times)) = (places.entered[node], (self.clock)(node)) else { continue };
            let is_first = units[node].is_none();
            if is_first {
                units[node] = Some(entered.after(self.to_unit(place, &times)));
            }
            if let Some(next) = self.next[place] {
                let at = |port: u8| times.0[usize::from(port & 3)];
                let from = if is_first { 0 } else { at(port) };
                let took = at(self.path[next].at.port) - from;
                delays.is_implausible |= !(0..=MOST_NS << FRACTION).contains(&took);
                let found = self.branch(place, next, took, entered.after(from), cables, &mut places);
                delays.is_shared |= found != BranchTimes::Exact;
                delays.is_contradictory |= found == BranchTimes::Contradictory;
            }
        }
        places.conclude(&units, reference, delays);
    }

    /// Time from the entry port to the processing unit.
    fn to_unit(&self, first: usize, times: &PortTimes) -> i64 {
        let mut place = first;
        while !self.path[place].processed {
            let Some(next) = self.next[place] else { break };
            place = next;
        }
        if place == first { 0 } else { times.0[usize::from(self.path[place].at.port & 3)] }
    }

    /// The path outside all branches, of which no clock measures the whole. Returns whether a time in it is not known.
    fn trunk(&self, cables: &Cables, places: &mut Places) -> bool {
        let (mut at, mut is_guessed) = (places.begin(), false);
        for section in self.sections(0, self.path.len(), &|hops| cables.remembered(hops)) {
            let first_clock = section.from == 0 && (self.clock)(self.path[0].at.node).is_none();
            if section.known.is_none() && !first_clock {
                is_guessed = true;
                at = places.apart(self.fork(section.from, section.to), None);
            }
            at = at.after(section.known.unwrap_or(0) + self.in_passages(&section));
            if let Some(arrival) = self.path.get(section.to) {
                places.entered[arrival.at.node] = Some(at);
            }
            at = at.after(section.span);
        }
        is_guessed
    }

    /// Divides the time `took` between two arrivals at a SubDevice among the cables of the branch. `begin` is the place
    /// of the first arrival.
    fn branch(
        &self,
        from: usize,
        to: usize,
        took: i64,
        begin: Place,
        cables: &mut Cables,
        places: &mut Places,
    ) -> BranchTimes {
        let mut sections = self.sections(from, to, &|hops| cables.measured(hops));
        let in_passages: i64 = sections.iter().map(|section| self.in_passages(section)).sum();
        let total = (took - in_passages - sections.iter().map(|section| section.span).sum::<i64>()).max(0);
        let known = |sections: &[Section]| sections.iter().filter_map(|section| section.known).sum::<i64>();
        let fits = |sections: &[Section]| {
            let all: Option<i64> = sections.iter().map(|section| section.known).sum();
            all.is_some_and(|all| (all - total).abs() <= SAME + sections.len() as i64 * SAME_CABLE)
        };
        if sections.iter().any(|section| section.known.is_none()) {
            // Cables that were disconnected are the same as before if their remembered times match the measured sum.
            let before = self.sections(from, to, &|hops| cables.remembered(hops));
            sections = if fits(&before) { before } else { sections };
        }
        let mut is_plausible = true;
        if known(&sections) > total && sections.iter().any(|section| section.known.is_none()) {
            // The known times exceed the measured sum: they are wrong.
            sections.iter_mut().for_each(|section| section.known = None);
            is_plausible = false;
        }
        // If all times are known, the difference to the measured sum is distributed.
        let all_known = sections.iter().all(|section| section.known.is_some());
        let rest = total - known(&sections);
        let is_one_cable = sections.len() == 2 && sections.iter().all(|section| section.hops() == 1);
        if all_known {
            self.share(&mut sections, rest);
        } else {
            self.follow(&mut sections, rest, is_plausible.then_some(&*cables));
        }
        let found = match sections.iter().any(|section| section.time.is_none()) {
            _ if all_known && !fits(&sections) => BranchTimes::Contradictory,
            true if self.are_several(&sections) => BranchTimes::Shared,
            _ => BranchTimes::Exact,
        };
        self.enter(&sections, (to, begin, begin.after(took)), rest, places);
        for section in &sections {
            if let Some(time) = section.time.filter(|_| section.known.is_none() || is_one_cable) {
                cables.learn(&self.hops(section.from, section.to), time);
            }
        }
        found
    }

    /// Sets the times of sections that are all known, and distributes the rest by number of hops.
    fn share(&self, sections: &mut [Section], rest: i64) {
        let all: i64 = sections.iter().map(Section::hops).sum();
        let (mut shared, mut done) = (0, 0);
        for section in sections {
            done += section.hops();
            let until = rest * done / all.max(1);
            section.time = section.known.map(|known| known + until - shared);
            shared = until;
        }
    }

    /// Sets the times of sections that follow from the sum `rest` of all unknown sections and from the known cables.
    fn follow(&self, sections: &mut [Section], rest: i64, cables: Option<&Cables>) {
        let unknown = || sections.iter().filter(|section| section.known.is_none());
        let together: Vec<Ends> = unknown().flat_map(|section| self.hops(section.from, section.to)).collect();
        let nothing = Cables::default();
        let cables = cables.unwrap_or(&nothing);
        let time = |section: &Section| {
            section
                .known
                .or_else(|| cables.measured_with(&self.hops(section.from, section.to), &together, rest))
                .filter(|time| *time >= 0)
        };
        let times: Vec<Option<i64>> = sections.iter().map(time).collect();
        sections.iter_mut().zip(times).for_each(|(section, time)| section.time = time);
    }

    /// Records when the frame reaches the clocks of a branch: from its beginning as far as the times are known, and
    /// from its end as well. Clocks in between form groups of their own.
    fn enter(&self, sections: &[Section], (to, begin, end): (usize, Place, Place), rest: i64, places: &mut Places) {
        let first = sections.iter().position(|section| section.time.is_none()).unwrap_or(sections.len());
        let last = sections.iter().rposition(|section| section.time.is_none()).unwrap_or(0);
        let took = |section: &Section| Some(section.time? + self.in_passages(section));
        let mut at = begin;
        for (number, section) in sections.iter().enumerate().filter(|(_, section)| section.to < to) {
            at = match took(section) {
                Some(took) => at.after(took),
                None if number == last && first < last => {
                    // All sections after this one are known.
                    let behind = sections[number + 1..]
                        .iter()
                        .map(|section| took(section).unwrap_or(0) + section.span)
                        .sum::<i64>();
                    end.after(-behind - section.span)
                }
                None => {
                    let range = self.range(&sections[..=number], sections, rest);
                    places.apart(self.fork(section.from, section.to), Some((begin, range)))
                }
            };
            places.entered[self.path[section.to].at.node] = Some(at);
            at = at.after(section.span);
        }
    }

    /// Range of the time through the sections `front`, if the unknown cables of all sections take `rest` together.
    fn range(&self, front: &[Section], all: &[Section], rest: i64) -> Range {
        let unknown = |sections: &[Section]| -> Vec<Ends> {
            sections
                .iter()
                .filter(|section| section.known.is_none())
                .flat_map(|section| self.hops(section.from, section.to))
                .collect()
        };
        let (before, all) = (unknown(front), unknown(all));
        let count = |of: &[Ends], ends: &Ends| of.iter().filter(|other| *other == ends).count() as i64;
        // The extremes: one cable takes all of the rest, namely that with the largest or the smallest part upstream.
        let shares = || all.iter().map(|ends| rest * count(&before, ends) / count(&all, ends).max(1));
        let (least, most) = (shares().min().unwrap_or(0), shares().max().unwrap_or(0));
        let spans = front.split_last().map_or(0, |(_, before)| before.iter().map(|section| section.span).sum());
        let fixed: i64 =
            front.iter().map(|section| section.known.unwrap_or(0) + self.in_passages(section)).sum::<i64>() + spans;
        (fixed + least, fixed + most)
    }

    /// The first SubDevice without a clock but with a branch between two arrivals.
    fn fork(&self, from: usize, to: usize) -> Option<usize> {
        let between = self.path.get(from..to.min(self.path.len()))?.iter().map(|arrival| arrival.at.node);
        let is_fork = |node: &usize| {
            let at = |port: u8| PortOf { node: *node, port };
            let leads_on = |port: &u8| self.segment.wiring.far(at(*port)).is_some();
            let is_entry = self.segment.wiring.entries.iter().flatten().any(|entry| entry.node == *node);
            (0..4).filter(leads_on).count() + usize::from(is_entry) > 2
        };
        between.filter(|node| (self.clock)(*node).is_none()).find(is_fork)
    }

    /// Whether several sections are unknown, and some of them contain a cable that the frame passes in one direction
    /// only. (If it passes a cable in both directions, both times are equal.)
    fn are_several(&self, sections: &[Section]) -> bool {
        let unknown = || sections.iter().filter(|section| section.known.is_none());
        let mut cables: Vec<Ends> = unknown().flat_map(|section| self.hops(section.from, section.to)).collect();
        cables.put_in_order();
        unknown().count() > 1 && cables.chunk_by(|one, other| one == other).any(|same| same.len() == 1)
    }

    /// Known time of the passage after an arrival.
    fn passage(&self, place: usize) -> i64 {
        let Arrival { at, processed } = self.path[place];
        let passage = self.segment.passages.get(at.node).copied().unwrap_or_default();
        if processed { passage.processed } else { passage.forwarded }
    }

    /// Known time of all passages of a section.
    fn in_passages(&self, section: &Section) -> i64 {
        (section.from..section.to).map(|hop| self.passage(hop)).sum()
    }

    /// The cables between two arrivals, each as often as the frame passes it.
    fn hops(&self, from: usize, to: usize) -> Vec<Ends> {
        (from..to).filter_map(|hop| self.cable(hop)).map(ends).collect()
    }

    /// Both ends of the cable after an arrival.
    fn cable(&self, place: usize) -> Option<(End, End)> {
        let far = self.path.get(place + 1)?.at;
        let near = self.segment.wiring.far(far)?;
        Some((self.segment.end(near)?, self.segment.end(far)?))
    }

    /// The sections between two arrivals. `known` returns the known time of cables.
    fn sections(&self, from: usize, to: usize, known: &dyn Fn(&[Ends]) -> Option<i64>) -> Vec<Section> {
        let mut sections = Vec::new();
        let mut begin = from;
        // The SubDevice before a branch is not part of it; the first SubDevice of the path is.
        let mut place = if from == 0 && to == self.path.len() { from } else { from + 1 };
        let section = |from: usize, to: usize, span: i64| {
            let hops = self.hops(from, to);
            let known = if hops.len() == to - from { known(&hops) } else { None };
            Section { from, to, known, time: None, span }
        };
        while place < to {
            let node = self.path[place].at.node;
            let Some(times) = (self.clock)(node) else {
                place += 1;
                continue;
            };
            let last = self.last[node].min(to.saturating_sub(1)).max(place);
            let span = if last == place { 0 } else { times.0[usize::from(self.path[last].at.port & 3)] };
            sections.push(section(begin, place, span));
            (begin, place) = (last, last + 1);
        }
        if to < self.path.len() {
            sections.push(section(begin, to, 0));
        }
        sections
    }
}

#[cfg(test)]
mod tests;
