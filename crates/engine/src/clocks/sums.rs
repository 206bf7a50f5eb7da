//! Times of cables from sums over several cables: linear equations, solved exactly.
//!
//! Input: sums of cables with their time; a cable is listed as often as it counts. Output: the time of other sums, if
//! it follows exactly. Coefficients are small, because a frame passes a cable once in each direction.

use alloc::vec;
use alloc::vec::Vec;

use super::cable_ends::Ends;
use crate::order::InOrder;

/// Largest number of cables in a system of equations; more are not solved.
const MOST_CABLES: usize = 512;

/// The time that these cables take together; a cable counts as often as it is listed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Sum {
    pub cables: Vec<Ends>,
    pub time: i64,
}

/// An equation: coefficients by cable, and the time of the sum.
#[derive(Clone, Debug)]
struct Row {
    factors: Vec<i128>,
    time: i128,
}

impl Row {
    fn pivot(&self) -> Option<usize> {
        self.factors.iter().position(|factor| *factor != 0)
    }

    /// Eliminates the pivot column of another row from this one. Returns the factor by which this row was multiplied;
    /// `None` on overflow.
    fn reduce(&mut self, other: &Row, pivot: usize) -> Option<i128> {
        let (own, of_other) = (self.factors[pivot], other.factors[pivot]);
        let common = divisor(own, of_other);
        let (times, less) = (of_other / common, own / common);
        let next = |own: i128, other: i128| own.checked_mul(times)?.checked_sub(other.checked_mul(less)?);
        for (own, other) in self.factors.iter_mut().zip(&other.factors) {
            *own = next(*own, *other)?;
        }
        self.time = next(self.time, other.time)?;
        Some(times)
    }
}

/// The time that these cables take together; `None` if it does not follow from the sums.
pub(super) fn solve(sums: &[Sum], wanted: &[Ends]) -> Option<i64> {
    let mut cables = wanted.to_vec();
    cables.put_in_order();
    cables.dedup();
    // The sums that have cables in common with the wanted ones, directly or through other sums.
    let mut relevant: Vec<&Sum> = Vec::new();
    let mut others: Vec<&Sum> = sums.iter().filter(|sum| !sum.cables.is_empty()).collect();
    loop {
        let (near, far): (Vec<_>, Vec<_>) =
            others.into_iter().partition(|sum| sum.cables.iter().any(|ends| cables.binary_search(ends).is_ok()));
        if near.is_empty() {
            break;
        }
        cables.extend(near.iter().flat_map(|sum| &sum.cables));
        cables.put_in_order();
        cables.dedup();
        relevant.extend(near);
        others = far;
    }
    if cables.len() > MOST_CABLES {
        return None;
    }
    let row = |of: &[Ends], time: i64| {
        let mut factors = vec![0; cables.len()];
        of.iter().filter_map(|ends| cables.binary_search(ends).ok()).for_each(|at| factors[at] += 1);
        Row { factors, time: i128::from(time) }
    };
    let mut rows: Vec<(usize, Row)> = Vec::new();
    for sum in relevant {
        let mut row = row(&sum.cables, sum.time);
        for (pivot, other) in &rows {
            row.reduce(other, *pivot)?;
        }
        rows.extend(row.pivot().map(|pivot| (pivot, row)));
    }
    let (mut left, mut scale) = (row(wanted, 0), 1_i128);
    for (pivot, other) in &rows {
        scale = scale.checked_mul(left.reduce(other, *pivot)?)?;
    }
    let time = -left.time;
    // Rounded to the nearest.
    let half = scale.abs() / 2;
    let rounded = (time * scale.signum() + half).div_euclid(scale.abs());
    left.pivot().is_none().then_some(i64::try_from(rounded).ok()?)
}

/// The greatest common divisor, at least 1.
fn divisor(one: i128, other: i128) -> i128 {
    let (mut one, mut other) = (one.abs(), other.abs());
    while other != 0 {
        (one, other) = (other, one % other);
    }
    one.max(1)
}

#[cfg(test)]
mod tests {
    use ringcat_wire::address::StationAddress;

    use super::*;

    fn cable(number: u16) -> Ends {
        ((StationAddress(number), 0), (StationAddress(number + 1), 0))
    }

    #[test]
    fn a_time_that_follows_is_exact_and_any_other_is_none() {
        let sum = |cables: &[u16], time| Sum { cables: cables.iter().map(|number| cable(*number)).collect(), time };
        let of =
            |sums: &[Sum], cables: &[u16]| solve(sums, &cables.iter().map(|number| cable(*number)).collect::<Vec<_>>());
        let round = sum(&[1, 2, 2, 3, 3, 1], 1_000);
        assert_eq!(of(std::slice::from_ref(&round), &[1, 2]), None);
        assert_eq!(of(std::slice::from_ref(&round), &[3, 2, 1]), Some(500));
        let sums = [round, sum(&[3, 1], 301)];
        assert_eq!((of(&sums, &[2]), of(&sums, &[1, 2, 2, 3]), of(&sums, &[1])), (Some(199), Some(699), None));
        // A redundant sum is no contradiction, and a sum of other cables changes nothing.
        let sums = [sum(&[1, 1], 500), sum(&[1], 250), sum(&[7, 8], 9), sum(&[], 4)];
        assert_eq!((of(&sums, &[1, 1, 1]), of(&sums, &[7]), of(&[], &[1])), (Some(750), None, None));
    }

    proptest::proptest! {
        /// A solved time equals that of the single cables from which the sums were made.
        // covers: dc-delays
        #[test]
        fn every_solved_time_is_the_true_one(
            times in proptest::collection::vec(0i64..10_000, 6),
            sums in proptest::collection::vec(proptest::collection::vec(0u16..6, 1..8), 0..8),
            wanted in proptest::collection::vec(0u16..6, 1..6),
        ) {
            let time = |cables: &[u16]| cables.iter().map(|number| times[usize::from(*number)]).sum::<i64>();
            let of = |cables: &[u16]| cables.iter().map(|number| cable(*number)).collect::<Vec<_>>();
            let known: Vec<Sum> = sums.iter().map(|cables| Sum { cables: of(cables), time: time(cables) }).collect();
            let solved = solve(&known, &of(&wanted));
            proptest::prop_assert!(solved.is_none_or(|solved| solved == time(&wanted)));
            let is_given = sums.iter().any(|cables| {
                let (mut one, mut other) = (cables.clone(), wanted.clone());
                one.sort_unstable();
                other.sort_unstable();
                one == other
            });
            proptest::prop_assert!(!is_given || solved.is_some());
        }
    }
}
