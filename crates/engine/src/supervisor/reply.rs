//! The reply to a datagram, or the reason why there is none.

use alloc::vec::Vec;
use core::fmt;

use ringcat_wire::address::Wkc;
use ringcat_wire::datagram::{MAX_DATA, Target};

use crate::ring::Sequence;
use crate::time::Instant;

/// The reply to a datagram, merged from all copies.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
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
    /// The frame was lost, and so were all repetitions.
    Lost {
        /// Its target.
        target: Target,
        /// Number of retries.
        retries: u8,
    },
    /// The data is longer than a frame can carry.
    TooLong {
        /// Its target.
        target: Target,
        /// Bytes of data.
        length: usize,
    },
    /// The working counter differs from the expected one.
    Wkc {
        /// Its target.
        target: Target,
        /// Expected.
        expected: Wkc,
        /// Received.
        got: Wkc,
    },
    /// The datagram had to be alone on the wire, but the wire was never free.
    Busy {
        /// Its target.
        target: Target,
    },
    /// The datagram had to be alone on the wire, but the cyclic half sent a frame meanwhile.
    Disturbed {
        /// Its target.
        target: Target,
    },
    /// SubDevices processed both copies of an LRW: each copy contains only the inputs that were read into it (protocol
    /// 9.2.2).
    Split {
        /// Its target.
        target: Target,
    },
}

impl BusError {
    /// The same error for a datagram with another target.
    #[must_use]
    pub(crate) fn with_target(mut self, addressed: Target) -> BusError {
        let (BusError::Lost { target, .. }
        | BusError::TooLong { target, .. }
        | BusError::Wkc { target, .. }
        | BusError::Busy { target }
        | BusError::Disturbed { target }
        | BusError::Split { target }) = &mut self;
        *target = addressed;
        self
    }
}

impl fmt::Display for BusError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fn target(f: &mut fmt::Formatter<'_>, target: Target) -> fmt::Result {
            match target {
                Target::None => f.write_str("no SubDevice"),
                Target::Position(position, register) => write!(f, "position {position}, register {register}"),
                Target::Station(station, register) => write!(f, "station {station}, register {register}"),
                Target::Broadcast(register) => write!(f, "all SubDevices, register {register}"),
                Target::Logical(address) => write!(f, "logical address {address}"),
            }
        }
        match self {
            BusError::Lost { target: to, retries } => {
                target(f, *to)?;
                write!(f, ": the frame was lost, {} times", u16::from(*retries) + 1)
            }
            BusError::TooLong { target: to, length } => {
                target(f, *to)?;
                write!(f, ": {length} bytes, a datagram carries at most {MAX_DATA}")
            }
            BusError::Wkc { target: to, expected, got } => {
                target(f, *to)?;
                write!(f, ": expected working counter {expected}, got {got}")?;
                match (to, got) {
                    (Target::Position(..) | Target::Station(..), Wkc(0)) => {
                        f.write_str(": the SubDevice does not answer, or has no such register")
                    }
                    _ => Ok(()),
                }
            }
            BusError::Busy { target: to } => {
                target(f, *to)?;
                f.write_str(": other frames were on the wire all the time")
            }
            BusError::Disturbed { target: to } => {
                target(f, *to)?;
                f.write_str(": a cyclic frame was on the wire with the datagram")
            }
            BusError::Split { target: to } => {
                target(f, *to)?;
                f.write_str(": SubDevices processed both copies of an LRW, so that each copy lacks inputs of the other")
            }
        }
    }
}

impl core::error::Error for BusError {}

/// A time limit expired.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Elapsed;
