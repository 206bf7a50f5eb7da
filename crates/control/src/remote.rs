//! Remote access to one of two MainDevices (protocol AC-08, REQ037): messages over TCP.
//!
//! A header of 12 bytes (the magic `RCRA`, the version, two zero bytes, the length, little endian), then CBOR
//! (RFC 8949).
//! A client sends [`RemoteQuery::Hello`] with the token, then one query after the other; each has one answer. Any bytes
//! are allowed: decoding never panics, and takes no more memory than a small multiple of the limit.

use std::fmt;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::wire::WireError;

/// Version of the messages. Other versions are refused.
pub const REMOTE_VERSION: u16 = 1;
/// Longest content of a query, in bytes.
pub const LONGEST_QUERY: usize = 1 << 10;
/// Longest content of an answer, in bytes: the states of thousands of SubDevices.
pub const LONGEST_ANSWER: usize = 1 << 20;
/// Bytes of the header.
const HEADER: usize = 12;
const MAGIC: [u8; 4] = *b"RCRA";

/// What a client sends. Its `Debug` leaves the token out.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum RemoteQuery {
    /// First message: the token, without which no query is answered.
    Hello {
        /// The token.
        token: String,
    },
    /// Requests the state of this MainDevice.
    State,
    /// Requests a role.
    Request {
        /// The role.
        role: RemoteRole,
        /// Also while a write into the memory of a SubDevice is under way.
        force: bool,
    },
    /// Switches permanent standby on (notification 1 of protocol 9.10, which also requests the role INACTIVE) or off
    /// (notification 2).
    Hold {
        /// On.
        held: bool,
        /// Requests the role also while a write into the memory of a SubDevice is under way.
        force: bool,
    },
}

impl fmt::Debug for RemoteQuery {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RemoteQuery::Hello { .. } => f.write_str("Hello(..)"),
            RemoteQuery::State => f.write_str("State"),
            RemoteQuery::Request { role, force } => {
                f.debug_struct("Request").field("role", role).field("force", force).finish()
            }
            RemoteQuery::Hold { held, force } => {
                f.debug_struct("Hold").field("held", held).field("force", force).finish()
            }
        }
    }
}

/// A role that is requested.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum RemoteRole {
    /// ACTIVE, whatever the other MainDevice does.
    Active,
    /// INACTIVE, whether or not the other MainDevice takes over.
    Inactive,
    /// The ACTIVE hands its role over to the other MainDevice.
    HandOver,
}

/// What the MainDevice answers.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum RemoteAnswer {
    /// To [`RemoteQuery::Hello`]: the version of the program.
    Welcome(String),
    /// To [`RemoteQuery::State`].
    State(Box<RemoteState>),
    /// The request takes effect with the next cycle, or is refused then: the state shows it.
    Done,
    /// The query was not carried out, and why. After [`RemoteQuery::Hello`] the connection ends.
    Refused(String),
}

/// One of two MainDevices.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct RemoteState {
    /// It is ACTIVE.
    pub is_active: bool,
    /// It has an application: it follows, or drives the bus.
    pub has_application: bool,
    /// Permanent standby: it takes over on request only.
    pub is_held: bool,
    /// Why a failure of one MainDevice would cost more than the time-out of a takeover; empty if it would not.
    pub not_ready: Vec<String>,
    /// Changes of its role.
    pub role_changes: u32,
    /// The ring, in a word.
    pub ring: String,
    /// Whether the links have carriers, main first; `None` if that is not known.
    pub carriers: [Option<bool>; 2],
    /// State of each declared SubDevice, in words.
    pub subdevices: Vec<String>,
    /// Cycles of the application.
    pub cycles: u64,
    /// Of its cycles as ACTIVE.
    pub counters: RemoteCounters,
    /// What the ACTIVE has reported, as INACTIVE.
    pub of_active: Option<RemoteCounters>,
    /// Forwarded frames, main first; those that were sent back; those that were not forwarded.
    pub forwarded: [u64; 2],
    /// Of these, sent back.
    pub sent_back: u64,
    /// Frames that were not forwarded.
    pub not_forwarded: u64,
}

/// Frames and cycles of an ACTIVE.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct RemoteCounters {
    /// Frames that left.
    pub sent: u64,
    /// Frames of which no copy came back.
    pub lost: u64,
    /// Cycles without complete process data.
    pub incomplete: u64,
    /// Frames of another MainDevice.
    pub foreign: u64,
}

impl RemoteCounters {
    /// These counters.
    pub const fn new(sent: u64, lost: u64, incomplete: u64, foreign: u64) -> RemoteCounters {
        RemoteCounters { sent, lost, incomplete, foreign }
    }
}

/// A message as bytes.
///
/// # Errors
/// It is longer than 4 GiB.
pub fn encode(content: &impl Serialize) -> Result<Vec<u8>, WireError> {
    let mut out = vec![0; HEADER];
    ciborium::into_writer(content, &mut out).map_err(|error| WireError::Malformed(error.to_string()))?;
    let length = out.len() - HEADER;
    let announced = u32::try_from(length).map_err(|_| WireError::TooLong { length, limit: u32::MAX as usize })?;
    out[..4].copy_from_slice(&MAGIC);
    out[4..6].copy_from_slice(&REMOTE_VERSION.to_le_bytes());
    out[8..HEADER].copy_from_slice(&announced.to_le_bytes());
    Ok(out)
}

/// A message at the beginning of what has arrived, with its length; `None` if a part of it is missing.
///
/// # Errors
/// What has arrived is no message of this version, or it is longer than `limit`.
pub fn decode<T: DeserializeOwned>(arrived: &[u8], limit: usize) -> Result<Option<(T, usize)>, WireError> {
    // The first bytes show what it is before the whole header is there.
    if arrived.iter().zip(&MAGIC).any(|(got, expected)| got != expected) {
        return Err(WireError::NotRingcat);
    }
    let Some((header, rest)) = arrived.split_first_chunk::<HEADER>() else { return Ok(None) };
    let [_, _, _, _, v0, v1, _, _, length @ ..] = *header;
    let there = u16::from_le_bytes([v0, v1]);
    if there != REMOTE_VERSION {
        return Err(WireError::Malformed(format!(
            "remote access of version {there} there, of version {REMOTE_VERSION} here: update the older program"
        )));
    }
    let length = u32::from_le_bytes(length) as usize;
    if length > limit {
        return Err(WireError::TooLong { length, limit });
    }
    let Some(mut content) = rest.get(..length) else { return Ok(None) };
    let message = ciborium::from_reader(&mut content).map_err(|error| WireError::Malformed(error.to_string()))?;
    if !content.is_empty() {
        return Err(WireError::Malformed(format!("{} bytes behind the content", content.len())));
    }
    Ok(Some((message, HEADER + length)))
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: AC-08, standby
    #[test]
    fn a_message_arrives_in_any_parts_and_the_next_one_follows_it() {
        let first = RemoteQuery::Hello { token: "0123456789abcdef".to_owned() };
        let second = RemoteQuery::Hold { held: true, force: false };
        let bytes = [encode(&first).expect("it is short"), encode(&second).expect("it is short")].concat();
        let end = encode(&first).expect("it is short").len();
        for length in 0..end {
            assert_eq!(decode::<RemoteQuery>(&bytes[..length], LONGEST_QUERY), Ok(None), "{length}");
        }
        assert_eq!(decode(&bytes, LONGEST_QUERY), Ok(Some((first, end))));
        assert_eq!(decode(&bytes[end..], LONGEST_QUERY), Ok(Some((second, bytes.len() - end))));
    }

    // covers: AC-08, standby
    #[test]
    fn a_query_is_printed_without_its_token() {
        let hello = format!("{:?}", RemoteQuery::Hello { token: "0123456789abcdef".to_owned() });
        assert!(!hello.contains("0123"), "{hello}");
        let hold = format!("{:?}", RemoteQuery::Hold { held: true, force: false });
        assert_eq!(hold, "Hold { held: true, force: false }");
    }

    // covers: AC-08, standby
    #[test]
    fn other_programs_versions_and_lengths_are_refused_by_name() {
        let right = encode(&RemoteQuery::State).expect("it is short");
        let refused = |at: usize, byte: u8| {
            let mut bytes = right.clone();
            bytes[at] = byte;
            decode::<RemoteQuery>(&bytes, LONGEST_QUERY).expect_err("it is refused")
        };
        assert_eq!(refused(0, b'G'), WireError::NotRingcat);
        assert!(refused(4, 2).to_string().contains("version 2 there, of version 1 here"), "{}", refused(4, 2));
        assert_eq!(refused(10, 1), WireError::TooLong { length: (1 << 16) + 6, limit: LONGEST_QUERY });
        assert!(matches!(refused(12, 0xFF), WireError::Malformed(_)));
        assert_eq!(decode::<RemoteQuery>(b"GET /", LONGEST_QUERY), Err(WireError::NotRingcat));
    }
}
