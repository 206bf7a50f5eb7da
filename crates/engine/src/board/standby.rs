//! What both halves exchange about the other MainDevice of the ring.
//!
//! The acyclic half of the ACTIVE posts its knowledge of the segment, which the cyclic half sends piece by piece; the
//! cyclic half of the INACTIVE posts what it has received.

use core::sync::atomic::{AtomicU8, AtomicU16, AtomicU32, AtomicU64, Ordering};

use ringcat_wire::frame::MacAddress;
use ringcat_wire::master_frame::{Diagnosis, DomainRecord, Header};
use ringcat_wire::memory_write::MemoryWrite;

use super::sheet::Sheet;
use crate::link::Link;
use crate::time::Instant;

/// Room for the knowledge of a segment: some 300 SubDevices with their SIIs. More is not sent.
pub const KNOWLEDGE_ROOM: usize = 256 * 1024;
/// The ACTIVE goes on if its last cycle began at most this number of periods ago: less than any time-out (9.9).
const GOES_ON: u64 = 3;
/// Room for a diagnosis with this number of domains.
const DOMAINS: usize = 64;

/// What a new ACTIVE goes on with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Takeover {
    /// Nothing: all SubDevices are configured again from INIT on.
    ThroughInit,
    /// Process data of the other MainDevice: SubDevices keep their configuration.
    FromOther,
    /// Its own last state: no frame of another MainDevice has arrived since. SubDevices keep their configuration.
    FromItself,
}

/// The words.
#[derive(Debug)]
pub struct StandbyWords {
    /// Knowledge of this MainDevice, for the other one. Writer: the acyclic half.
    pub knowledge: Sheet,
    /// Knowledge of the other MainDevice. Writer: the cyclic half.
    pub partner_knowledge: Sheet,
    /// Diagnosis of the other MainDevice. Writer: the cyclic half.
    pub diagnosis: Sheet,
    /// Session of the other MainDevice, plus one; 0 before its first header.
    session: AtomicU32,
    /// Digest of its configuration.
    identity: AtomicU64,
    /// The write into the memory of a SubDevice that its last header named; 0 without one. It is under way until then.
    partner_write: AtomicU16,
    partner_writes_until: AtomicU64,
    /// The last [`Takeover`], as a number. Writer: the cyclic half.
    takeover: AtomicU8,
    /// When a frame of the other MainDevice came last while this one is INACTIVE; 0 before. Writers: both halves.
    partner_frame_at: AtomicU64,
    /// Its version and the oldest one that could read it, if this MainDevice cannot; 0 otherwise.
    other_version: AtomicU32,
    /// Source address and link of an acyclic frame of another MainDevice that came while this one was ACTIVE; 0 without
    /// one. Writer: the acyclic half; the cyclic half takes it.
    collision: AtomicU64,
    /// A write into the memory of a SubDevice that is under way; 0 without one. Writer: the acyclic half.
    write: AtomicU16,
}

/// Bits of the word of a collision beside the address: there is one, and it came on the redundant link.
const COLLIDED: u64 = 1 << 63;
const ON_REDUNDANT: u64 = 1 << 62;

impl Default for StandbyWords {
    fn default() -> StandbyWords {
        StandbyWords {
            knowledge: Sheet::new(KNOWLEDGE_ROOM),
            partner_knowledge: Sheet::new(KNOWLEDGE_ROOM),
            diagnosis: Sheet::new(Diagnosis::LEN + DOMAINS * DomainRecord::LEN),
            session: AtomicU32::new(0),
            identity: AtomicU64::new(0),
            partner_write: AtomicU16::new(0),
            partner_writes_until: AtomicU64::new(0),
            takeover: AtomicU8::new(0),
            partner_frame_at: AtomicU64::new(0),
            other_version: AtomicU32::new(0),
            collision: AtomicU64::new(0),
            write: AtomicU16::new(0),
        }
    }
}

impl StandbyWords {
    /// Posts a header of the other MainDevice.
    pub fn post_header(&self, header: &Header, now: Instant) {
        self.partner_write.store(header.write.map_or(0, MemoryWrite::code), Ordering::Relaxed);
        self.partner_writes_until.store(now.0 + u64::from(header.period_ns) * GOES_ON, Ordering::Relaxed);
        self.identity.store(header.identity, Ordering::Relaxed);
        self.session.store(u32::from(header.session) + 1, Ordering::Release);
    }

    /// The write into the memory of a SubDevice that the ACTIVE does, if its last cycle has just come.
    pub fn partner_write(&self, now: Instant) -> Option<MemoryWrite> {
        let goes_on = now.0 < self.partner_writes_until.load(Ordering::Relaxed);
        MemoryWrite::from_code(self.partner_write.load(Ordering::Relaxed)).filter(|_| goes_on)
    }

    /// Posts what this MainDevice goes on with as ACTIVE.
    pub fn post_takeover(&self, takeover: Takeover) {
        self.takeover.store(takeover as u8, Ordering::Release);
    }

    /// What this MainDevice went on with when it became ACTIVE last.
    pub fn takeover(&self) -> Takeover {
        match self.takeover.load(Ordering::Acquire) {
            1 => Takeover::FromOther,
            2 => Takeover::FromItself,
            _ => Takeover::ThroughInit,
        }
    }

    /// Posts that a frame of the other MainDevice has come.
    pub fn post_partner_frame(&self, now: Instant) {
        self.partner_frame_at.fetch_max(now.0.max(1), Ordering::Relaxed);
    }

    /// When a frame of the other MainDevice came last.
    pub fn partner_frame_at(&self) -> Option<Instant> {
        let at = self.partner_frame_at.load(Ordering::Relaxed);
        (at != 0).then_some(Instant(at))
    }

    /// Posts that an acyclic frame of another MainDevice has come while this one is ACTIVE.
    pub fn post_collision(&self, arrived_on: Link, MacAddress([a, b, c, d, e, f]): MacAddress) {
        let link = if arrived_on == Link::Redundant { ON_REDUNDANT } else { 0 };
        self.collision.store(COLLIDED | link | u64::from_be_bytes([0, 0, a, b, c, d, e, f]), Ordering::Relaxed);
    }

    /// Takes the posted collision: the link of the frame, and its source address.
    pub fn take_collision(&self) -> Option<(Link, MacAddress)> {
        if self.collision.load(Ordering::Relaxed) == 0 {
            return None;
        }
        let word = self.collision.swap(0, Ordering::Relaxed);
        let [_, _, a, b, c, d, e, f] = word.to_be_bytes();
        let link = if word & ON_REDUNDANT == 0 { Link::Main } else { Link::Redundant };
        Some((link, MacAddress([a, b, c, d, e, f])))
    }

    /// Posts the write into the memory of a SubDevice that is under way here.
    pub fn post_write(&self, write: Option<MemoryWrite>) {
        self.write.store(write.map_or(0, MemoryWrite::code), Ordering::Relaxed);
    }

    /// The write into the memory of a SubDevice that is under way here.
    pub fn write(&self) -> Option<MemoryWrite> {
        MemoryWrite::from_code(self.write.load(Ordering::Relaxed))
    }

    /// Posts that the other MainDevice has a version that cannot be read.
    pub fn post_other_version(&self, least: u8, got: u8) {
        self.other_version.store(1 << 16 | u32::from(least) << 8 | u32::from(got), Ordering::Relaxed);
    }

    /// The oldest version that could read its master frames, and its version.
    pub fn other_version(&self) -> Option<(u8, u8)> {
        let word = self.other_version.load(Ordering::Relaxed);
        (word != 0).then_some(((word >> 8) as u8, word as u8))
    }

    /// Session and digest of the configuration of the other MainDevice; `None` before its first header.
    pub fn header(&self) -> Option<(u16, u64)> {
        let session = self.session.load(Ordering::Acquire).checked_sub(1)?;
        Some((session as u16, self.identity.load(Ordering::Relaxed)))
    }
}
