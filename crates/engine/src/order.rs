//! Sorting with one sort for all types.
//!
//! The sorts of the standard library are generic: each type of elements has 3 to 12 KiB of code of its own, which was a
//! tenth of a program. Here places are sorted, which are numbers, and the elements are then exchanged: the code of a
//! type is its comparison and that exchange. Sorts by places, stable, in `n log n` comparisons; takes 8 bytes of memory
//! per element meanwhile, so it is not for the cyclic path.

use alloc::vec::Vec;
use core::cmp::Ordering;
use core::mem::replace;

/// Lists that can be put in order.
pub(crate) trait InOrder<T> {
    /// Sorts the elements; equal ones keep their order.
    fn put_in_order(&mut self)
    where
        T: Ord;

    /// Sorts the elements by a key; those with equal keys keep their order.
    fn put_in_order_by_key<K: Ord>(&mut self, key: impl Fn(&T) -> K);
}

impl<T> InOrder<T> for [T] {
    fn put_in_order(&mut self)
    where
        T: Ord,
    {
        let places = sorted(self.len(), &|one, other| self[one].cmp(&self[other]));
        exchange(self, places);
    }

    fn put_in_order_by_key<K: Ord>(&mut self, key: impl Fn(&T) -> K) {
        let places = sorted(self.len(), &|one, other| key(&self[one]).cmp(&key(&self[other])));
        exchange(self, places);
    }
}

/// The places of the elements of a list of this length, in order.
fn sorted(length: usize, compare: &dyn Fn(usize, usize) -> Ordering) -> Vec<usize> {
    let mut places: Vec<usize> = (0..length).collect();
    places.sort_by(|one, other| compare(*one, *other));
    places
}

/// Moves to each place the element that was at the place named there: cycle by cycle.
fn exchange<T>(list: &mut [T], mut places: Vec<usize>) {
    for begin in 0..list.len() {
        let mut at = begin;
        loop {
            let from = replace(&mut places[at], at);
            if from == begin {
                break;
            }
            list.swap(at, from);
            at = from;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_order_is_that_of_the_standard_library(list in proptest::collection::vec((0..9u8, any::<u16>()), 0..70)) {
            let (mut ours, mut expected) = (list.clone(), list.clone());
            ours.put_in_order_by_key(|(key, _)| *key);
            expected.sort_by_key(|(key, _)| *key);
            prop_assert_eq!(&ours, &expected);
            ours.put_in_order();
            expected.sort_unstable();
            prop_assert_eq!(&ours, &expected);
        }
    }
}
