//! Words of an SII that several SubDevices with the same fixed area read together.
//!
//! An EEPROM takes half a millisecond for each 8 bytes, so the reading of one SII determines how long a scan takes.
//! Two SubDevices read the categories from the beginning, the others help from the end. A word is used for another
//! SubDevice only if two SubDevices have returned the same value, as in the cache. Where two values differ, nothing is
//! shared any more; differing names only end the sharing of names, because names have no effect.

use alloc::collections::BTreeMap;
use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::ops::Range;

use ringcat_wire::address::StationAddress;
use ringcat_wire::sii::{CategoryHeader, CategoryKind};

use super::contents::{HEADER_WORDS, is_needed};

/// SubDevices that read a word.
const READERS: usize = 2;

/// The words that SubDevices with one fixed area have returned.
#[derive(Clone, Debug, Default)]
pub(super) struct SharedWords(Rc<RefCell<Shared>>);

#[derive(Debug, Default)]
struct Shared {
    words: BTreeMap<u32, Word>,
    /// SubDevices that read a block, by its first word.
    readers: BTreeMap<u32, Vec<StationAddress>>,
    trust: Trust,
    /// Words with names.
    names: Range<u32>,
    /// The chain of categories in the EEPROMs of the SubDevices that share words.
    chain: Vec<CategoryHeader>,
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

impl SharedWords {
    /// A word for which two SubDevices have returned this value.
    pub fn confirmed(&self, word: u32) -> Option<u16> {
        let shared = self.0.borrow();
        let is_trusted = match shared.trust {
            Trust::All => true,
            Trust::AllButNames => !shared.names.contains(&word),
            Trust::None => false,
        };
        shared.words.get(&word).filter(|found| is_trusted && found.is_confirmed).map(|found| found.value)
    }

    /// Which words may be used now. If that has changed, words that were used before may have to be read.
    pub fn trust(&self) -> Trust {
        self.0.borrow().trust
    }

    /// A SubDevice has returned data of a category: each word that it has read itself.
    pub fn report(&self, by: StationAddress, kind: CategoryKind, words: impl Iterator<Item = (u32, u16)>) {
        let shared = &mut *self.0.borrow_mut();
        for (word, value) in words {
            let found = shared.words.entry(word).or_insert(Word { value, by, is_confirmed: false });
            if found.value != value {
                let trust = if kind == CategoryKind::Strings { Trust::AllButNames } else { Trust::None };
                shared.trust = if shared.trust == Trust::None { Trust::None } else { trust };
            } else if found.by != by {
                found.is_confirmed = true;
            }
        }
    }

    /// The last block that too few other SubDevices read; this one reads it.
    pub fn claim(&self, by: StationAddress, blocks: &Blocks) -> Option<Block> {
        let shared = &mut *self.0.borrow_mut();
        if shared.chain.is_empty() {
            shared.chain.clone_from(&blocks.chain);
            shared.names = blocks.names.clone();
        } else if shared.chain != blocks.chain {
            // With longer names, all data behind them has another place.
            return None;
        }
        let may_be_used = |kind| match shared.trust {
            Trust::All => true,
            Trust::AllButNames => kind != CategoryKind::Strings,
            Trust::None => false,
        };
        let is_free = |block: &&Block| {
            let is_confirmed = shared.words.get(&block.first).is_some_and(|word| word.is_confirmed);
            let readers = shared.readers.get(&block.first).map_or(&[][..], Vec::as_slice);
            may_be_used(block.kind) && !is_confirmed && readers.len() < READERS && !readers.contains(&by)
        };
        let block = blocks.blocks.iter().rev().find(is_free).copied()?;
        shared.readers.entry(block.first).or_default().push(by);
        Some(block)
    }
}

/// Words that one command reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Block {
    pub first: u32,
    pub count: u32,
    pub kind: CategoryKind,
}

/// The data of the categories that are read, behind the words that come with their headers.
#[derive(Debug)]
pub(super) struct Blocks {
    chain: Vec<CategoryHeader>,
    blocks: Vec<Block>,
    names: Range<u32>,
}

impl Blocks {
    /// The blocks of a chain of categories, each with `width` words.
    pub fn new(chain: &[CategoryHeader], width: u32) -> Blocks {
        let (mut blocks, mut names) = (Vec::new(), 0..0);
        let mut header = HEADER_WORDS;
        for category in chain {
            let end = header + 2 + u32::from(category.words);
            if is_needed(category.kind) {
                let firsts = (header + width..end).step_by(width as usize);
                let block = |first| Block { first, count: width.min(end - first), kind: category.kind };
                blocks.extend(firsts.map(block));
            }
            if category.kind == CategoryKind::Strings {
                names = header + 2..end;
            }
            header = end;
        }
        Blocks { chain: chain.to_vec(), blocks, names }
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

    fn report(shared: &SharedWords, by: u16, kind: CategoryKind, word: u32, value: u16) {
        shared.report(StationAddress(by), kind, [(word, value)].into_iter());
    }

    #[test]
    fn a_word_counts_when_two_subdevices_returned_it() {
        let shared = SharedWords::default();
        report(&shared, 1, CategoryKind::General, GENERAL, 7);
        report(&shared, 1, CategoryKind::General, GENERAL, 7);
        assert_eq!(shared.confirmed(GENERAL), None, "a SubDevice does not confirm itself");
        report(&shared, 2, CategoryKind::General, GENERAL, 7);
        assert_eq!(shared.confirmed(GENERAL), Some(7));
        report(&shared, 3, CategoryKind::General, GENERAL, 8);
        assert_eq!((shared.confirmed(GENERAL), shared.trust()), (None, Trust::None));
    }

    #[test]
    fn differing_names_end_the_sharing_of_names_alone() {
        let shared = SharedWords::default();
        let blocks = Blocks::new(&CHAIN, 4);
        assert!(shared.claim(StationAddress(1), &blocks).is_some());
        for by in [1, 2] {
            report(&shared, by, CategoryKind::General, GENERAL, 7);
            report(&shared, by, CategoryKind::Strings, NAMES, 1);
            report(&shared, by, CategoryKind::Strings, NAMES + 1, by);
        }
        assert_eq!((shared.confirmed(NAMES), shared.confirmed(GENERAL)), (None, Some(7)));
        assert_eq!(shared.trust(), Trust::AllButNames);
        let claimed = core::iter::from_fn(|| shared.claim(StationAddress(2), &blocks));
        assert!(claimed.into_iter().all(|block| block.kind == CategoryKind::General));
    }

    #[test]
    fn two_subdevices_read_each_block_from_the_last_one_on() {
        for (width, firsts) in [(4, [12, 4].as_slice()), (2, &[12, 10, 6, 4, 2])] {
            let shared = SharedWords::default();
            let blocks = Blocks::new(&CHAIN, width);
            let expected: Vec<u32> = firsts.iter().map(|at| HEADER_WORDS + at).collect();
            for (by, expected) in [(1, &expected), (2, &expected), (3, &Vec::new())] {
                let claimed = core::iter::from_fn(|| shared.claim(StationAddress(by), &blocks));
                assert_eq!(&claimed.map(|block| block.first).collect::<Vec<_>>(), expected);
            }
        }
    }
}
