//! Sorting in little code: the sorts of the standard library have 5 KB for each type of elements.

/// In the order of a key; those with equal keys keep their order. For lists of a few thousand at most.
pub fn by_key<T>(list: Vec<T>, key: impl Fn(&T) -> u32) -> Vec<T> {
    let mut places: Vec<u64> = Vec::new();
    for (place, it) in list.iter().enumerate() {
        let place = u64::from(key(it)) << 32 | place as u64;
        places.insert(places.partition_point(|before| *before < place), place);
    }
    let mut list: Vec<Option<T>> = list.into_iter().map(Some).collect();
    places.into_iter().filter_map(|place| list.get_mut(place as u32 as usize)?.take()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn a_list_is_in_order_and_equal_keys_keep_theirs() {
        let list = vec![(u32::MAX, 'a'), (0, 'b'), (7, 'c'), (0, 'd'), (7, 'e')];
        let letters: String = by_key(list, |(key, _)| *key).into_iter().map(|(_, letter)| letter).collect();
        assert_eq!(letters, "bdcea");
        assert!(by_key(Vec::<u32>::new(), |it| *it).is_empty());
    }
}
