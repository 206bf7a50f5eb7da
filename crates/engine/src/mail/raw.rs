//! Messages with any payload from the application, in the lane of a protocol or of any other mail type ([`Lane::of`]).
//!
//! The router sets header and counter, so that these messages do not disturb other conversations.

use alloc::vec::Vec;
use core::time::Duration;

use super::conversation::Limits;
use super::lane::Lane;
use super::{Mailbox, MailboxError};
use crate::role::Function;

/// Sends a message and waits until the SubDevice has accepted it. An answer is kept as unsolicited mail.
pub async fn send(mailbox: &Mailbox, lane: Lane, payload: &[u8], limit: Duration) -> Result<(), MailboxError> {
    mailbox.conversation_for(lane, Function::RawMailbox).await?.send(payload, limit).await
}

/// Sends a message and waits for the next mail in the lane, whatever its content, except certainly unsolicited mail:
/// emergencies and PDOs (CoE), notifications (SoE), requests (AoE), Ethernet frames (EoE).
pub async fn exchange(mailbox: &Mailbox, lane: Lane, payload: &[u8], limits: Limits) -> Result<Vec<u8>, MailboxError> {
    let mut conversation = mailbox.conversation_for(lane, Function::RawMailbox).await?;
    conversation.settle().await?;
    conversation.expect_any(true);
    conversation.request(payload, limits, |payload| Some(payload.to_vec())).await
}
