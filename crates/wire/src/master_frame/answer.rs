//! The answer of the INACTIVE: how far it follows, and whether it can take over.

use core::fmt;

use super::cursor::{Reader, Writer};
use super::item::Item;
use super::{ANSWER_MAGIC, LEAST_READER, MasterFrameError, VERSION};

/// How far the INACTIVE is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stage {
    /// It forwards and listens, without an application.
    #[default]
    Listens,
    /// It follows with an application, and cannot take over now ([`Answer::not_ready`]).
    Follows,
    /// It can take over.
    Ready,
    /// It takes over with the next cycle if the ACTIVE ends with this one.
    Accepts,
    /// A stage of a later version.
    Other(u8),
}

impl Stage {
    /// From its code.
    pub const fn from_code(code: u8) -> Stage {
        match code {
            0 => Stage::Listens,
            1 => Stage::Follows,
            2 => Stage::Ready,
            3 => Stage::Accepts,
            other => Stage::Other(other),
        }
    }

    /// Its code.
    pub const fn code(self) -> u8 {
        match self {
            Stage::Listens => 0,
            Stage::Follows => 1,
            Stage::Ready => 2,
            Stage::Accepts => 3,
            Stage::Other(code) => code,
        }
    }
}

/// Why a takeover would cost more than its time-out, as bits, as one of two MainDevices has determined it.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct NotReady(pub u16);

impl NotReady {
    /// Nothing prevents it.
    pub const NOTHING: NotReady = NotReady(0);
    /// It has no application.
    pub const NO_APPLICATION: NotReady = NotReady(0x01);
    /// No whole cycle of master frames has arrived, or none lately.
    pub const NO_CYCLE: NotReady = NotReady(0x02);
    /// Its configuration is another one.
    pub const IDENTITY: NotReady = NotReady(0x04);
    /// Its process data has other places: another session, or other sizes.
    pub const LAYOUT: NotReady = NotReady(0x08);
    /// It is to stay INACTIVE.
    pub const HELD: NotReady = NotReady(0x10);
    /// One of its links is down. This alone does not prevent a takeover: the ring is open there, as for the ACTIVE.
    pub const LINK: NotReady = NotReady(0x20);
    /// The application has a reason of its own.
    pub const APPLICATION: NotReady = NotReady(0x40);
    /// No guard switches its interfaces off when it fails. This alone does not prevent a takeover.
    pub const GUARD: NotReady = NotReady(0x80);
    /// The watchdog of a SubDevice is too short for a takeover. This alone does not prevent one.
    pub const WATCHDOG: NotReady = NotReady(0x100);
    /// Not all knowledge of the segment has arrived: without it nothing can follow.
    pub const KNOWLEDGE: NotReady = NotReady(0x200);
    /// The other MainDevice has master frames of a version that cannot be read.
    pub const VERSION: NotReady = NotReady(0x400);
    /// Seen by the ACTIVE: no other MainDevice is there. Never in an answer.
    pub const ABSENT: NotReady = NotReady(0x800);
    /// Seen by the ACTIVE: the other MainDevice forwards, and does not answer. Never in an answer.
    pub const NO_ANSWER: NotReady = NotReady(0x1000);

    /// Seen by each one itself: its application runs no cycles. Never in an answer.
    pub const STOPPED: NotReady = NotReady(0x2000);

    /// Reasons that do not prevent a takeover.
    const MINOR: u16 = NotReady::LINK.0 | NotReady::GUARD.0 | NotReady::WATCHDOG.0;

    /// Names of the bits.
    const NAMES: [(NotReady, &str); 14] = [
        (NotReady::NO_APPLICATION, "no application"),
        (NotReady::NO_CYCLE, "no whole cycle of master frames"),
        (NotReady::IDENTITY, "another configuration"),
        (NotReady::LAYOUT, "other places of process data"),
        (NotReady::HELD, "held INACTIVE"),
        (NotReady::LINK, "a link is down"),
        (NotReady::APPLICATION, "the application is not ready"),
        (NotReady::GUARD, "no guard"),
        (NotReady::WATCHDOG, "a watchdog is too short"),
        (NotReady::KNOWLEDGE, "knowledge of the segment is missing"),
        (NotReady::VERSION, "master frames of another version"),
        (NotReady::ABSENT, "the other MainDevice is absent"),
        (NotReady::NO_ANSWER, "the other MainDevice forwards, and does not follow"),
        (NotReady::STOPPED, "no cycles run"),
    ];

    /// These bits and others.
    #[must_use]
    pub const fn with(self, other: NotReady, set: bool) -> NotReady {
        NotReady(if set { self.0 | other.0 } else { self.0 & !other.0 })
    }

    /// Whether all bits of another one are set.
    pub const fn has(self, other: NotReady) -> bool {
        self.0 & other.0 == other.0
    }

    /// Whether nothing prevents a takeover. [`NotReady::LINK`], [`NotReady::GUARD`] and [`NotReady::WATCHDOG`] do not,
    /// an unknown bit does.
    pub const fn is_ready(self) -> bool {
        self.0 & !NotReady::MINOR == 0
    }

    /// The reasons in words.
    pub fn reasons(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES.into_iter().filter(move |(bit, _)| self.has(*bit)).map(|(_, name)| name)
    }
}

impl fmt::Display for NotReady {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if *self == NotReady::NOTHING {
            return f.write_str("ready");
        }
        for (number, name) in self.reasons().enumerate() {
            f.write_str(if number > 0 { ", " } else { "" })?;
            f.write_str(name)?;
        }
        Ok(())
    }
}

impl fmt::Debug for NotReady {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "NotReady({:#x}: {self})", self.0)
    }
}

/// The answer of the INACTIVE.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Answer {
    /// Version of the sender.
    pub version: u8,
    /// Oldest version whose readers understand it.
    pub least: u8,
    /// How far it is.
    pub stage: Stage,
    /// Why it cannot take over.
    pub not_ready: NotReady,
    /// The last cycle of which everything has arrived.
    pub whole: u32,
    /// Digest of its configuration.
    pub identity: u64,
    /// One item of it.
    pub item: Item,
}

impl Answer {
    /// Bytes of this version.
    pub const LEN: usize = 4 + 3 + 1 + 2 + 2 + 4 + 8 + Item::LEN;

    /// An answer of this version with nothing in it.
    pub fn new() -> Answer {
        Answer { version: VERSION, least: LEAST_READER, ..Answer::default() }
    }

    /// Decodes an answer of this or a later version.
    ///
    /// # Errors
    /// It is too short, of another stack, or of a version that this one does not understand.
    pub fn decode(bytes: &[u8]) -> Result<Answer, MasterFrameError> {
        let mut from = Reader::new(bytes, "answer in a master frame", Self::LEN)?;
        let magic = from.take();
        if magic != ANSWER_MAGIC {
            return Err(MasterFrameError::Magic(magic));
        }
        let (version, least) = (from.u8(), from.u8());
        if least > VERSION {
            return Err(MasterFrameError::Version { least, got: version });
        }
        let stage = Stage::from_code(from.u8());
        let _reserved = from.u8();
        let not_ready = NotReady(from.u16());
        let _reserved = from.u16();
        let (whole, identity) = (from.u32(), from.u64());
        Ok(Answer { version, least, stage, not_ready, whole, identity, item: Item::take(&mut from) })
    }

    /// Encodes it and returns its length; `None` if it does not fit `out`.
    pub fn encode(&self, out: &mut [u8]) -> Option<usize> {
        let mut out = Writer::new(out, Self::LEN)?;
        out.put(&ANSWER_MAGIC);
        [self.version, self.least, self.stage.code(), 0].into_iter().for_each(|byte| out.u8(byte));
        out.u16(self.not_ready.0);
        out.u16(0);
        out.u32(self.whole);
        out.u64(self.identity);
        self.item.put(&mut out);
        Some(out.length())
    }
}
