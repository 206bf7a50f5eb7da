//! What is known about the cables of a segment, so that a delay that cannot be measured now is known from before.
//!
//! A frame meets the members of a whole ring only once, and what is between them cannot be measured then. It was while
//! the ring was open: at the set-up, which opens it for that, or while it was broken. Where SubDevices without a clock
//! are in between, times show the sum of several cables; what follows from such sums is known as well
//! (`clocks::sums`).

use alloc::collections::BTreeMap;
use alloc::vec::Vec;

use super::cable_ends::{End, Ends, ends};
use super::sums::{Sum, solve};

/// Sums of cables that are kept: many more than a segment has forks without a clock.
const MOST_SUMS: usize = 256;

#[derive(Clone, Copy, Debug)]
struct Known {
    time: i64,
    /// It has been away since: what is plugged in there now may be another one.
    is_old: bool,
}

/// Times on cables, with what all passages take ([`Passage`](super::delay::Passage)).
#[derive(Clone, Debug, Default)]
pub struct Cables {
    known: BTreeMap<Ends, Known>,
    /// What several take together, each as often as it counts.
    sums: BTreeMap<Vec<Ends>, Known>,
}

impl Cables {
    /// These cables are there, and no others.
    pub fn set_present(&mut self, present: impl Iterator<Item = (End, End)>) {
        let present: alloc::collections::BTreeSet<Ends> = present.map(ends).collect();
        for (ends, known) in &mut self.known {
            known.is_old |= !present.contains(ends);
        }
        for (cables, known) in &mut self.sums {
            known.is_old |= !cables.iter().all(|ends| present.contains(ends));
        }
    }

    /// Cables were measured together, each as often as it is named.
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

    /// What these cables take together, as often as each is named. Those that have been away since they were measured
    /// do not count.
    pub(super) fn measured(&self, cables: &[Ends]) -> Option<i64> {
        self.time(cables, &|known| !known.is_old, None)
    }

    /// The same, as measured last.
    pub(super) fn remembered(&self, cables: &[Ends]) -> Option<i64> {
        self.time(cables, &|_| true, None)
    }

    /// The same where it is also known what some cables take together.
    pub(super) fn measured_with(&self, cables: &[Ends], together: &[Ends], time: i64) -> Option<i64> {
        self.time(cables, &|known| !known.is_old, Some(Sum { cables: together.to_vec(), time }))
    }

    fn time(&self, cables: &[Ends], counts: &dyn Fn(&Known) -> bool, more: Option<Sum>) -> Option<i64> {
        let of_one = |ends: &Ends| self.known.get(ends).filter(|known| counts(known)).map(|known| known.time);
        // Without what is known of single cables.
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
    cables.sort_unstable();
    cables
}

#[cfg(test)]
mod tests {
    use ringcat_wire::address::StationAddress;

    use super::*;

    // covers: dc-remeasure
    #[test]
    fn a_cable_that_was_away_is_remembered_and_counts_as_measured_no_longer() {
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
    fn what_follows_from_sums_is_known_and_a_sum_is_as_old_as_its_oldest_cable() {
        let cable = |number: u16| ((StationAddress(number), 0), (StationAddress(number + 1), 0));
        let [a, x, y] = [cable(1), cable(2), cable(3)];
        let mut cables = Cables::default();
        cables.learn(&[a, x, a, x], 2 * 900);
        assert_eq!((cables.measured(&[x, a]), cables.measured(&[a])), (Some(900), None));
        cables.learn(&[y, a], 700);
        // Out to the first branch, to the second one, and home.
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
