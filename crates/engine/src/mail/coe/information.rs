//! SDO information: the objects of a SubDevice, and their descriptions (protocol 6.3).

use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;
use core::fmt;

use ringcat_wire::mailbox::PayloadError;
use ringcat_wire::mailbox::coe::{
    EntryDescription, EntryRequest, Indices, InformationOpcode, ListType, ObjectDescription, SdoInformation, ValueInfo,
};
use ringcat_wire::mailbox::sdo::AbortCode;

use super::transfer::settle;
pub use crate::info::{Entry, Object};
use crate::mail::lane::Lane;
use crate::mail::{Conversation, Limits, Mailbox, MailboxError};
use crate::role::Function;

/// Longest answer: a list of all possible indices.
const LONGEST: usize = 2 + 2 * 0x1_0000;

/// Why SDO information failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum InformationError {
    /// The mailbox failed.
    Mailbox(MailboxError),
    /// The SubDevice refused.
    Refused(AbortCode),
    /// Fragments are missing or out of order.
    Fragments {
        /// Number of fragments that should have followed.
        expected: u16,
        /// Number of fragments that follow.
        got: u16,
    },
    /// Longer than any possible list.
    TooLong,
    /// The answer is malformed.
    Malformed(PayloadError),
}

impl fmt::Display for InformationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("SDO information: ")?;
        match self {
            InformationError::Mailbox(error) => error.fmt(f),
            InformationError::Refused(code) => write!(f, "refused by the SubDevice: {code}"),
            InformationError::Fragments { expected, got } => {
                write!(f, "expected {expected} fragments to follow, got {got}")
            }
            InformationError::TooLong => write!(f, "more than {LONGEST} bytes"),
            InformationError::Malformed(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for InformationError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            InformationError::Mailbox(error) => Some(error),
            InformationError::Malformed(error) => Some(error),
            _ => None,
        }
    }
}

impl From<MailboxError> for InformationError {
    fn from(error: MailboxError) -> InformationError {
        InformationError::Mailbox(error)
    }
}

impl From<PayloadError> for InformationError {
    fn from(error: PayloadError) -> InformationError {
        InformationError::Malformed(error)
    }
}

/// Indices of the objects in a list.
pub async fn list(mailbox: &Mailbox, list: ListType, limits: Limits) -> Result<Vec<u16>, InformationError> {
    let code = list.code().to_le_bytes();
    let data =
        request_fragments(mailbox, InformationOpcode::ListRequest, &code, InformationOpcode::ListResponse, 2, limits)
            .await?;
    Ok(Indices(&data[2..]).iter().collect())
}

/// Lengths of the five lists, in the order of [`ListType::LISTS`].
pub async fn lengths(mailbox: &Mailbox, limits: Limits) -> Result<[u16; 5], InformationError> {
    let counts = list(mailbox, ListType::Lengths, limits).await?;
    let short = PayloadError::Short { what: "lengths of the lists", expected: 12, got: 2 + 2 * counts.len() };
    Ok(*counts.first_chunk().ok_or(short)?)
}

/// Description of an object.
pub async fn object(mailbox: &Mailbox, index: u16, limits: Limits) -> Result<Object, InformationError> {
    let (request, response) = (InformationOpcode::ObjectRequest, InformationOpcode::ObjectResponse);
    let data = request_fragments(mailbox, request, &index.to_le_bytes(), response, 2, limits).await?;
    let ObjectDescription { index, data_type, max_sub_index, code, name } = ObjectDescription::decode(&data)?;
    Ok(Object { index, data_type, max_sub_index, code, name: text(name) })
}

/// Description of an entry; `wanted` selects the optional parts.
pub async fn entry(
    mailbox: &Mailbox,
    (index, sub_index): (u16, u8),
    wanted: ValueInfo,
    limits: Limits,
) -> Result<Entry, InformationError> {
    let requested = EntryRequest { index, sub_index, value_info: wanted }.encode();
    let (request, response) = (InformationOpcode::EntryRequest, InformationOpcode::EntryResponse);
    let data = request_fragments(mailbox, request, &requested, response, 3, limits).await?;
    let entry = EntryDescription::decode(&data)?;
    Ok(Entry {
        index: entry.index,
        sub_index: entry.sub_index,
        data_type: entry.data_type,
        bit_length: entry.bit_length,
        access: entry.access,
        unit: entry.unit,
        default: entry.default.map(<[u8]>::to_vec),
        minimum: entry.minimum.map(<[u8]>::to_vec),
        maximum: entry.maximum.map(<[u8]>::to_vec),
        name: text(entry.name),
    })
}

/// Bytes as text; invalid UTF-8 is replaced.
fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

/// A fragment of an answer: its data, and the number of fragments that follow.
type Fragment = (Vec<u8>, u16);

/// Sends a request and joins the fragments of the answer. The answer also starts with the first `key` bytes of the
/// request.
async fn request_fragments(
    mailbox: &Mailbox,
    request: InformationOpcode,
    data: &[u8],
    response: InformationOpcode,
    key: usize,
    limits: Limits,
) -> Result<Vec<u8>, InformationError> {
    let mut conversation = mailbox.conversation_for(Lane::Coe, Function::ObjectDictionary).await?;
    settle(&mut conversation, limits).await?;
    let mut payload = vec![0; SdoInformation::OVERHEAD + data.len()];
    let length = SdoInformation::whole(request, data).encode(&mut payload).unwrap_or(0);
    let first = |payload: &[u8]| take(payload, response, &data[..key]);
    let begun = conversation.begin(&payload[..length], limits, first).await?;
    let (mut all, mut left) = begun.inspect_err(|_| conversation.complete())?;
    while left > 0 {
        let (data, follow) = next(&mut conversation, response, limits).await?;
        if follow != left - 1 {
            return Err(InformationError::Fragments { expected: left - 1, got: follow });
        }
        left = follow;
        all.extend_from_slice(&data);
        if all.len() > LONGEST {
            return Err(InformationError::TooLong);
        }
    }
    conversation.complete();
    Ok(all)
}

async fn next(
    conversation: &mut Conversation,
    response: InformationOpcode,
    limits: Limits,
) -> Result<Fragment, InformationError> {
    conversation.more(limits.answer, |payload| take(payload, response, &[])).await?
}

/// Whether a message belongs to the answer.
fn take(payload: &[u8], response: InformationOpcode, key: &[u8]) -> Option<Result<Fragment, InformationError>> {
    let message = SdoInformation::decode(payload).ok()?;
    if message.opcode == InformationOpcode::Error {
        return Some(message.abort_code().map_err(Into::into).and_then(|code| Err(InformationError::Refused(code))));
    }
    let ours = message.opcode == response && message.data.starts_with(key);
    // Only the incomplete flag counts, not the number: some SubDevices count down to 1.
    let left = if message.incomplete { message.fragments_left.max(1) } else { 0 };
    ours.then(|| Ok((message.data.to_vec(), left)))
}
