//! Measured times of the cables of a segment, for delays that cannot be measured now.
//!
//! A frame passes the members of an intact local ring only once, so the cables between them cannot be measured. They
//! are measured while the ring is open: at set-up, which opens it for this purpose, or while it is broken. If
//! SubDevices without a clock are in between, only the sum of several cables is measured; times that follow from such
//! sums are known as well (`clocks::sums`).

use alloc::collections::BTreeMap;
use alloc::vec::Vec;

use super::cable_ends::{End, Ends, ends};
use super::known_cable::KnownCable;
use super::sums::{Sum, solve};
use crate::order::InOrder;

/// Sums of cables that are kept: many more than a segment has forks without a clock.
const MOST_SUMS: usize = 256;

#[derive(Clone, Copy, Debug)]
struct Known {
    time: i64,
    /// The cable was disconnected since the measurement: it may have been replaced.
    is_old: bool,
}

/// Times of cables, including the time that the frame takes through any SubDevice ([`Passage`](super::delay::Passage)).
#[derive(Clone, Debug, Default)]
pub struct Cables {
    known: BTreeMap<Ends, Known>,
    /// Times of several cables together; a cable counts as often as it is listed.
    sums: BTreeMap<Vec<Ends>, Known>,
}

impl Cables {
    /// All measured times.
    pub fn known(&self) -> Vec<KnownCable> {
        let cable = |ends: Vec<Ends>, known: &Known| KnownCable { ends, time: known.time, is_old: known.is_old };
        let single = self.known.iter().map(|(ends, known)| cable([*ends].into(), known));
        single.chain(self.sums.iter().map(|(ends, known)| cable(ends.clone(), known))).collect()
    }

    /// Goes on with measured times.
    pub fn of(all: &[KnownCable]) -> Cables {
        let mut cables = Cables::default();
        for KnownCable { ends: both, time, is_old } in all {
            let known = Known { time: *time, is_old: *is_old };
            let both: Vec<Ends> = both.iter().map(|cable| ends(*cable)).collect();
            match both[..] {
                [] => {}
                [single] => drop(cables.known.insert(single, known)),
                _ if cables.sums.len() < MOST_SUMS => drop(cables.sums.insert(sorted(&both), known)),
                _ => {}
            }
        }
        cables
    }

    /// Sets the cables that are connected now; all others are marked as old.
    pub fn set_present(&mut self, present: impl Iterator<Item = (End, End)>) {
        let present: alloc::collections::BTreeSet<Ends> = present.map(ends).collect();
        for (ends, known) in &mut self.known {
            known.is_old |= !present.contains(ends);
        }
        for (cables, known) in &mut self.sums {
            known.is_old |= !cables.iter().all(|ends| present.contains(ends));
        }
    }

    /// Stores the measured time of cables together; a cable counts as often as it is listed.
    pub(super) fn learn(&mut self, cables: &[Ends], time: i64) {
        let Some(first) = cables.first() else { return };
        if cables.iter().all(|other| other == first) {
            self.known.insert(*first, Known { time: time / cables.len() as i64, is_old: false });
            return;
        }
        if self.sums.len() >= MOST_SUMS {
            self.sums.retain(|_, known| !known.is_old);
        }
        if self.sums.len() < MOST_SUMS {
            self.sums.insert(sorted(cables), Known { time, is_old: false });
        }
    }

    /// The time of these cables together; a cable counts as often as it is listed. Cables that were disconnected since
    /// their measurement are unknown.
    pub(super) fn measured(&self, cables: &[Ends]) -> Option<i64> {
        self.time(cables, &|known| !known.is_old, None)
    }

    /// As [`Cables::measured`], with the last measured times also of cables that were disconnected since.
    pub(super) fn remembered(&self, cables: &[Ends]) -> Option<i64> {
        self.time(cables, &|_| true, None)
    }

    /// As [`Cables::measured`], with one more sum: the time of the cables `together`.
    pub(super) fn measured_with(&self, cables: &[Ends], together: &[Ends], time: i64) -> Option<i64> {
        self.time(cables, &|known| !known.is_old, Some(Sum { cables: together.to_vec(), time }))
    }

    fn time(&self, cables: &[Ends], counts: &dyn Fn(&Known) -> bool, more: Option<Sum>) -> Option<i64> {
        let of_one = |ends: &Ends| self.known.get(ends).filter(|known| counts(known)).map(|known| known.time);
        // Subtracts the known single cables from a sum.
        let without = |cables: &[Ends], time: i64| {
            let known: i64 = cables.iter().filter_map(of_one).sum();
            Sum { cables: cables.iter().filter(|ends| of_one(ends).is_none()).copied().collect(), time: time - known }
        };
        let wanted = without(cables, 0);
        if wanted.cables.is_empty() {
            return Some(-wanted.time);
        }
        if let Some(known) = self.sums.get(&sorted(cables)).filter(|known| counts(known)) {
            return Some(known.time);
        }
        let sums =
            self.sums.iter().filter(|(_, known)| counts(known)).map(|(cables, known)| without(cables, known.time));
        let sums: Vec<Sum> = sums.chain(more.map(|sum| without(&sum.cables, sum.time))).collect();
        Some(solve(&sums, &wanted.cables)? - wanted.time)
    }
}

fn sorted(cables: &[Ends]) -> Vec<Ends> {
    let mut cables = cables.to_vec();
    cables.put_in_order();
    cables
}

#[cfg(test)]
mod tests {
    use ringcat_wire::address::StationAddress;

    use super::*;

    // covers: dc-remeasure
    #[test]
    fn a_cable_that_was_disconnected_is_remembered_but_not_measured() {
        let (one, other) = ((StationAddress(7), 1), (StationAddress(3), 0));
        let cable = [ends((one, other))];
        let mut cables = Cables::default();
        cables.learn(&cable, 350);
        cables.set_present([(other, one)].into_iter());
        assert_eq!((cables.measured(&cable), cables.remembered(&cable)), (Some(350), Some(350)));
        cables.set_present(core::iter::empty());
        cables.set_present([(other, one)].into_iter());
        assert_eq!((cables.measured(&cable), cables.remembered(&cable)), (None, Some(350)));
        cables.learn(&cable, 360);
        assert_eq!(cables.measured(&cable), Some(360));
    }

    // covers: dc-remeasure
    #[test]
    fn times_follow_from_sums_and_one_old_cable_makes_its_sum_old() {
        let cable = |number: u16| ((StationAddress(number), 0), (StationAddress(number + 1), 0));
        let [a, x, y] = [cable(1), cable(2), cable(3)];
        let mut cables = Cables::default();
        cables.learn(&[a, x, a, x], 2 * 900);
        assert_eq!((cables.measured(&[x, a]), cables.measured(&[a])), (Some(900), None));
        cables.learn(&[y, a], 700);
        // The path into the first branch, into the second branch, and back.
        assert_eq!(cables.measured(&[x, y]), None);
        assert_eq!(cables.measured_with(&[x, y], &[a, x, x, y, y, a], 2 * 1_500), Some(1_400));
        cables.learn(&[a, a], 200);
        assert_eq!((cables.measured(&[x, y]), cables.measured(&[a, x, x])), (Some(1_400), Some(1_700)));
        cables.set_present([a, x].into_iter());
        cables.set_present([a, x, y].into_iter());
        assert_eq!(
            (cables.measured(&[x]), cables.measured(&[y]), cables.remembered(&[y])),
            (Some(800), None, Some(600))
        );
    }
}
