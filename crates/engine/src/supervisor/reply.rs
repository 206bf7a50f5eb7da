//! The reply to a datagram, or the reason why there is none.

use alloc::vec::Vec;
use core::fmt;

use ringcat_wire::address::Wkc;
use ringcat_wire::datagram::{MAX_DATA, Target};

use crate::ring::Sequence;
use crate::time::Instant;

/// The reply to a datagram, merged from all copies.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reply {
    /// The data; for writes, as sent.
    pub data: Vec<u8>,
    /// Working counter of the copy sent on the main link.
    pub main: Wkc,
    /// Working counter of the copy sent on the redundant link.
    pub redundant: Wkc,
    /// OR of the ECAT event requests.
    pub irq: u16,
    /// The frame that carried it: datagrams of one frame are processed at the same time.
    pub frame: Sequence,
    /// When that frame was handed to the links.
    pub sent_at: Instant,
}

impl Reply {
    /// Sum of the working counters (protocol CR-05).
    pub const fn wkc(&self) -> Wkc {
        self.main.plus(self.redundant)
    }
}

/// Why a datagram has no reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum BusError {
    /// Its frame was lost, also when it was repeated.
    Lost {
        /// Its target.
        target: Target,
        /// Number of retries.
        retries: u8,
    },
    /// It is longer than a frame can carry.
    TooLong {
        /// Its target.
        target: Target,
        /// Bytes of data.
        length: usize,
    },
    /// Another number of SubDevices answered than expected.
    Wkc {
        /// Its target.
        target: Target,
        /// Expected.
        expected: Wkc,
        /// Received.
        got: Wkc,
    },
    /// It was to be alone on the wire, but the wire was never free.
    Busy {
        /// Its target.
        target: Target,
    },
    /// It was to be alone on the wire, but the cyclic half sent meanwhile.
    Disturbed {
        /// Its target.
        target: Target,
    },
    /// An LRW that SubDevices processed on both copies: neither copy has the data read into the other (protocol 9.2.2).
    Split {
        /// Its target.
        target: Target,
    },
}

impl BusError {
    /// The same error for a datagram with another target.
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

/// A time limit expired.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Elapsed;
