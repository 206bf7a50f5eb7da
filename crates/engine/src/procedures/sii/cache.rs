//! SII contents read before, for SubDevices with the same fixed area and the same category headers.
//!
//! The checksum of the SII covers only 14 bytes. Therefore the category headers must be equal too, and two SubDevices
//! must have been read with equal contents before the cache is used for others: one bad EEPROM must not affect another
//! SubDevice. If two differ, every SubDevice is read.

mod handover;

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::{Cell, RefCell};
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::sii::{CategoryHeader, CategoryKind, SiiHeader};

use super::contents::SiiContents;
use super::shared_words::SharedWords;
use crate::info::SiiExtent;

/// Entries of the cache, more than a segment has types of SubDevices; beyond this the oldest entry is removed.
const MAX_ENTRIES: usize = 1024;

/// The fixed area as far as it is read, zero elsewhere.
pub(super) type FixedArea = [u8; SiiHeader::LEN];

/// Data read from a SubDevice.
type Read = (Vec<CategoryHeader>, SiiContents);

/// Whether two contents are equal except for names, which have no effect.
fn agree(one: &Read, other: &Read) -> bool {
    let facts = |read: &Read| {
        let categories = read.1.categories.iter().filter(|(kind, ..)| *kind != CategoryKind::Strings);
        categories.cloned().collect::<Vec<_>>()
    };
    one.0 == other.0 && one.1.end == other.1.end && facts(one) == facts(other)
}

/// Knowledge about a fixed area.
#[derive(Debug)]
enum Known {
    /// One SubDevice was read, or some are being read; the number of readers.
    Once { read: Option<(StationAddress, Read)>, readers: usize },
    /// Two were read with equal contents.
    Twice(Read),
    /// Two differ.
    Disputed,
}

#[derive(Debug)]
struct Entry {
    area: FixedArea,
    /// What its readers read of the categories.
    extent: SiiExtent,
    known: Known,
    words: SharedWords,
}

/// The cache's entry for a fixed area.
pub(super) enum Found {
    /// Too few have been read; the procedure with the claim reads its own.
    Nothing(Claim),
    /// Other procedures are reading it, and these words have been returned.
    BeingRead(SharedWords),
    /// Two equal contents were read, with these category headers.
    Contents(Vec<CategoryHeader>, SiiContents),
    /// SubDevices with it differ.
    Disputed,
}

/// SII contents of SubDevices that were read before.
#[derive(Clone, Debug)]
pub struct SiiCache {
    pub(super) enabled: bool,
    entries: Rc<RefCell<Vec<Entry>>>,
    /// The time of a command of the fastest EEPROM so far, as a first estimate for the next one.
    pace: Rc<Cell<Option<Duration>>>,
}

impl Entry {
    fn is_of(&self, area: &FixedArea, extent: SiiExtent) -> bool {
        self.area == *area && self.extent == extent
    }
}

impl SiiCache {
    /// An empty cache; a disabled one stores nothing.
    pub fn new(enabled: bool) -> SiiCache {
        SiiCache { enabled, entries: Rc::default(), pace: Rc::default() }
    }

    /// Clears the cache: an EEPROM was written.
    pub fn clear(&self) {
        self.entries.borrow_mut().retain(|entry| matches!(entry.known, Known::Once { read: None, .. }));
    }

    /// The stored contents of this extent, or the right to read them for the SubDevice with this address.
    pub(super) fn find(&self, area: &FixedArea, extent: SiiExtent, station: StationAddress) -> Found {
        /// Concurrent readers: as many as have to agree.
        const READERS: usize = 2;
        let claim = |words| Claim { entries: self.entries.clone(), area: *area, extent, station, words };
        let mut entries = self.entries.borrow_mut();
        let Some(Entry { known, words, .. }) = entries.iter_mut().find(|entry| entry.is_of(area, extent)) else {
            if entries.len() >= MAX_ENTRIES {
                entries.remove(0);
            }
            let words = SharedWords::default();
            let known = Known::Once { read: None, readers: 1 };
            entries.push(Entry { area: *area, extent, known, words: words.clone() });
            return Found::Nothing(claim(words));
        };
        match known {
            Known::Twice((chain, contents)) => Found::Contents(chain.clone(), contents.clone()),
            Known::Disputed => Found::Disputed,
            Known::Once { read, readers } if *readers + usize::from(read.is_some()) < READERS => {
                *readers += 1;
                Found::Nothing(claim(words.clone()))
            }
            Known::Once { .. } => Found::BeingRead(words.clone()),
        }
    }

    /// The first estimate for another EEPROM.
    pub(super) fn pace(&self) -> Option<Duration> {
        self.pace.get()
    }

    /// The fastest EEPROM counts: a slow one must not delay the others.
    pub(super) fn teach(&self, learnt: Option<Duration>) {
        if let Some(learnt) = learnt {
            self.pace.set(Some(self.pace.get().map_or(learnt, |known| known.min(learnt))));
        }
    }
}

/// The right to read an SII with this fixed area; further SubDevices with the same area wait. When it is dropped, also
/// together with its procedure, another procedure may read.
pub(super) struct Claim {
    entries: Rc<RefCell<Vec<Entry>>>,
    area: FixedArea,
    extent: SiiExtent,
    station: StationAddress,
    words: SharedWords,
}

impl Claim {
    /// The words that SubDevices with this fixed area have returned.
    pub(super) fn words(&self) -> SharedWords {
        self.words.clone()
    }

    pub(super) fn settle(self, chain: Vec<CategoryHeader>, contents: SiiContents) {
        let mut entries = self.entries.borrow_mut();
        let Some(entry) = entries.iter_mut().find(|entry| entry.is_of(&self.area, self.extent)) else { return };
        let now = (chain, contents);
        let next = match &entry.known {
            Known::Once { read: Some((station, read)), .. } if *station != self.station => {
                if agree(read, &now) {
                    Known::Twice(now)
                } else {
                    Known::Disputed
                }
            }
            // The reader is counted until the claim is dropped.
            Known::Once { readers, .. } => Known::Once { read: Some((self.station, now)), readers: *readers },
            Known::Twice(_) | Known::Disputed => return,
        };
        if !matches!(next, Known::Once { .. }) {
            entry.words = SharedWords::default();
        }
        entry.known = next;
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        self.entries.borrow_mut().retain_mut(|entry| match &mut entry.known {
            Known::Once { read, readers } if entry.area == self.area && entry.extent == self.extent => {
                *readers = readers.saturating_sub(1);
                if *readers == 0 {
                    entry.words = SharedWords::default();
                }
                read.is_some() || *readers > 0
            }
            _ => true,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::procedures::sii::contents::ChainEnd;

    fn area(number: usize) -> FixedArea {
        let mut area = [0; SiiHeader::LEN];
        area[..8].copy_from_slice(&(number as u64).to_le_bytes());
        area
    }

    fn contents(area: &FixedArea) -> SiiContents {
        let end = ChainEnd::Sound { at: area.len() };
        let (header, extent) = (SiiHeader::decode(area), SiiExtent::Complete);
        SiiContents { header, extent, categories: Vec::new(), has_more: false, end }
    }

    fn claim(cache: &SiiCache, area: &FixedArea, station: u16) -> Option<Claim> {
        match cache.find(area, SiiExtent::Complete, StationAddress(station)) {
            Found::Nothing(claim) => Some(claim),
            Found::BeingRead(_) | Found::Contents(..) | Found::Disputed => None,
        }
    }

    #[test]
    fn after_two_equal_contents_further_subdevices_use_the_cache() {
        let cache = SiiCache::new(true);
        let claims = [1, 2].map(|station| claim(&cache, &area(1), station).expect("two may read"));
        assert!(claim(&cache, &area(1), 3).is_none(), "two do");
        drop(claims);
        assert!(cache.entries.borrow().is_empty(), "both have gone away");
        for station in [1, 2] {
            claim(&cache, &area(1), station).expect("free again").settle(Vec::new(), contents(&area(1)));
        }
        assert!(matches!(cache.find(&area(1), SiiExtent::Complete, StationAddress(3)), Found::Contents(..)));
        assert_eq!(cache.entries.borrow().len(), 1);
    }

    #[test]
    fn one_subdevice_does_not_confirm_itself_and_differing_ones_are_both_read() {
        let cache = SiiCache::new(true);
        for _ in 0..3 {
            claim(&cache, &area(1), 1).expect("one is not enough").settle(Vec::new(), contents(&area(1)));
        }
        let other = SiiContents { end: ChainEnd::Unreadable, ..contents(&area(1)) };
        claim(&cache, &area(1), 2).expect("another one").settle(Vec::new(), other);
        assert!(matches!(cache.find(&area(1), SiiExtent::Complete, StationAddress(3)), Found::Disputed));
    }

    #[test]
    fn the_cache_is_bounded() {
        let cache = SiiCache::new(true);
        for number in 0..2 * MAX_ENTRIES {
            claim(&cache, &area(number), 1).expect("another one").settle(Vec::new(), contents(&area(number)));
        }
        assert_eq!(cache.entries.borrow().len(), MAX_ENTRIES);
    }

    #[test]
    fn the_fastest_eeprom_is_the_estimate_for_others() {
        let cache = SiiCache::new(true);
        cache.teach(Some(Duration::from_micros(550)));
        cache.teach(Some(Duration::from_millis(5)));
        cache.teach(None);
        assert_eq!(cache.pace(), Some(Duration::from_micros(550)));
    }
}
