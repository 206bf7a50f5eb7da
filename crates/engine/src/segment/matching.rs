//! Identifies unassigned SubDevices between two known ones as absent SubDevices.
//!
//! Both are in the order of the segment, and this order decides: of several of the same type the first on the main side
//! is the first, the last on the redundant side the last, because a SubDevice can only answer through its neighbours.
//! Serial numbers have priority over order.

use alloc::vec;
use alloc::vec::Vec;

/// How well an unassigned SubDevice matches an absent one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fit {
    /// It is another SubDevice.
    No,
    /// Its SII cannot be read: it may be the absent one, and occupies its place.
    Unreadable,
    /// It may be the absent one, which was never seen.
    NeverSeen,
    /// It may be the absent one.
    Seen,
    /// It has the serial number of the absent one.
    Serial,
}

impl Fit {
    const fn score(self) -> Option<u64> {
        match self {
            Fit::No => None,
            Fit::Unreadable => Some(1),
            Fit::NeverSeen => Some(2),
            Fit::Seen | Fit::Serial => Some(3),
        }
    }
}

/// The absent SubDevice that each unassigned SubDevice is, if any. `fit` returns how well an unassigned and an absent
/// one match; `from_main` is true for an unassigned one that answers on the main link.
pub(super) fn assign(from_main: &[bool], absent: usize, fit: impl Fn(usize, usize) -> Fit) -> Vec<Option<usize>> {
    let mut assigned = vec![None; from_main.len()];
    for (candidate, slot) in assigned.iter_mut().enumerate() {
        *slot = (0..absent).find(|place| fit(candidate, *place) == Fit::Serial);
    }
    let open: Vec<usize> = (0..assigned.len()).filter(|candidate| assigned[*candidate].is_none()).collect();
    let places: Vec<usize> = (0..absent).filter(|place| !assigned.contains(&Some(*place))).collect();
    // Maximises the sum of scores; the lower half of the word prefers places near the side on which the unassigned
    // SubDevice answers.
    let value = |one: usize, other: usize| {
        let (candidate, place) = (open[one], places[other]);
        let near = if from_main[candidate] { places.len() - other } else { other + 1 };
        fit(candidate, place).score().map(|score| (score << 32) + near as u64)
    };
    let width = places.len() + 1;
    let mut best = vec![0u64; (open.len() + 1) * width];
    for one in 0..open.len() {
        for other in 0..places.len() {
            let paired = value(one, other).map_or(0, |value| best[one * width + other] + value);
            best[(one + 1) * width + other + 1] =
                paired.max(best[one * width + other + 1]).max(best[(one + 1) * width + other]);
        }
    }
    let (mut one, mut other) = (open.len(), places.len());
    while one > 0 && other > 0 {
        let here = best[one * width + other];
        if here == best[(one - 1) * width + other] {
            one -= 1;
        } else if here == best[one * width + other - 1] {
            other -= 1;
        } else {
            (one, other) = (one - 1, other - 1);
            assigned[open[one]] = Some(places[other]);
        }
    }
    assigned
}

#[cfg(test)]
mod tests {
    use super::Fit::{NeverSeen, No, Seen, Serial, Unreadable};
    use super::*;

    fn assigned<const N: usize>(from_main: &[bool], fits: &[[Fit; N]]) -> Vec<Option<usize>> {
        assign(from_main, N, |candidate, place| fits[candidate][place])
    }

    #[test]
    fn subdevices_of_one_type_keep_the_order_of_the_segment() {
        assert_eq!(assigned(&[true, true], &[[Seen; 2]; 2]), [Some(0), Some(1)]);
        assert_eq!(assigned(&[false, false], &[[Seen; 2]; 2]), [Some(0), Some(1)]);
        assert_eq!(assigned(&[true, false], &[[Seen; 3]; 2]), [Some(0), Some(2)]);
    }

    #[test]
    fn fewer_subdevices_than_absent_members_match_the_nearest_places() {
        assert_eq!(assigned(&[true], &[[Seen; 3]]), [Some(0)]);
        assert_eq!(assigned(&[false], &[[Seen; 3]]), [Some(2)]);
        assert_eq!(assigned(&[false, false], &[[Seen; 3]; 2]), [Some(1), Some(2)]);
    }

    #[test]
    fn a_member_seen_before_is_preferred_to_a_member_never_seen() {
        assert_eq!(assigned(&[true], &[[NeverSeen, Seen]]), [Some(1)]);
        assert_eq!(assigned(&[true, true], &[[NeverSeen, Seen]; 2]), [Some(0), Some(1)], "both are there now");
        assert_eq!(assigned(&[true], &[[NeverSeen, No]]), [Some(0)]);
    }

    #[test]
    fn serial_numbers_have_priority_over_order() {
        assert_eq!(assigned(&[true], &[[Seen, Serial]]), [Some(1)]);
        assert_eq!(assigned(&[true, true], &[[Seen, Serial], [Seen, Seen]]), [Some(1), Some(0)]);
    }

    #[test]
    fn an_unreadable_subdevice_keeps_its_place_unless_a_readable_one_matches() {
        assert_eq!(assigned(&[true, true], &[[Unreadable; 2], [Seen; 2]]), [Some(0), Some(1)]);
        assert_eq!(assigned(&[true, true], &[[Unreadable], [Seen]]), [None, Some(0)]);
    }

    #[test]
    fn a_subdevice_that_matches_nowhere_is_no_member() {
        assert_eq!(assigned(&[true, true], &[[No, No], [No, Seen]]), [None, Some(1)]);
        assert_eq!(assigned::<0>(&[true], &[[]]), [None]);
    }
}
