//! Reading the SII of a SubDevice through its controller (facts 3.8, 4).
//!
//! A read is one command and, when the EEPROM was in time, one poll that brings the data along. How long the EEPROM
//! takes is learnt from the first reads. Only the categories that are needed are read, and where another SubDevice with
//! the same first 64 words was read before, only the category headers: the checksum of the SII covers 14 bytes and tells
//! nothing about the rest.

use alloc::rc::Rc;
use alloc::vec;
use alloc::vec::Vec;
use core::cell::{Cell, RefCell};
use core::fmt;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{SiiCommand, SiiControl, map};
use ringcat_wire::sii::{CategoryHeader, CategoryKind, Identity, SiiHeader};

use crate::supervisor::{Bus, BusError};
use crate::time::Instant;

/// How long an EEPROM may be busy with one command (facts 5.4: 20 ms are usual; emulated ones take longer).
const COMMAND_LIMIT: Duration = Duration::from_millis(100);
/// How long a controller may take to load its EEPROM after power-on.
const LOAD_LIMIT: Duration = Duration::from_millis(500);
/// Pause between polls while the time that the EEPROM takes is not known yet.
const POLL_PAUSE: Duration = Duration::from_micros(50);
/// A command that the EEPROM did not acknowledge is given again so often.
const RETRIES: usize = 3;
/// Categories of one SubDevice; real ones have about ten.
const MAX_CATEGORIES: usize = 256;
/// Words of the largest EEPROM that is followed: 64 KiB.
const MAX_WORDS: u32 = 0x8000;
/// Bytes of control, address and data registers in one poll with 8-byte reads.
const POLL_LEN: usize = 14;
/// Where vendor, product, revision and serial number lie.
const IDENTITY_WORD: u32 = 0x08;
/// Words before the categories.
const HEADER_WORDS: u32 = (SiiHeader::LEN / 2) as u32;

/// Why an SII cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SiiReadError {
    /// The bus failed.
    Bus(BusError),
    /// The EEPROM stayed busy.
    Busy {
        /// Word address.
        word: u32,
    },
    /// The EEPROM reported an error.
    Command {
        /// Word address.
        word: u32,
        /// What the control register said.
        control: SiiControl,
    },
}

impl fmt::Display for SiiReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SiiReadError::Bus(error) => error.fmt(f),
            SiiReadError::Busy { word } => write!(f, "EEPROM still busy with word {word:#06x} after 100 ms"),
            SiiReadError::Command { word, control } => {
                write!(f, "EEPROM error at word {word:#06x}: control register 0x0502 is {:#06x}", control.bits())
            }
        }
    }
}

impl core::error::Error for SiiReadError {}

impl From<BusError> for SiiReadError {
    fn from(error: BusError) -> SiiReadError {
        SiiReadError::Bus(error)
    }
}

/// What was read of an SII.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SiiContents {
    /// The first 64 words.
    pub header: SiiHeader,
    /// The categories that were wanted, with their data.
    pub categories: Vec<(CategoryKind, Vec<u8>)>,
    /// Whether the chain of categories ended as it should.
    pub complete: bool,
}

#[derive(Debug)]
struct Cached {
    header: [u8; SiiHeader::LEN],
    /// `None` while it is being read.
    read: Option<(Vec<CategoryHeader>, SiiContents)>,
}

/// SII contents of SubDevices that were read before.
#[derive(Clone, Debug)]
pub struct SiiCache {
    enabled: bool,
    entries: Rc<RefCell<Vec<Cached>>>,
    /// What the EEPROMs of this segment took so far, as a first guess for the next one.
    pace: Rc<Cell<Duration>>,
}

impl SiiCache {
    /// An empty cache; switched off it keeps nothing.
    pub fn new(enabled: bool) -> SiiCache {
        SiiCache { enabled, entries: Rc::default(), pace: Rc::new(Cell::new(Duration::ZERO)) }
    }

    fn claim(&self, header: &[u8; SiiHeader::LEN]) -> Claim {
        let mut entries = self.entries.borrow_mut();
        if !entries.iter().any(|entry| entry.header == *header) {
            entries.push(Cached { header: *header, read: None });
        }
        Claim { entries: self.entries.clone(), header: *header }
    }

    /// SII contents that are kept.
    pub fn len(&self) -> usize {
        self.entries.borrow().len()
    }

    /// Whether nothing is kept.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Somebody reads the SII with this header; whoever has the same one waits. Dropped, also with the procedure that
/// reads, the next one may try.
struct Claim {
    entries: Rc<RefCell<Vec<Cached>>>,
    header: [u8; SiiHeader::LEN],
}

impl Claim {
    fn settle(self, chain: Vec<CategoryHeader>, contents: SiiContents) {
        let mut entries = self.entries.borrow_mut();
        if let Some(entry) = entries.iter_mut().find(|entry| entry.header == self.header) {
            entry.read = Some((chain, contents));
        }
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        self.entries.borrow_mut().retain(|entry| entry.header != self.header || entry.read.is_some());
    }
}

/// Which categories the engine uses.
const fn is_needed(kind: CategoryKind) -> bool {
    matches!(
        kind,
        CategoryKind::Strings
            | CategoryKind::General
            | CategoryKind::Fmmu
            | CategoryKind::SyncManager
            | CategoryKind::TxPdo
            | CategoryKind::RxPdo
            | CategoryKind::Dc
    )
}

/// Reads the SII of one SubDevice.
pub struct SiiReader {
    bus: Bus,
    station: StationAddress,
    cache: SiiCache,
    /// How long after the command the first poll is sent.
    pace: Duration,
    eight_bytes: bool,
    /// Words read so far.
    words: Vec<Option<u16>>,
}

impl SiiReader {
    /// A reader for the SubDevice with this station address. The EEPROM must be assigned to EtherCAT.
    pub fn new(bus: &Bus, station: StationAddress, cache: &SiiCache) -> SiiReader {
        SiiReader {
            bus: bus.clone(),
            station,
            cache: cache.clone(),
            pace: cache.pace.get(),
            eight_bytes: true,
            words: Vec::new(),
        }
    }

    /// Reads the first 64 words and the categories that the engine uses.
    pub async fn read(&mut self) -> Result<SiiContents, SiiReadError> {
        self.wait_until_loaded().await?;
        let header: [u8; SiiHeader::LEN] = self.bytes(0, HEADER_WORDS).await?.try_into().unwrap_or([0; SiiHeader::LEN]);
        if !self.cache.enabled {
            return self.read_categories(&header).await.map(|(_, contents)| contents);
        }
        if let Some(contents) = self.known(&header).await? {
            return Ok(contents);
        }
        let claim = self.cache.claim(&header);
        let (chain, contents) = self.read_categories(&header).await?;
        claim.settle(chain, contents.clone());
        Ok(contents)
    }

    /// Reads vendor, product, revision and serial number.
    pub async fn identity(&mut self) -> Result<Identity, SiiReadError> {
        self.wait_until_loaded().await?;
        let bytes = self.bytes(IDENTITY_WORD, 8).await?;
        let field = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        Ok(Identity { vendor_id: field(0), product_code: field(4), revision: field(8), serial: field(12) })
    }

    /// Words that are not covered by the configuration of a scan, such as the alias; see [`SiiReader::read`].
    pub async fn bytes(&mut self, word: u32, count: u32) -> Result<Vec<u8>, SiiReadError> {
        let mut bytes = Vec::with_capacity(2 * count as usize);
        for word in word..word + count {
            let value = match self.words.get(word as usize) {
                Some(Some(value)) => *value,
                _ => self.fetch(word).await?,
            };
            bytes.extend_from_slice(&value.to_le_bytes());
        }
        Ok(bytes)
    }

    /// Contents of a SubDevice with the same first words, if the category headers are the same too. While another
    /// SubDevice's are being read, waits for them.
    async fn known(&mut self, header: &[u8; SiiHeader::LEN]) -> Result<Option<SiiContents>, SiiReadError> {
        loop {
            let found = {
                let entries = self.cache.entries.borrow();
                let Some(entry) = entries.iter().find(|entry| entry.header == *header) else { return Ok(None) };
                entry.read.clone()
            };
            let Some((chain, contents)) = found else {
                self.bus.sleep(Duration::from_millis(1)).await;
                continue;
            };
            let mut word = HEADER_WORDS;
            for expected in &chain {
                if self.category_header(word).await? != *expected {
                    return Ok(None);
                }
                word += 2 + u32::from(expected.words);
            }
            return Ok(Some(contents));
        }
    }

    async fn read_categories(
        &mut self,
        header: &[u8; SiiHeader::LEN],
    ) -> Result<(Vec<CategoryHeader>, SiiContents), SiiReadError> {
        let mut contents = SiiContents { header: SiiHeader::decode(header), categories: Vec::new(), complete: false };
        let mut chain = Vec::new();
        // An EEPROM that says nothing about its size is followed as far as any goes.
        let size = (contents.header.size_bytes() / 2) as u32;
        let end = size.clamp(HEADER_WORDS + 2, MAX_WORDS);
        let mut word = HEADER_WORDS;
        while word + 2 <= end && chain.len() < MAX_CATEGORIES {
            let category = self.category_header(word).await?;
            chain.push(category);
            if category.kind == CategoryKind::End {
                contents.complete = true;
                break;
            }
            let words = u32::from(category.words);
            word += 2;
            if word + words > end {
                break;
            }
            if is_needed(category.kind) {
                let data = self.bytes(word, words).await?;
                contents.categories.push((category.kind, data));
            }
            word += words;
        }
        // A chain that fills the EEPROM to its last word needs no end marker.
        contents.complete |= word == end;
        Ok((chain, contents))
    }

    async fn category_header(&mut self, word: u32) -> Result<CategoryHeader, SiiReadError> {
        let bytes = self.bytes(word, 2).await?;
        Ok(CategoryHeader::decode(&[bytes[0], bytes[1], bytes[2], bytes[3]]))
    }

    /// After power-on the controller is busy loading.
    async fn wait_until_loaded(&mut self) -> Result<(), SiiReadError> {
        let until = self.bus.now() + LOAD_LIMIT;
        loop {
            let control = SiiControl::decode(&self.bus.fprd_array(self.station, map::SII_CONTROL).await?);
            if !control.busy {
                self.eight_bytes = control.eight_byte_reads;
                return Ok(());
            }
            if self.bus.now() >= until {
                return Err(SiiReadError::Busy { word: 0 });
            }
            self.bus.sleep(Duration::from_millis(1)).await;
        }
    }

    /// Reads the 4 or 8 bytes that begin at a word.
    async fn fetch(&mut self, word: u32) -> Result<u16, SiiReadError> {
        let mut attempt = 0;
        loop {
            let (control, data) = self.execute(word).await?;
            if !control.command_error && !control.write_enable_error {
                return Ok(self.keep(word, data));
            }
            attempt += 1;
            if attempt > RETRIES {
                return Err(SiiReadError::Command { word, control });
            }
            // The idle command clears the error.
            let idle = SiiControl::request(SiiCommand::Idle).encode();
            self.bus.fpwr(self.station, map::SII_CONTROL, &idle).await?;
        }
    }

    fn keep(&mut self, word: u32, data: [u8; 8]) -> u16 {
        let count = if self.eight_bytes { 4 } else { 2 };
        let at = word as usize;
        if self.words.len() < at + count {
            self.words.resize(at + count, None);
        }
        for (slot, pair) in self.words[at..at + count].iter_mut().zip(data.as_chunks::<2>().0) {
            *slot = Some(u16::from_le_bytes(*pair));
        }
        u16::from_le_bytes([data[0], data[1]])
    }

    /// One read command and the polls until it is done.
    async fn execute(&mut self, word: u32) -> Result<(SiiControl, [u8; 8]), SiiReadError> {
        let mut command = [0; 6];
        command[..2].copy_from_slice(&SiiControl::request(SiiCommand::Read).encode());
        command[2..].copy_from_slice(&word.to_le_bytes());
        self.bus.fpwr(self.station, map::SII_CONTROL, &command).await?;
        let given = self.bus.now();
        let first = given + self.pace;
        self.bus.sleep_until(first).await;
        loop {
            let (control, data) = self.poll().await?;
            if !control.busy {
                return Ok((control, data));
            }
            self.learn(given);
            if self.bus.now().since(given) > COMMAND_LIMIT {
                return Err(SiiReadError::Busy { word });
            }
            self.bus.sleep(POLL_PAUSE).await;
        }
    }

    /// Still busy: the next first poll comes later.
    fn learn(&mut self, given: Instant) {
        let took = self.bus.now().since(given) + POLL_PAUSE;
        self.pace = self.pace.max(took).min(COMMAND_LIMIT);
        self.cache.pace.set(self.cache.pace.get().max(self.pace));
    }

    async fn poll(&self) -> Result<(SiiControl, [u8; 8]), SiiReadError> {
        let length = if self.eight_bytes { POLL_LEN } else { POLL_LEN - 4 };
        let bytes = self.bus.fprd(self.station, map::SII_CONTROL, length).await?;
        let mut data = [0; 8];
        data[..length - 6].copy_from_slice(&bytes[6..length]);
        Ok((SiiControl::decode(&[bytes[0], bytes[1]]), data))
    }
}

/// Written to `SII_CONFIGURATION`: takes the EEPROM from the PDI.
const FORCE: [u8; 1] = [0x02];
/// Written to `SII_CONFIGURATION`: the EEPROM is EtherCAT's.
const ETHERCAT: [u8; 1] = [0x00];

/// Takes the EEPROM of one SubDevice away from its PDI.
pub(super) async fn claim(bus: &Bus, station: StationAddress) -> Result<(), BusError> {
    bus.fpwr(station, map::SII_CONFIGURATION, &FORCE).await?;
    bus.fpwr(station, map::SII_CONFIGURATION, &ETHERCAT).await
}

/// Takes the EEPROMs of all SubDevices away from their PDI (facts 5.6).
pub(super) async fn claim_all(bus: &Bus) -> Result<(), BusError> {
    bus.bwr(map::SII_CONFIGURATION, &FORCE).await?;
    bus.bwr(map::SII_CONFIGURATION, &ETHERCAT).await?;
    Ok(())
}

/// Gives the EEPROM of a SubDevice to its PDI, or takes it back.
pub(super) async fn assign(bus: &Bus, station: StationAddress, to_pdi: bool) -> Result<(), BusError> {
    let target = Target::Station(station, map::SII_CONFIGURATION);
    bus.transfer(Command::Fpwr, target, vec![u8::from(to_pdi)], None).await.map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reader_that_goes_away_ends_its_claim_and_one_that_ends_keeps_what_it_read() {
        let cache = SiiCache::new(true);
        let header = [1; SiiHeader::LEN];
        drop(cache.claim(&header));
        assert!(cache.is_empty());
        let contents = SiiContents { header: SiiHeader::decode(&header), categories: Vec::new(), complete: true };
        cache.claim(&header).settle(Vec::new(), contents);
        assert_eq!(cache.len(), 1);
        drop(cache.claim(&header));
        assert_eq!(cache.len(), 1, "another reader of the same");
    }
}
