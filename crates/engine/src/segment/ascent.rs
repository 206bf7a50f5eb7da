//! The longest ascending part of a sequence: those that have kept their order.

use alloc::vec;
use alloc::vec::Vec;

/// Members of a longest ascending subsequence of distinct numbers.
pub fn longest_ascent(numbers: &[usize]) -> Vec<bool> {
    // `ends[n]`: the place of the smallest last number of a subsequence of length n + 1. By place: its predecessor in
    // the subsequence.
    let mut ends: Vec<usize> = Vec::new();
    let mut before: Vec<Option<usize>> = Vec::new();
    for (at, number) in numbers.iter().enumerate() {
        let length = ends.partition_point(|end| numbers[*end] < *number);
        before.push(length.checked_sub(1).map(|shorter| ends[shorter]));
        if length < ends.len() {
            ends[length] = at;
        } else {
            ends.push(at);
        }
    }
    let mut stays = vec![false; numbers.len()];
    let mut at = ends.last().copied();
    while let Some(place) = at {
        stays[place] = true;
        at = before[place];
    }
    stays
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moved(places: &[usize]) -> Vec<usize> {
        let stays = longest_ascent(places);
        places.iter().zip(stays).filter(|(_, stays)| !stays).map(|(place, _)| *place).collect()
    }

    // covers: rescan
    #[test]
    fn as_few_as_possible_have_moved() {
        assert_eq!(moved(&[]), []);
        assert_eq!(moved(&[0, 2, 3, 7]), [], "gaps and what was put in between are no moves");
        assert_eq!(moved(&[0, 1, 3, 4, 2]), [2]);
        assert_eq!(moved(&[4, 0, 1, 2, 3]), [4]);
        assert_eq!(moved(&[0, 3, 4, 1, 2, 5]).len(), 2);
        assert_eq!(moved(&[3, 2, 1, 0]).len(), 3);
    }
}
