//! SoE: reads and writes elements of IDNs, long ones in fragments (protocol 6.6).

pub mod command;

use alloc::vec;
use alloc::vec::Vec;
use core::fmt;

use ringcat_wire::mailbox::soe::{Idn, SoeElements, SoeErrorCode, SoeMessage, SoeOperation};

use super::conversation::{Conversation, Limits};
use super::lane::Lane;
use super::stream::Overflow;
use super::{Mailbox, MailboxError};

/// Largest number of drives of a SubDevice.
const DRIVES: u8 = 8;

/// An element of an IDN of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SoeAddress {
    /// Drive of the SubDevice, 0..=7.
    pub drive: u8,
    /// The IDN.
    pub idn: Idn,
    /// One element, or several for a read.
    pub elements: SoeElements,
}

impl SoeAddress {
    /// The value of an IDN.
    pub const fn value(drive: u8, idn: Idn) -> SoeAddress {
        SoeAddress { drive, idn, elements: SoeElements::VALUE }
    }
}

impl fmt::Display for SoeAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "drive {} {} elements {:#04x}", self.drive, self.idn, self.elements.0)
    }
}

/// Why an access failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SoeError {
    /// The element.
    pub address: SoeAddress,
    /// The cause.
    pub cause: SoeFailure,
}

/// Cause of a failed access.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SoeFailure {
    /// The mailbox failed.
    Mailbox(MailboxError),
    /// The drive refused.
    Refused(SoeErrorCode),
    /// There is no such drive.
    Drive,
    /// Fragments are missing or out of order.
    Fragments {
        /// Number of fragments that should have followed.
        expected: u16,
        /// Number of fragments that follow.
        got: u16,
    },
    /// Longer than accepted.
    TooLong(Overflow),
}

impl fmt::Display for SoeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SoE {}: {}", self.address, self.cause)
    }
}

impl fmt::Display for SoeFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SoeFailure::Mailbox(error) => error.fmt(f),
            SoeFailure::Refused(code) => write!(f, "refused by the drive: {code}"),
            SoeFailure::Drive => write!(f, "drives are numbered from 0 to {}", DRIVES - 1),
            SoeFailure::Fragments { expected, got } => write!(f, "expected {expected} fragments to follow, got {got}"),
            SoeFailure::TooLong(Overflow { bytes, limit }) => {
                write!(f, "{bytes} bytes or more, at most {limit} were expected")
            }
        }
    }
}

impl core::error::Error for SoeError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        Some(&self.cause)
    }
}

impl core::error::Error for SoeFailure {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            SoeFailure::Mailbox(error) => Some(error),
            _ => None,
        }
    }
}

impl From<MailboxError> for SoeFailure {
    fn from(error: MailboxError) -> SoeFailure {
        SoeFailure::Mailbox(error)
    }
}

/// Reads elements of at most `limit` bytes in total; several elements are in the order of their bits.
pub async fn read(mailbox: &Mailbox, address: SoeAddress, limits: Limits, limit: usize) -> Result<Vec<u8>, SoeError> {
    read_inner(mailbox, address, limits, limit).await.map_err(|cause| SoeError { address, cause })
}

/// Writes an element. Only the last fragment has an answer: if an error reply arrives before it, whatever its cause,
/// the write has failed, and the value in the SubDevice is unknown.
pub async fn write(mailbox: &Mailbox, address: SoeAddress, data: &[u8], limits: Limits) -> Result<(), SoeError> {
    write_inner(mailbox, address, data, limits).await.map_err(|cause| SoeError { address, cause })
}

async fn begin(mailbox: &Mailbox, address: SoeAddress) -> Result<Conversation, SoeFailure> {
    if address.drive >= DRIVES {
        return Err(SoeFailure::Drive);
    }
    let mut conversation = mailbox.conversation(Lane::Soe).await?;
    conversation.settle().await?;
    Ok(conversation)
}

async fn read_inner(
    mailbox: &Mailbox,
    address: SoeAddress,
    limits: Limits,
    limit: usize,
) -> Result<Vec<u8>, SoeFailure> {
    let mut conversation = begin(mailbox, address).await?;
    let SoeAddress { drive, idn, elements } = address;
    let mut payload = [0; SoeMessage::OVERHEAD];
    let request = SoeMessage::whole(SoeOperation::ReadRequest, drive, elements, idn, &[]);
    let length = request.encode(&mut payload).unwrap_or(0);
    let answer = |payload: &[u8]| answer(payload, SoeOperation::ReadResponse, address);
    let first = conversation.begin(&payload[..length], limits, answer).await?;
    let (mut all, mut left) = first.inspect_err(|_| conversation.complete())?;
    loop {
        if all.len() > limit {
            return Err(SoeFailure::TooLong(Overflow { bytes: all.len() as u64, limit: limit as u64 }));
        }
        if left == 0 {
            conversation.complete();
            return Ok(all);
        }
        let (data, follow) = conversation.more(limits.answer, answer).await??;
        if follow != left - 1 {
            return Err(SoeFailure::Fragments { expected: left - 1, got: follow });
        }
        left = follow;
        all.extend_from_slice(&data);
    }
}

async fn write_inner(mailbox: &Mailbox, address: SoeAddress, data: &[u8], limits: Limits) -> Result<(), SoeFailure> {
    let mut conversation = begin(mailbox, address).await?;
    let SoeAddress { drive, idn, elements } = address;
    let mut payload = vec![0; conversation.request_capacity()];
    let piece = SoeMessage::max_data(conversation.mailbox_sizes().receive).max(1);
    let count = data.len().div_ceil(piece).max(1);
    let Ok(mut left) = u16::try_from(count - 1) else {
        let limit = piece as u64 * (1 << 16);
        return Err(SoeFailure::TooLong(Overflow { bytes: data.len() as u64, limit }));
    };
    let whole = |data| SoeMessage::whole(SoeOperation::WriteRequest, drive, elements, idn, data);
    let mut rest = data;
    let in_parts = left > 0;
    if in_parts {
        conversation.begin_parts();
    }
    while left > 0 {
        let (data, tail) = rest.split_at(piece);
        rest = tail;
        let message = SoeMessage { incomplete: true, number: left, ..whole(data) };
        let length = encode(&message, &mut payload)?;
        conversation.send(&payload[..length], limits.request).await?;
        conversation.check_parts()?;
        left -= 1;
    }
    let length = encode(&whole(rest), &mut payload)?;
    let answer = |payload: &[u8]| answer(payload, SoeOperation::WriteResponse, address);
    conversation.request(&payload[..length], limits, answer).await??;
    if in_parts {
        conversation.end_parts()?;
    }
    Ok(())
}

fn encode(message: &SoeMessage<'_>, payload: &mut [u8]) -> Result<usize, SoeFailure> {
    let (bytes, limit) = (SoeMessage::OVERHEAD + message.data.len(), payload.len());
    message.encode(payload).ok_or(SoeFailure::Mailbox(MailboxError::TooLong { bytes, limit }))
}

/// A message of the answer: its data, and the number of fragments that follow.
fn answer(payload: &[u8], operation: SoeOperation, address: SoeAddress) -> Option<Result<(Vec<u8>, u16), SoeFailure>> {
    let message = SoeMessage::decode(payload).ok()?;
    let ours = message.idn().is_none_or(|idn| idn == address.idn);
    if message.operation != operation || message.drive != address.drive || !ours {
        return None;
    }
    Some(match message.error_code() {
        Some(code) => Err(SoeFailure::Refused(code)),
        // Only the incomplete flag counts, not the number.
        None => Ok((message.data.to_vec(), if message.incomplete { message.number.max(1) } else { 0 })),
    })
}
