//! Knowledge of a MainDevice about its segment, as plain data and as bytes: for another process that goes on with it.
//!
//! Out: [`MainDevice::knowledge`](crate::main_device::MainDevice::knowledge) and [`Knowledge::to_bytes`]. In:
//! [`Knowledge::from_bytes`] and [`MainDevice::resume`](crate::main_device::MainDevice::resume). The bytes have a
//! header with version and checksum (decision 0061). Any bytes are allowed: they are checked as a whole, and memory is
//! bounded by their length. Whether the segment is still as known is left to `resume`.

mod clocks;
mod code;
mod dictionary;
mod error;
mod subdevice;
mod topology;

use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;
use ringcat_wire::al::AlState;
use ringcat_wire::sii::{CategoryKind, SiiHeader};

use crate::clocks::KnownClocks;
use crate::info::{KnownDictionary, SiiExtent, SubDeviceInfo};
use crate::order::InOrder;
use crate::ring::RingState;
use crate::topology::Topology;
use code::{Code, Input, choice, fields};
pub use error::KnowledgeError;

/// First bytes.
const MAGIC: [u8; 8] = *b"RingCAT\0";
/// Version of the form of the bytes. Bytes of other versions are refused: the reader scans.
const VERSION: u16 = 5;
/// Bytes of magic, version, length and checksum.
const HEADER: usize = 8 + 2 + 4 + 8;
/// Bytes of a SubDevice, as a first estimate.
const USUAL: usize = 768;
/// Largest number of SubDevices: all station addresses.
const MOST_SUBDEVICES: usize = 0x1_0000;
/// Highest mailbox counter (protocol 6.1).
const HIGHEST_COUNTER: u8 = 7;

/// Whether the last owner of the segment has handed its knowledge over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Handover {
    /// The knowledge is the last of the former owner, which sends nothing any more: counters and sequence numbers go
    /// on.
    Orderly,
    /// The former owner crashed after it had written the knowledge: its counters are stale. The first mail of each
    /// mailbox has counter 0, and frames get sequence numbers of another epoch.
    AfterCrash,
}

/// Knowledge of a MainDevice about its segment.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Knowledge {
    /// The SubDevices of the last scan by position, as it was followed.
    pub subdevices: Vec<KnownSubDevice>,
    /// Other SubDevices that have a station address of this MainDevice: they came while an application was active.
    pub others: Vec<KnownSubDevice>,
    /// Connections of the SubDevices of the last scan.
    pub topology: Topology,
    /// Number of SubDevices that the main copy passed.
    pub main_count: usize,
    /// State of the ring.
    pub ring: RingState,
    /// Sequence number of the last acyclic frame, 15 bits.
    pub(crate) sequence: u16,
    /// The temporary station address that was given last.
    pub(crate) offered: StationAddress,
    /// Number of activations so far: it decides about logical addresses.
    pub(crate) activations: u32,
    /// SII contents read before.
    pub(crate) siis: Vec<KnownSii>,
    /// Object dictionaries by type of SubDevice.
    pub(crate) dictionaries: Vec<KnownDictionary>,
    /// Delays, drifts and cable times, if the clocks were set up.
    pub(crate) clocks: Option<KnownClocks>,
}

/// What is known of one SubDevice.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct KnownSubDevice {
    /// Registers and SII, with the PDOs that were read from its dictionary.
    pub info: SubDeviceInfo,
    /// The state that it is to have without an application.
    pub target: AlState,
    /// How far it is on the way to this state.
    pub progress: KnownProgress,
    /// Its mailbox, if it is in use.
    pub mailbox: Option<KnownMailbox>,
}

/// How far a SubDevice is on the way to its state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum KnownProgress {
    /// Nothing is requested of it.
    None,
    /// It is to be brought to its state.
    Due,
    /// It has reached its state.
    Reached,
    /// Its state was forced, and it is left as it is.
    Left,
}

/// Counters of a mailbox in use, and answers that may still arrive.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct KnownMailbox {
    /// Counter of the last message sent, 0 to 7.
    pub counter: u8,
    /// A read may be lost: its mail must be requested again.
    pub(crate) repeat: bool,
    /// Counter and hash of the last accepted mails, newest first.
    pub(crate) recent: Vec<(u8, u64)>,
    /// Requests that may still be answered.
    pub(crate) late: Vec<LateAnswer>,
    /// Lanes with a conversation under way.
    pub(crate) under_way: Vec<u8>,
}

/// A request of the former owner that may still be answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LateAnswer {
    /// Its lane.
    pub lane: u8,
    /// Mark of the request.
    pub mark: u16,
    /// Time limit of the answer in milliseconds.
    pub limit_ms: u32,
}

/// The content of an SII that was read before.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct KnownSii {
    /// The fixed area.
    pub area: [u8; SiiHeader::LEN],
    pub extent: SiiExtent,
    pub standing: Standing,
}

/// How many SubDevices have returned it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Standing {
    Once { station: StationAddress, content: KnownContent },
    Twice { content: KnownContent },
    Disputed,
}

/// The categories of an SII.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct KnownContent {
    /// Type and words of each category.
    pub chain: Vec<(CategoryKind, u16)>,
    /// The categories that were read.
    pub categories: Vec<KnownCategory>,
    pub has_more: bool,
    pub end: KnownEnd,
}

/// A category that was read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct KnownCategory {
    pub kind: CategoryKind,
    /// Byte address of its header.
    pub at: usize,
    pub data: Vec<u8>,
}

/// The end of a chain of categories.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum KnownEnd {
    Sound { at: usize },
    BehindSize { at: usize },
    Open { at: usize },
    Beyond { kind: CategoryKind, at: usize, announced: usize, left: usize },
    Unreadable,
}

fields!(KnownMailbox {
    counter: u8,
    repeat: bool,
    recent: Vec<(u8, u64)>,
    late: Vec<LateAnswer>,
    under_way: Vec<u8>,
});
fields!(LateAnswer { lane: u8, mark: u16, limit_ms: u32 });
fields!(KnownSubDevice {
    info: SubDeviceInfo,
    target: AlState,
    progress: KnownProgress,
    mailbox: Option<KnownMailbox>,
});
fields!(KnownSii { area: [u8; SiiHeader::LEN], extent: SiiExtent, standing: Standing });
fields!(KnownContent {
    chain: Vec<(CategoryKind, u16)>,
    categories: Vec<KnownCategory>,
    has_more: bool,
    end: KnownEnd,
});
fields!(KnownCategory { kind: CategoryKind, at: usize, data: Vec<u8> });
choice!(AlState, "an AL state" { 1 = Init, 2 = PreOp, 3 = Boot, 4 = SafeOp, 8 = Op });
choice!(KnownProgress, "a progress" { 0 = None, 1 = Due, 2 = Reached, 3 = Left });
choice!(RingState, "a state of the ring" { 0 = Unknown, 1 = Closed, 2 = Open });
choice!(Standing, "the standing of an SII" {
    0 = Once { station: StationAddress, content: KnownContent },
    1 = Twice { content: KnownContent },
    2 = Disputed,
});
choice!(KnownEnd, "the end of a chain of categories" {
    0 = Sound { at: usize },
    1 = BehindSize { at: usize },
    2 = Open { at: usize },
    3 = Beyond { kind: CategoryKind, at: usize, announced: usize, left: usize },
    4 = Unreadable,
});

impl Knowledge {
    /// The knowledge as bytes. They are for the same version of the library: others refuse them.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(HEADER + USUAL * (self.subdevices.len() + 1));
        out.resize(HEADER, 0);
        self.ring.put(&mut out);
        self.sequence.put(&mut out);
        self.offered.put(&mut out);
        self.activations.put(&mut out);
        self.subdevices.put(&mut out);
        self.main_count.put(&mut out);
        self.topology.put(&mut out);
        self.others.put(&mut out);
        self.siis.put(&mut out);
        self.dictionaries.put(&mut out);
        self.clocks.put(&mut out);
        write_header(&mut out);
        out
    }

    /// Takes the knowledge from bytes, which may be any. Memory is at most 32 times their length, and some 100 bytes.
    ///
    /// # Errors
    /// The bytes are of another version or changed, too short or too long, or something in them cannot be.
    pub fn from_bytes(bytes: &[u8]) -> Result<Knowledge, KnowledgeError> {
        let input = &mut open(bytes)?;
        let ring = RingState::take(input)?;
        let sequence = u16::take(input)?;
        let offered = StationAddress::take(input)?;
        let activations = u32::take(input)?;
        let subdevices = take_subdevices(input)?;
        let counted = input.expected("no more SubDevices on the main link than are known");
        let main_count = usize::take(input)?;
        if main_count > subdevices.len() {
            return Err(counted);
        }
        let topology = topology::take_checked(input, subdevices.len())?;
        let stations = input.expected("a station address of its own for each SubDevice");
        let others = take_subdevices(input)?;
        let siis = Vec::take(input)?;
        let dictionaries = Vec::take(input)?;
        let clocks = clocks::take_checked(input)?;
        if input.left() > 0 {
            return Err(input.expected("the end"));
        }
        let knowledge = Knowledge {
            subdevices,
            others,
            topology,
            main_count,
            ring,
            sequence,
            offered,
            activations,
            siis,
            dictionaries,
            clocks,
        };
        if knowledge.are_stations_unique() { Ok(knowledge) } else { Err(stations) }
    }

    fn are_stations_unique(&self) -> bool {
        let all = self.subdevices.iter().chain(&self.others);
        let mut stations: Vec<u16> = all.map(|known| known.info.station.0).collect();
        stations.put_in_order();
        stations.first() != Some(&0) && stations.windows(2).all(|pair| pair[0] != pair[1])
    }
}

fn take_subdevices(input: &mut Input<'_>) -> Result<Vec<KnownSubDevice>, KnowledgeError> {
    let count = input.expected("at most 65,536 SubDevices");
    let counters = input.expected("mailbox counters from 0 to 7");
    let positions = input.expected("SubDevices in the order of their positions");
    let subdevices: Vec<KnownSubDevice> = Vec::take(input)?;
    if subdevices.len() > MOST_SUBDEVICES {
        return Err(count);
    }
    if subdevices.iter().flat_map(|known| &known.mailbox).any(|mailbox| mailbox.counter > HIGHEST_COUNTER) {
        return Err(counters);
    }
    let is_placed = |(position, known): (usize, &KnownSubDevice)| usize::from(known.info.position.0) == position;
    if subdevices.iter().enumerate().all(is_placed) { Ok(subdevices) } else { Err(positions) }
}

/// Puts the header before the bytes of a knowledge. For tests: they change bytes behind it.
pub fn seal(content: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(HEADER + content.len());
    out.resize(HEADER, 0);
    out.extend_from_slice(content);
    write_header(&mut out);
    out
}

/// Writes the header before the content.
fn write_header(out: &mut [u8]) {
    let (first, content) = out.split_at_mut(HEADER);
    let mut header = Vec::with_capacity(HEADER);
    header.extend_from_slice(&MAGIC);
    VERSION.put(&mut header);
    content.len().put(&mut header);
    checksum(content).put(&mut header);
    first.copy_from_slice(&header);
}

/// The content behind a header that fits it.
fn open(bytes: &[u8]) -> Result<Input<'_>, KnowledgeError> {
    let mut input = Input::new(bytes, 0);
    let wrong = |offset, expected| Err(KnowledgeError { offset, expected });
    if input.array("knowledge of a segment")? != MAGIC {
        return wrong(0, "knowledge of a segment");
    }
    if u16::take(&mut input)? != VERSION {
        return wrong(8, "version 4");
    }
    if usize::take(&mut input)? != bytes.len().saturating_sub(HEADER) {
        return wrong(10, "the number of bytes behind the header");
    }
    let expected = u64::take(&mut input)?;
    let content = bytes.get(HEADER..).unwrap_or_default();
    if checksum(content) != expected {
        return wrong(14, "the checksum of the bytes behind the header");
    }
    Ok(Input::new(content, HEADER))
}

/// FNV-1a over words of eight bytes, the last one filled with zeros: finds accidents, not intent.
fn checksum(bytes: &[u8]) -> u64 {
    const OFFSET: u64 = 0xCBF2_9CE4_8422_2325;
    const PRIME: u64 = 0x0000_0100_0000_01B3;
    let mix = |hash: u64, word: &[u8; 8]| (hash ^ u64::from_le_bytes(*word)).wrapping_mul(PRIME).rotate_left(29);
    let (words, rest) = bytes.as_chunks();
    let mut last = [0; 8];
    last[..rest.len()].copy_from_slice(rest);
    mix(words.iter().fold(OFFSET ^ bytes.len() as u64, mix), &last)
}

#[cfg(test)]
mod tests;
