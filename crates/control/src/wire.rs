//! Messages as bytes.
//!
//! A header of 16 bytes, then the content as CBOR (RFC 8949), then the bytes of the message. The header has the magic
//! `RCTL`, the version, two zero bytes, and both lengths, little endian. It is the same in all versions, so that each
//! side recognises the other's. Any bytes are allowed: decoding never panics, and takes no more memory than a small
//! multiple of the limits.

use std::fmt;

use crate::message::{Content, Message};
use crate::refusal::Refusal;

/// Version of the messages. Other versions are refused.
pub const VERSION: u16 = 8;
/// Bytes of the header.
pub const HEADER: usize = 16;
const MAGIC: [u8; 4] = *b"RCTL";

/// Longest parts of a message that are accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Limits {
    /// Longest content, in bytes.
    pub content: usize,
    /// Longest data after it, in bytes.
    pub bytes: usize,
}

impl Limits {
    /// For messages of a client: an object or an SII at most.
    pub const CLIENT: Limits = Limits { content: 4 << 10, bytes: 64 << 10 };
    /// For messages between the daemon and an application that drives a master: states of all SubDevices, and
    /// knowledge of a segment of thousands.
    pub const OWNER: Limits = Limits { content: 16 << 20, bytes: 64 << 20 };
}

/// Why bytes are no message.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum WireError {
    /// The first bytes are those of something else.
    NotRingcat,
    /// The message is of another version.
    Version {
        /// Its version.
        there: u16,
    },
    /// A part is longer than it may be.
    TooLong {
        /// Its length.
        length: usize,
        /// The limit.
        limit: usize,
    },
    /// The content is not of this version, or damaged.
    Malformed(String),
}

impl WireError {
    /// The refusal that the other side receives.
    pub fn refusal(&self) -> Refusal {
        match self {
            WireError::Version { there } => Refusal::Version { here: VERSION, there: *there },
            other => Refusal::Unexpected { expected: format!("a message of RingCAT: {other}") },
        }
    }
}

impl fmt::Display for WireError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            WireError::NotRingcat => f.write_str("the first bytes are not RCTL"),
            WireError::Version { there } => Refusal::Version { here: VERSION, there: *there }.fmt(f),
            WireError::TooLong { length, limit } => write!(f, "{length} bytes in a part of at most {limit}"),
            WireError::Malformed(cause) => f.write_str(cause),
        }
    }
}

impl std::error::Error for WireError {}

/// Lengths of the parts of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Bytes of the content.
    pub content: usize,
    /// Bytes of its data.
    pub bytes: usize,
}

impl Header {
    /// Decodes the header of a message.
    ///
    /// # Errors
    /// It is none, of another version, or announces more than the limits.
    pub fn decode(header: &[u8; HEADER], limits: Limits) -> Result<Header, WireError> {
        let [m0, m1, m2, m3, v0, v1, _, _, rest @ ..] = *header;
        if [m0, m1, m2, m3] != MAGIC {
            return Err(WireError::NotRingcat);
        }
        let there = u16::from_le_bytes([v0, v1]);
        if there != VERSION {
            return Err(WireError::Version { there });
        }
        let [c0, c1, c2, c3, b0, b1, b2, b3] = rest;
        let length = |word: [u8; 4], limit| {
            let length = u32::from_le_bytes(word) as usize;
            if length <= limit { Ok(length) } else { Err(WireError::TooLong { length, limit }) }
        };
        Ok(Header {
            content: length([c0, c1, c2, c3], limits.content)?,
            bytes: length([b0, b1, b2, b3], limits.bytes)?,
        })
    }
}

/// The content of a message from its bytes.
///
/// # Errors
/// The bytes are no message of this version.
pub fn decode_content(content: &[u8]) -> Result<Content, WireError> {
    let mut rest = content;
    let content = ciborium::from_reader(&mut rest).map_err(|error| WireError::Malformed(error.to_string()))?;
    if rest.is_empty() {
        return Ok(content);
    }
    Err(WireError::Malformed(format!("{} bytes behind the content", rest.len())))
}

/// A message as bytes.
///
/// # Errors
/// The message is longer than 4 GiB.
pub fn encode(message: &Message) -> Result<Vec<u8>, WireError> {
    let mut out = vec![0; HEADER];
    let written = ciborium::into_writer(&message.content, &mut out);
    written.map_err(|error| WireError::Malformed(error.to_string()))?;
    let content = length(out.len() - HEADER)?;
    let bytes = length(message.bytes.len())?;
    out[..4].copy_from_slice(&MAGIC);
    out[4..6].copy_from_slice(&VERSION.to_le_bytes());
    out[8..12].copy_from_slice(&content.to_le_bytes());
    out[12..16].copy_from_slice(&bytes.to_le_bytes());
    out.extend_from_slice(&message.bytes);
    Ok(out)
}

fn length(length: usize) -> Result<u32, WireError> {
    u32::try_from(length).map_err(|_| WireError::TooLong { length, limit: u32::MAX as usize })
}

/// Decodes one message that fills the bytes.
///
/// # Errors
/// They are no message, or more or fewer than one.
pub fn decode(bytes: &[u8], limits: Limits) -> Result<Message, WireError> {
    let short = || WireError::Malformed(format!("{} bytes do not hold a whole message", bytes.len()));
    let (header, rest) = bytes.split_first_chunk().ok_or_else(short)?;
    let header = Header::decode(header, limits)?;
    if rest.len() != header.content + header.bytes {
        return Err(short());
    }
    let (content, data) = rest.split_at(header.content);
    Ok(Message { content: decode_content(content)?, bytes: data.to_vec() })
}

#[cfg(test)]
mod tests;
