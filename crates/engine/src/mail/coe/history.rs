//! The diagnosis history of a SubDevice (object 0x10F3, protocol 6.3).

use alloc::vec::Vec;

use ringcat_wire::mailbox::coe::{DiagnosisFlags, DiagnosisHistory};
use ringcat_wire::mailbox::sdo::AbortCode;

use super::{SdoAddress, SdoError, SdoFailure, read, write};
use crate::mail::{Limits, Mailbox};

/// Longest message that is read.
const LONGEST: usize = 4096;

/// The diagnosis history of a SubDevice.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct History {
    /// Largest number of messages.
    pub maximum: u8,
    /// Subindex of the newest message; 0 if there is none.
    pub newest: u8,
    /// Subindex of the newest acknowledged message; 0 if there is none.
    pub acknowledged: u8,
    /// Some messages were not acknowledged.
    pub new_available: bool,
    /// Settings and flags of lost messages.
    pub flags: DiagnosisFlags,
    /// The messages, the oldest first.
    pub messages: Vec<HistoryMessage>,
}

/// A message of the diagnosis history.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct HistoryMessage {
    /// Its subindex.
    pub sub_index: u8,
    /// Its bytes; [`DiagnosisMessage`](ringcat_wire::mailbox::coe::DiagnosisMessage) decodes them.
    pub bytes: Vec<u8>,
}

/// Reads the history with all its messages.
pub async fn read_history(mailbox: &Mailbox, limits: Limits) -> Result<History, SdoError> {
    let maximum = byte(mailbox, DiagnosisHistory::MAXIMUM_MESSAGES, limits).await?;
    let newest = byte(mailbox, DiagnosisHistory::NEWEST_MESSAGE, limits).await?;
    let acknowledged = byte(mailbox, DiagnosisHistory::NEWEST_ACKNOWLEDGED, limits).await?;
    let new_available = byte(mailbox, DiagnosisHistory::NEW_AVAILABLE, limits).await? != 0;
    let flags = read(mailbox, at(DiagnosisHistory::FLAGS), limits, 4).await?;
    let flags = flags.first_chunk().map_or(0, |bytes| u16::from_le_bytes(*bytes));
    let first = DiagnosisHistory::FIRST_MESSAGE;
    let last = first.saturating_add(maximum.saturating_sub(1));
    // Once all slots have been used, the one after the newest is the oldest.
    let places =
        (first..=last).cycle().skip_while(|place| newest >= first && newest <= last && *place != newest).skip(1);
    let mut messages = Vec::new();
    if newest != 0 {
        for place in places.take(usize::from(maximum)) {
            match read(mailbox, at(place), limits, LONGEST).await {
                Ok(bytes) if bytes.is_empty() => {}
                Ok(bytes) => messages.push(HistoryMessage { sub_index: place, bytes }),
                // A slot that was never used.
                Err(error) if is_unused(&error) => {}
                Err(error) => return Err(error),
            }
        }
    }
    Ok(History { maximum, newest, acknowledged, new_available, flags: DiagnosisFlags(flags), messages })
}

/// Acknowledges all messages up to the one at a subindex; 0 clears the history.
pub async fn acknowledge(mailbox: &Mailbox, sub_index: u8, limits: Limits) -> Result<(), SdoError> {
    write(mailbox, at(DiagnosisHistory::NEWEST_ACKNOWLEDGED), &[sub_index], limits).await
}

fn at(sub_index: u8) -> SdoAddress {
    SdoAddress::new(DiagnosisHistory::INDEX, sub_index)
}

async fn byte(mailbox: &Mailbox, sub_index: u8, limits: Limits) -> Result<u8, SdoError> {
    Ok(read(mailbox, at(sub_index), limits, 4).await?.first().copied().unwrap_or(0))
}

fn is_unused(error: &SdoError) -> bool {
    let unused = [AbortCode::SUB_INDEX_DOES_NOT_EXIST, AbortCode::NO_DATA];
    matches!(error.cause, SdoFailure::Aborted(code) if unused.contains(&code))
}
