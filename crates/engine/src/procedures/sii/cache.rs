//! SII contents that were read before, for SubDevices with the same fixed area and the same category headers.
//!
//! The checksum of the SII covers 14 bytes and tells nothing about the rest, so that equal headers are asked for.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::{Cell, RefCell};
use core::time::Duration;

use ringcat_wire::sii::{CategoryHeader, SiiHeader};

use super::SiiContents;

/// Kinds of SubDevices that are kept, more than a segment has; beyond, the oldest is forgotten.
const MAX_ENTRIES: usize = 1024;

/// The fixed area as far as it is read, zero elsewhere.
pub(super) type FixedArea = [u8; SiiHeader::LEN];

#[derive(Debug)]
struct Entry {
    area: FixedArea,
    /// `None` while it is being read.
    read: Option<(Vec<CategoryHeader>, SiiContents)>,
}

/// What the cache has for a fixed area.
pub(super) enum Found {
    /// Nobody has read it; whoever holds the claim does.
    Nothing(Claim),
    /// Somebody reads it now.
    BeingRead,
    /// It was read, with these category headers.
    Contents(Vec<CategoryHeader>, SiiContents),
}

/// SII contents of SubDevices that were read before.
#[derive(Clone, Debug)]
pub struct SiiCache {
    pub(super) enabled: bool,
    entries: Rc<RefCell<Vec<Entry>>>,
    /// The time of a command of the quickest EEPROM so far, as a first guess for the next one.
    pace: Rc<Cell<Option<Duration>>>,
}

impl SiiCache {
    /// An empty cache; switched off it keeps nothing.
    pub fn new(enabled: bool) -> SiiCache {
        SiiCache { enabled, entries: Rc::default(), pace: Rc::default() }
    }

    /// SII contents that are kept.
    pub fn len(&self) -> usize {
        self.entries.borrow().len()
    }

    /// Whether nothing is kept.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Forgets everything: an EEPROM was written.
    pub fn clear(&self) {
        self.entries.borrow_mut().retain(|entry| entry.read.is_none());
    }

    /// What there is, or the right to read it.
    pub(super) fn find(&self, area: &FixedArea) -> Found {
        let mut entries = self.entries.borrow_mut();
        match entries.iter().find(|entry| entry.area == *area) {
            Some(Entry { read: Some((chain, contents)), .. }) => Found::Contents(chain.clone(), contents.clone()),
            Some(Entry { read: None, .. }) => Found::BeingRead,
            None => {
                if entries.len() >= MAX_ENTRIES {
                    entries.remove(0);
                }
                entries.push(Entry { area: *area, read: None });
                Found::Nothing(Claim { entries: self.entries.clone(), area: *area })
            }
        }
    }

    /// The first guess for another EEPROM.
    pub(super) fn pace(&self) -> Option<Duration> {
        self.pace.get()
    }

    /// One slow EEPROM must not make the others slow: the quickest counts.
    pub(super) fn teach(&self, learnt: Option<Duration>) {
        if let Some(learnt) = learnt {
            self.pace.set(Some(self.pace.get().map_or(learnt, |known| known.min(learnt))));
        }
    }
}

/// Somebody reads the SII with this fixed area; whoever has the same one waits. Dropped, also with the procedure that
/// reads, the next one may try.
pub(super) struct Claim {
    entries: Rc<RefCell<Vec<Entry>>>,
    area: FixedArea,
}

impl Claim {
    pub(super) fn settle(self, chain: Vec<CategoryHeader>, contents: SiiContents) {
        let mut entries = self.entries.borrow_mut();
        if let Some(entry) = entries.iter_mut().find(|entry| entry.area == self.area) {
            entry.read = Some((chain, contents));
        }
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        self.entries.borrow_mut().retain(|entry| entry.area != self.area || entry.read.is_some());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::procedures::sii::ChainEnd;

    fn area(number: usize) -> FixedArea {
        let mut area = [0; SiiHeader::LEN];
        area[..8].copy_from_slice(&(number as u64).to_le_bytes());
        area
    }

    fn contents(area: &FixedArea) -> SiiContents {
        SiiContents { header: SiiHeader::decode(area), categories: Vec::new(), end: ChainEnd::Sound { at: area.len() } }
    }

    fn claim(cache: &SiiCache, area: &FixedArea) -> Option<Claim> {
        match cache.find(area) {
            Found::Nothing(claim) => Some(claim),
            Found::BeingRead | Found::Contents(..) => None,
        }
    }

    #[test]
    fn a_reader_that_goes_away_ends_its_claim_and_one_that_ends_keeps_what_it_read() {
        let cache = SiiCache::new(true);
        let first = claim(&cache, &area(1)).expect("nobody reads");
        assert!(claim(&cache, &area(1)).is_none(), "somebody does");
        drop(first);
        assert!(cache.is_empty());
        claim(&cache, &area(1)).expect("free again").settle(Vec::new(), contents(&area(1)));
        assert!(matches!(cache.find(&area(1)), Found::Contents(..)));
        assert_eq!(cache.len(), 1);
    }

    #[test]
    fn the_cache_is_bounded() {
        let cache = SiiCache::new(true);
        for number in 0..2 * MAX_ENTRIES {
            claim(&cache, &area(number)).expect("another one").settle(Vec::new(), contents(&area(number)));
        }
        assert_eq!(cache.len(), MAX_ENTRIES);
    }

    #[test]
    fn the_quickest_eeprom_is_the_guess_for_others() {
        let cache = SiiCache::new(true);
        cache.teach(Some(Duration::from_micros(550)));
        cache.teach(Some(Duration::from_millis(5)));
        cache.teach(None);
        assert_eq!(cache.pace(), Some(Duration::from_micros(550)));
    }
}
