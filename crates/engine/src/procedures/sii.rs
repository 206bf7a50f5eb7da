//! Reads the SII of a SubDevice through its controller (protocol 3.8, 4).
//!
//! Only the words of the fixed area and the categories of an extent are read. If another SubDevice with the same fixed
//! area was read before, only the category headers are read. If others are being read, they share the rest.
//! Nothing is shared with SubDevices without a vendor id.

mod cache;
mod contents;
mod eeprom;
mod error;
mod extents;
pub mod images;
mod pace;
pub mod program;
mod shared_words;
mod turns;

use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::map;
use ringcat_wire::sii::{CategoryHeader, CategoryKind, Identity, SiiHeader};

pub use cache::SiiCache;
use cache::{FixedArea, Found};
use contents::HEADER_WORDS;
pub use contents::{ChainEnd, SiiContents};
use eeprom::Eeprom;
pub use error::SiiReadError;
use pace::Pace;
use shared_words::{Blocks, SharedWords};
pub use turns::EepromTurns;

use crate::info::SiiExtent;
use crate::supervisor::{Bus, BusError};

/// Categories of one SubDevice; real ones have about ten.
const MAX_CATEGORIES: usize = 256;
/// Words of the largest supported EEPROM: 64 KiB.
const MAX_WORDS: u32 = 0x8000;
/// First word of vendor, product, revision and serial number.
const IDENTITY_WORD: u32 = 0x08;
/// Value of an EEPROM that was never written, or behind its end.
const ERASED: u8 = 0xFF;
/// Interval of the check whether another procedure has read the same SII.
const CACHE_PAUSE: Duration = Duration::from_micros(500);

/// Reads the SII of one SubDevice, which must be assigned to EtherCAT: the fixed area and the categories of an extent.
pub(super) async fn read(
    bus: &Bus,
    station: StationAddress,
    cache: &SiiCache,
    extent: SiiExtent,
) -> Result<SiiContents, SiiReadError> {
    let mut eeprom = Eeprom::open(bus, station, Pace::guess(cache.pace())).await?;
    let area = fixed_area(&mut eeprom, extent).await?;
    cache.teach(eeprom.pace.learnt());
    if !cache.enabled || !SiiHeader::decode(&area).identity.names_a_type() {
        return categories(&mut eeprom, &area, extent, Data::Own).await.map(|(_, contents)| contents);
    }
    let mut own_chain = None;
    loop {
        match cache.find(&area, extent, station) {
            Found::Nothing(claim) => {
                let words = claim.words();
                let (chain, contents) = loop {
                    let trust = words.trust();
                    let read = categories(&mut eeprom, &area, extent, Data::Shared(&words)).await?;
                    if !words.suit(&read.0) {
                        break categories(&mut eeprom, &area, extent, Data::Own).await?;
                    }
                    // Trust only decreases, so this ends.
                    if words.trust() == trust {
                        break read;
                    }
                };
                claim.settle(chain, contents.clone());
                return Ok(contents);
            }
            Found::BeingRead(words) => match &own_chain {
                None => own_chain = Some(own_headers(&mut eeprom, &area, extent).await?),
                Some(_) if bus.now() >= eeprom.until() => return Err(SiiReadError::TooSlow { word: HEADER_WORDS }),
                Some(own) => {
                    help(&mut eeprom, own, extent, &words).await;
                    bus.sleep(CACHE_PAUSE).await;
                }
            },
            Found::Contents(..) if own_chain.is_none() => {
                own_chain = Some(own_headers(&mut eeprom, &area, extent).await?);
            }
            Found::Contents(chain, contents) if own_chain.as_ref().is_some_and(|own| own.0 == chain) => {
                return Ok(contents);
            }
            // The SubDevice has another identity than its fixed area.
            Found::Contents(..) | Found::Disputed => {
                return categories(&mut eeprom, &area, extent, Data::Own).await.map(|(_, contents)| contents);
            }
        }
    }
}

/// Reads the fixed area.
async fn fixed_area(eeprom: &mut Eeprom, extent: SiiExtent) -> Result<FixedArea, SiiReadError> {
    let ranges = extents::fixed_area(extent);
    let mut area: FixedArea = [0; SiiHeader::LEN];
    for (number, (first, count)) in ranges.iter().copied().enumerate() {
        let then = ranges.get(number + 1).map_or(HEADER_WORDS, |(first, _)| *first);
        let bytes = eeprom.bytes(first, count, Some(then)).await?;
        let at = bytes_before(first);
        if number == 0 {
            area[..bytes_before(extents::LAST_FIXED)].fill(bytes[0]);
        }
        area[at..at + bytes.len()].copy_from_slice(&bytes);
    }
    Ok(area)
}

/// The chain of categories, and its end.
type Headers = (Vec<CategoryHeader>, ChainEnd);

async fn own_headers(eeprom: &mut Eeprom, area: &FixedArea, extent: SiiExtent) -> Result<Headers, SiiReadError> {
    let (chain, contents) = categories(eeprom, area, extent, Data::Headers).await?;
    Ok((chain, contents.end))
}

/// Reads words of others with the same fixed area, as long as there are any that too few SubDevices read. An EEPROM
/// that fails does not help; its own data is not needed yet.
async fn help(eeprom: &mut Eeprom, (chain, end): &Headers, extent: SiiExtent, words: &SharedWords) {
    if !matches!(end, ChainEnd::Sound { .. }) {
        return;
    }
    let blocks = Blocks::new(chain, extent, eeprom.width());
    let mut next = words.claim(eeprom.station(), &blocks);
    while let Some(block) = next {
        next = words.claim(eeprom.station(), &blocks);
        let ahead = next.map(|next| next.first);
        if eeprom.bytes(block.first, block.count, ahead).await.is_err() {
            return;
        }
        words.report(eeprom.station(), blocks.before(&block), eeprom.own_words(block.first, block.count));
    }
}

/// Which data of the categories is read.
#[derive(Clone, Copy)]
enum Data<'a> {
    /// The headers alone.
    Headers,
    /// Headers, and data of the categories of the extent, all from this EEPROM.
    Own,
    /// The same, but data that two others have returned is not read again.
    Shared(&'a SharedWords),
}

impl Data<'_> {
    /// Words of the last category of a chain: the first one, and their number. `then` is read ahead.
    async fn read(
        self,
        eeprom: &mut Eeprom,
        chain: &[CategoryHeader],
        (first, count): (u32, u32),
        then: Option<u32>,
    ) -> Result<Option<Vec<u8>>, SiiReadError> {
        match self {
            Data::Headers => Ok(None),
            Data::Own => eeprom.bytes(first, count, then).await.map(Some),
            Data::Shared(shared) => {
                let data = eeprom.bytes_with(first, count, then, |word| shared.confirmed(chain, word)).await?;
                shared.report(eeprom.station(), chain, eeprom.own_words(first, count));
                Ok(Some(data))
            }
        }
    }
}

/// Reads vendor, product, revision and serial number.
pub(super) async fn identity(bus: &Bus, station: StationAddress, cache: &SiiCache) -> Result<Identity, SiiReadError> {
    let mut eeprom = Eeprom::open(bus, station, Pace::guess(cache.pace())).await?;
    let bytes = eeprom.bytes(IDENTITY_WORD, 8, None).await?;
    let field = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
    Ok(Identity { vendor_id: field(0), product_code: field(4), revision: field(8), serial: field(12) })
}

/// Follows the chain of categories, and reads the data of those of the extent.
async fn categories(
    eeprom: &mut Eeprom,
    area: &FixedArea,
    extent: SiiExtent,
    data: Data<'_>,
) -> Result<(Vec<CategoryHeader>, SiiContents), SiiReadError> {
    let header = SiiHeader::decode(area);
    let open = ChainEnd::Open { at: bytes_before(HEADER_WORDS) };
    let mut contents = SiiContents { header, extent, categories: Vec::new(), has_more: false, end: open };
    let mut chain = Vec::new();
    // An EEPROM without a size is followed up to the largest size.
    let size = (contents.header.size_bytes() / 2) as u32;
    let mut end = size.clamp(HEADER_WORDS + 2, MAX_WORDS);
    let mut is_behind_size = false;
    let mut word = HEADER_WORDS;
    while word + 2 <= end && chain.len() < MAX_CATEGORIES {
        let bytes = eeprom.bytes(word, 2, None).await?;
        let category = CategoryHeader::decode(&[bytes[0], bytes[1], bytes[2], bytes[3]]);
        chain.push(category);
        let at = bytes_before(word);
        if category.kind == CategoryKind::End {
            contents.end = if is_behind_size { ChainEnd::BehindSize { at } } else { ChainEnd::Sound { at } };
            return Ok((chain, contents));
        }
        let words = u32::from(category.words);
        word += 2;
        if word + words > end && goes_on(eeprom, end, word + words).await? {
            (end, is_behind_size) = (MAX_WORDS, true);
        }
        if word + words > end {
            let (announced, left) = (category.data_len(), bytes_before(end - word));
            contents.end = ChainEnd::Beyond { kind: category.kind, at, announced, left };
            return Ok((chain, contents));
        }
        contents.has_more |= SiiExtent::Complete.contains(category.kind) && !extent.contains(category.kind);
        if extent.contains(category.kind) {
            let used = extents::words_of(extent, category.kind).min(words);
            let next = word + words;
            let then = (next + 2 <= end && chain.len() < MAX_CATEGORIES).then_some(next);
            let data = data.read(eeprom, &chain, (word, used), then).await?;
            contents.categories.extend(data.map(|mut data| {
                data.resize(bytes_before(words), 0);
                (category.kind, at, data)
            }));
        }
        word += words;
    }
    // A chain that fills the EEPROM to its last word needs no end marker, but zeros are not a chain.
    let at = bytes_before(word);
    let is_zero = chain.last().is_some_and(|last: &CategoryHeader| last.kind == CategoryKind::Nop && last.words == 0);
    contents.end = if word == end && !is_zero { ChainEnd::Sound { at } } else { ChainEnd::Open { at } };
    Ok((chain, contents))
}

/// Whether the last words before this one are written, though the size word contains a smaller size. Other MainDevices
/// (IgH, SOEM) ignore the size word.
async fn goes_on(eeprom: &mut Eeprom, end: u32, behind: u32) -> Result<bool, SiiReadError> {
    let first = end.max(behind.saturating_sub(2));
    Ok(behind <= MAX_WORDS && eeprom.bytes(first, behind - first, None).await?.iter().any(|byte| *byte != ERASED))
}

/// Byte at which a word begins.
const fn bytes_before(word: u32) -> usize {
    2 * word as usize
}

/// Written to `SII_CONFIGURATION`: takes the EEPROM from the PDI.
pub(super) const FORCE: [u8; 1] = [0x02];
/// Written to `SII_CONFIGURATION`: assigns the EEPROM to EtherCAT.
pub(super) const ETHERCAT: [u8; 1] = [0x00];

/// Takes the EEPROM of one SubDevice from its PDI (protocol 5.6).
pub(super) async fn claim(bus: &Bus, station: StationAddress) -> Result<(), BusError> {
    bus.fpwr(station, map::SII_CONFIGURATION, &FORCE).await?;
    bus.fpwr(station, map::SII_CONFIGURATION, &ETHERCAT).await
}

/// Assigns the EEPROM of a SubDevice to its PDI, or back to EtherCAT.
pub(super) async fn assign(bus: &Bus, station: StationAddress, to_pdi: bool) -> Result<(), BusError> {
    let target = Target::Station(station, map::SII_CONFIGURATION);
    bus.transfer(Command::Fpwr, target, alloc::vec![u8::from(to_pdi)], None).await.map(drop)
}
