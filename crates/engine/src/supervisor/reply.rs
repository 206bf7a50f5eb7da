//! What a datagram brought back, or why it brought nothing.

use alloc::vec::Vec;
use core::fmt;

use ringcat_wire::address::Wkc;
use ringcat_wire::datagram::{MAX_DATA, Target};

use crate::ring::Sequence;
use crate::time::Instant;

/// What a datagram brought back, merged from all copies.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reply {
    /// The data; for writes, what was sent.
    pub data: Vec<u8>,
    /// Working counter of the copy sent on the main link.
    pub main: Wkc,
    /// Working counter of the copy sent on the redundant link.
    pub redundant: Wkc,
    /// OR of the ECAT event requests.
    pub irq: u16,
    /// The frame that it came with: datagrams of one frame were met at the same time.
    pub frame: Sequence,
    /// When that was handed to the links.
    pub sent_at: Instant,
}

impl Reply {
    /// Sum of the working counters (protocol CR-05).
    pub const fn wkc(&self) -> Wkc {
        self.main.plus(self.redundant)
    }
}

/// Why a datagram brought nothing back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum BusError {
    /// Its frame was lost, also when it was sent again.
    Lost {
        /// Whom it addressed.
        target: Target,
        /// How often it was sent again.
        retries: u8,
    },
    /// It is longer than a frame can carry.
    TooLong {
        /// Whom it addresses.
        target: Target,
        /// Bytes of data.
        length: usize,
    },
    /// Not the expected number of SubDevices answered.
    Wkc {
        /// Whom it addressed.
        target: Target,
        /// Expected.
        expected: Wkc,
        /// Came.
        got: Wkc,
    },
    /// It was to be alone on the wire, and that was never empty.
    Busy {
        /// Whom it addressed.
        target: Target,
    },
    /// It was to be alone on the wire, and the cyclic half sent meanwhile.
    Disturbed {
        /// Whom it addressed.
        target: Target,
    },
    /// An LRW of which both copies met somebody: neither has what the other one read (protocol 9.2.2).
    Split {
        /// Whom it addressed.
        target: Target,
    },
}

impl BusError {
    /// The same of a datagram that was asked for with another target.
    #[must_use]
    pub(crate) fn asked_of(mut self, asked: Target) -> BusError {
        let (BusError::Lost { target, .. }
        | BusError::TooLong { target, .. }
        | BusError::Wkc { target, .. }
        | BusError::Busy { target }
        | BusError::Disturbed { target }
        | BusError::Split { target }) = &mut self;
        *target = asked;
        self
    }
}

impl fmt::Display for BusError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fn target(f: &mut fmt::Formatter<'_>, target: Target) -> fmt::Result {
            match target {
                Target::None => f.write_str("nobody"),
                Target::Position(position, register) => write!(f, "position {position}, register {register}"),
                Target::Station(station, register) => write!(f, "station {station}, register {register}"),
                Target::Broadcast(register) => write!(f, "all SubDevices, register {register}"),
                Target::Logical(address) => write!(f, "logical address {address}"),
            }
        }
        match self {
            BusError::Lost { target: whom, retries } => {
                target(f, *whom)?;
                write!(f, ": the frame was lost, {} times", u16::from(*retries) + 1)
            }
            BusError::TooLong { target: whom, length } => {
                target(f, *whom)?;
                write!(f, ": {length} bytes, a datagram carries at most {MAX_DATA}")
            }
            BusError::Wkc { target: whom, expected, got } => {
                target(f, *whom)?;
                write!(f, ": expected working counter {expected}, got {got}")
            }
            BusError::Busy { target: whom } => {
                target(f, *whom)?;
                f.write_str(": other frames are on the wire all the time")
            }
            BusError::Disturbed { target: whom } => {
                target(f, *whom)?;
                f.write_str(": process data was on the wire beside the frame")
            }
            BusError::Split { target: whom } => {
                target(f, *whom)?;
                f.write_str(
                    ": an LRW on two links met SubDevices with both copies, so that half of them is missing in each",
                )
            }
        }
    }
}

impl core::error::Error for BusError {}

/// A time limit ran out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Elapsed;
