//! PDOs by mailbox instead of with the process data (protocol 6.3: RxPDO, TxPDO and the requests for them).

use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;

use ringcat_wire::mailbox::coe::{CoeHeader, CoeService};

use super::transfer::settle;
use crate::mail::lane::Lane;
use crate::mail::{Limits, Mailbox, MailboxError};
use crate::role::Function;

/// The first RxPDO and the first TxPDO; the number in the header counts from them.
const RX_BASE: u16 = 0x1600;
const TX_BASE: u16 = 0x1A00;
/// Number of PDOs in each direction.
const COUNT: u16 = 512;

/// Why a PDO transfer failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PdoMailError {
    /// The mailbox failed, or the SubDevice refused.
    Mailbox(MailboxError),
    /// No PDO of this direction: expected 0x1600..=0x17FF to the SubDevice, these or 0x1A00..=0x1BFF from it.
    Index {
        /// The given index.
        pdo: u16,
    },
}

impl fmt::Display for PdoMailError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            PdoMailError::Mailbox(error) => write!(f, "PDO by mailbox: {error}"),
            PdoMailError::Index { pdo } => write!(f, "PDO by mailbox: {pdo:#06x} is no PDO of this direction"),
        }
    }
}

impl core::error::Error for PdoMailError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            PdoMailError::Mailbox(error) => Some(error),
            _ => None,
        }
    }
}

impl From<MailboxError> for PdoMailError {
    fn from(error: MailboxError) -> PdoMailError {
        PdoMailError::Mailbox(error)
    }
}

/// Sends an RxPDO, which has no answer: a refusal by the SubDevice is counted as an unclaimed error reply.
pub async fn send(mailbox: &Mailbox, pdo: u16, data: &[u8], limit: Duration) -> Result<(), PdoMailError> {
    let number = number(pdo, RX_BASE).ok_or(PdoMailError::Index { pdo })?;
    let mut conversation = mailbox.conversation_for(Lane::Coe, Function::PdoByMailbox).await?;
    let mut payload = CoeHeader { number, ..CoeHeader::new(CoeService::RxPdo) }.encode().to_vec();
    payload.extend_from_slice(data);
    Ok(conversation.send(&payload, limit).await?)
}

/// Requests a TxPDO, or an RxPDO with its current value.
pub async fn receive(mailbox: &Mailbox, pdo: u16, limits: Limits) -> Result<Vec<u8>, PdoMailError> {
    let (number, request, service) = match (number(pdo, TX_BASE), number(pdo, RX_BASE)) {
        (Some(number), _) => (number, CoeService::TxPdoRemote, CoeService::TxPdo),
        (None, Some(number)) => (number, CoeService::RxPdoRemote, CoeService::RxPdo),
        (None, None) => return Err(PdoMailError::Index { pdo }),
    };
    let mut conversation = mailbox.conversation_for(Lane::Coe, Function::PdoByMailbox).await?;
    settle(&mut conversation, limits).await?;
    conversation.mark(pdo);
    let [request, answer] = [request, service].map(|service| CoeHeader { number, ..CoeHeader::new(service) }.encode());
    conversation.expect_pdo(Some(answer));
    let accept = |payload: &[u8]| payload.strip_prefix(&answer).map(<[u8]>::to_vec);
    let data = conversation.request(&request, limits, accept).await;
    conversation.expect_pdo(None);
    Ok(data?)
}

fn number(pdo: u16, base: u16) -> Option<u16> {
    pdo.checked_sub(base).filter(|number| *number < COUNT)
}
