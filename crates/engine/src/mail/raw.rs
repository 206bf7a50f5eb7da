//! Messages that the application composes: any payload, in the lane of a protocol or of any other mail type
//! ([`Lane::of`]).
//!
//! The router sets header and counter, so that other conversations are not disturbed.

use alloc::vec::Vec;
use core::time::Duration;

use super::lane::Lane;
use super::talk::Limits;
use super::{Mailbox, MailboxError};

/// Sends a message and waits until the SubDevice accepted it. An answer to it is kept as unsolicited mail.
pub async fn send(mailbox: &Mailbox, lane: Lane, payload: &[u8], limit: Duration) -> Result<(), MailboxError> {
    mailbox.talk(lane).await?.send(payload, limit).await
}

/// Sends a message and waits for the next mail in the lane, whatever its content, except certainly unsolicited mail:
/// emergencies and PDOs (CoE), notifications (SoE), requests (AoE), Ethernet frames (EoE).
pub async fn exchange(mailbox: &Mailbox, lane: Lane, payload: &[u8], limits: Limits) -> Result<Vec<u8>, MailboxError> {
    let mut talk = mailbox.talk(lane).await?;
    talk.settle().await?;
    talk.expect_any(true);
    talk.ask(payload, limits, |payload| Some(payload.to_vec())).await
}
