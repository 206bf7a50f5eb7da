//! Words of an SII that several SubDevices with the same fixed area read together.
//!
//! An EEPROM takes half a millisecond for each 8 bytes, so the reading of one SII determines how long a scan takes.
//! Two SubDevices read the categories from the beginning, the others help from the end. A word is used for another
//! SubDevice only if two SubDevices have returned the same value, as in the cache, and all three have equal headers up
//! to the category of the word. Where two values differ, nothing is shared any more; differing names only end the
//! sharing of names, because names have no effect.

use alloc::collections::BTreeMap;
use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::RefCell;

use ringcat_wire::address::StationAddress;
use ringcat_wire::sii::{CategoryHeader, CategoryKind};

use super::contents::HEADER_WORDS;
use super::extents::words_of;
use crate::info::SiiExtent;

/// SubDevices that read a word.
const READERS: usize = 2;

/// The words that SubDevices with one fixed area have returned.
#[derive(Clone, Debug, Default)]
pub(super) struct SharedWords(Rc<RefCell<Shared>>);

#[derive(Debug, Default)]
struct Shared {
    places: Vec<Place>,
    trust: Trust,
    /// The complete chains of those that have read them.
    chains: Vec<Vec<CategoryHeader>>,
}

/// The data of a category in SubDevices whose chains are equal up to its header. With longer names, all data behind
/// them has another place.
#[derive(Debug)]
struct Place {
    chain: Vec<CategoryHeader>,
    words: BTreeMap<u32, Word>,
    /// SubDevices that read a block, by its first word.
    readers: BTreeMap<u32, Vec<StationAddress>>,
}

/// A returned word.
#[derive(Debug)]
struct Word {
    value: u16,
    by: StationAddress,
    is_confirmed: bool,
}

/// Which words may be used for other SubDevices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Trust {
    #[default]
    All,
    AllButNames,
    None,
}

impl Trust {
    fn covers(self, kind: CategoryKind) -> bool {
        match self {
            Trust::All => true,
            Trust::AllButNames => kind != CategoryKind::Strings,
            Trust::None => false,
        }
    }
}

impl Shared {
    fn place(&self, chain: &[CategoryHeader]) -> Option<&Place> {
        self.places.iter().find(|place| place.chain == chain)
    }

    fn place_mut(&mut self, chain: &[CategoryHeader]) -> &mut Place {
        let at = self.places.iter().position(|place| place.chain == chain).unwrap_or_else(|| {
            self.places.push(Place { chain: chain.to_vec(), words: BTreeMap::new(), readers: BTreeMap::new() });
            self.places.len() - 1
        });
        &mut self.places[at]
    }

    fn add_chain(&mut self, chain: &[CategoryHeader]) {
        if !self.chains.iter().any(|known| known == chain) {
            self.chains.push(chain.to_vec());
        }
    }
}

/// Type of the last category.
fn last_kind(chain: &[CategoryHeader]) -> CategoryKind {
    chain.last().map_or(CategoryKind::Nop, |category| category.kind)
}

impl SharedWords {
    /// A word of the last of these categories for which two SubDevices with these headers have returned this value.
    pub fn confirmed(&self, chain: &[CategoryHeader], word: u32) -> Option<u16> {
        let shared = self.0.borrow();
        let found = shared.place(chain)?.words.get(&word)?;
        (shared.trust.covers(last_kind(chain)) && found.is_confirmed).then_some(found.value)
    }

    /// Which words may be used now. If that has changed, words that were used before may have to be read.
    pub fn trust(&self) -> Trust {
        self.0.borrow().trust
    }

    /// Whether words may have been used for a SubDevice with this complete chain. Words of a category are shared before
    /// the headers behind it are known; another chain that begins like this one may have had a part in them.
    pub fn suit(&self, chain: &[CategoryHeader]) -> bool {
        let shared = &mut *self.0.borrow_mut();
        shared.add_chain(chain);
        shared.chains.iter().all(|other| other == chain || other.first() != chain.first())
    }

    /// A SubDevice has returned data of the last of these categories: each word that it has read itself.
    pub fn report(&self, by: StationAddress, chain: &[CategoryHeader], words: impl Iterator<Item = (u32, u16)>) {
        let shared = &mut *self.0.borrow_mut();
        let place = shared.place_mut(chain);
        let mut differ = false;
        for (word, value) in words {
            let found = place.words.entry(word).or_insert(Word { value, by, is_confirmed: false });
            differ |= found.value != value;
            found.is_confirmed |= found.value == value && found.by != by;
        }
        if differ && shared.trust != Trust::None {
            let is_name = last_kind(chain) == CategoryKind::Strings;
            shared.trust = if is_name { Trust::AllButNames } else { Trust::None };
        }
    }

    /// The last block that too few other SubDevices read; this one reads it.
    pub fn claim(&self, by: StationAddress, blocks: &Blocks) -> Option<Block> {
        let shared = &mut *self.0.borrow_mut();
        shared.add_chain(&blocks.chain);
        let is_free = |block: &&Block| {
            let chain = blocks.before(block);
            let is_open = shared.place(chain).is_none_or(|place| {
                let readers = place.readers.get(&block.first).map_or(&[][..], Vec::as_slice);
                let is_confirmed = place.words.get(&block.first).is_some_and(|word| word.is_confirmed);
                !is_confirmed && readers.len() < READERS && !readers.contains(&by)
            });
            is_open && shared.trust.covers(last_kind(chain))
        };
        let block = blocks.blocks.iter().rev().find(is_free).copied()?;
        shared.place_mut(blocks.before(&block)).readers.entry(block.first).or_default().push(by);
        Some(block)
    }
}

/// Words that one command reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Block {
    pub first: u32,
    pub count: u32,
    /// Number of its category in the chain.
    category: usize,
}

/// The data of the categories that are read, behind the words that come with their headers.
#[derive(Debug)]
pub(super) struct Blocks {
    chain: Vec<CategoryHeader>,
    blocks: Vec<Block>,
}

impl Blocks {
    /// The blocks of those categories of a chain that an extent contains, each with `width` words.
    pub fn new(chain: &[CategoryHeader], extent: SiiExtent, width: u32) -> Blocks {
        let mut blocks = Vec::new();
        let mut header = HEADER_WORDS;
        for (number, category) in chain.iter().enumerate() {
            let end = header + 2 + u32::from(category.words);
            let read = (header + 2).saturating_add(words_of(extent, category.kind)).min(end);
            if extent.contains(category.kind) {
                let firsts = (header + width..read).step_by(width as usize);
                let block = |first| Block { first, count: width.min(read - first), category: number };
                blocks.extend(firsts.map(block));
            }
            header = end;
        }
        Blocks { chain: chain.to_vec(), blocks }
    }

    /// The headers up to the one of a block's category.
    pub fn before(&self, block: &Block) -> &[CategoryHeader] {
        &self.chain[..=block.category]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHAIN: [CategoryHeader; 2] = [
        CategoryHeader { kind: CategoryKind::Strings, words: 6 },
        CategoryHeader { kind: CategoryKind::General, words: 3 },
    ];
    const NAMES: u32 = HEADER_WORDS + 2;
    const GENERAL: u32 = HEADER_WORDS + 10;

    fn report(shared: &SharedWords, by: u16, chain: &[CategoryHeader], word: u32, value: u16) {
        shared.report(StationAddress(by), chain, [(word, value)].into_iter());
    }

    #[test]
    fn a_word_counts_when_two_subdevices_returned_it() {
        let shared = SharedWords::default();
        report(&shared, 1, &CHAIN, GENERAL, 7);
        report(&shared, 1, &CHAIN, GENERAL, 7);
        assert_eq!(shared.confirmed(&CHAIN, GENERAL), None, "a SubDevice does not confirm itself");
        report(&shared, 2, &CHAIN, GENERAL, 7);
        assert_eq!(shared.confirmed(&CHAIN, GENERAL), Some(7));
        report(&shared, 3, &CHAIN, GENERAL, 8);
        assert_eq!((shared.confirmed(&CHAIN, GENERAL), shared.trust()), (None, Trust::None));
    }

    #[test]
    fn words_at_one_address_behind_other_headers_are_others() {
        let longer = [CategoryHeader { kind: CategoryKind::Strings, words: 7 }, CHAIN[1]];
        let shared = SharedWords::default();
        report(&shared, 1, &CHAIN, GENERAL, 7);
        report(&shared, 2, &longer, GENERAL, 7);
        assert_eq!((shared.confirmed(&CHAIN, GENERAL), shared.confirmed(&longer, GENERAL)), (None, None));
        report(&shared, 3, &longer, GENERAL, 7);
        assert_eq!((shared.confirmed(&CHAIN, GENERAL), shared.confirmed(&longer, GENERAL)), (None, Some(7)));
        report(&shared, 4, &CHAIN, GENERAL, 8);
        assert_eq!(shared.trust(), Trust::None);
    }

    #[test]
    fn words_suit_a_chain_if_no_other_one_begins_like_it() {
        let shared = SharedWords::default();
        let end = CategoryHeader { kind: CategoryKind::End, words: 0 };
        let longer = [CategoryHeader { kind: CategoryKind::Strings, words: 7 }, end];
        assert!(shared.suit(&CHAIN) && shared.suit(&longer) && shared.suit(&CHAIN));
        assert!(!shared.suit(&[CHAIN[0], end]) && !shared.suit(&CHAIN) && shared.suit(&longer));
    }

    #[test]
    fn differing_names_end_the_sharing_of_names_alone() {
        let shared = SharedWords::default();
        let blocks = Blocks::new(&CHAIN, SiiExtent::Complete, 4);
        assert!(shared.claim(StationAddress(1), &blocks).is_some());
        for by in [1, 2] {
            report(&shared, by, &CHAIN, GENERAL, 7);
            report(&shared, by, &CHAIN[..1], NAMES, 1);
            report(&shared, by, &CHAIN[..1], NAMES + 1, by);
        }
        assert_eq!((shared.confirmed(&CHAIN[..1], NAMES), shared.confirmed(&CHAIN, GENERAL)), (None, Some(7)));
        assert_eq!(shared.trust(), Trust::AllButNames);
        let claimed = core::iter::from_fn(|| shared.claim(StationAddress(2), &blocks));
        assert!(claimed.into_iter().all(|block| block.category == 1));
    }

    #[test]
    fn two_subdevices_read_each_block_from_the_last_one_on() {
        for (width, firsts) in [(4, [12, 4].as_slice()), (2, &[12, 10, 6, 4, 2])] {
            let shared = SharedWords::default();
            let blocks = Blocks::new(&CHAIN, SiiExtent::Complete, width);
            let expected: Vec<u32> = firsts.iter().map(|at| HEADER_WORDS + at).collect();
            for (by, expected) in [(1, &expected), (2, &expected), (3, &Vec::new())] {
                let claimed = core::iter::from_fn(|| shared.claim(StationAddress(by), &blocks));
                assert_eq!(&claimed.map(|block| block.first).collect::<Vec<_>>(), expected);
            }
        }
    }
}
