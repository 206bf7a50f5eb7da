//! Messages of the application's own making: any payload, in the lane of a protocol or of any other type of mail
//! ([`Lane::of`]).
//!
//! Header and counter are the router's, so that they do not disturb other conversations.

use alloc::vec::Vec;
use core::time::Duration;

use super::lane::Lane;
use super::talk::Limits;
use super::{Mailbox, MailboxError};

/// Sends a message and waits until the SubDevice has it. An answer to it is kept as mail that nobody asked for.
pub async fn send(mailbox: &Mailbox, lane: Lane, payload: &[u8], limit: Duration) -> Result<(), MailboxError> {
    mailbox.talk(lane).await?.send(payload, limit).await
}

/// Sends a message and waits for the next one that comes back in the lane, whatever it is, but for what surely comes
/// unasked: emergencies and PDOs (CoE), notifications (SoE), requests (AoE), Ethernet frames (EoE).
pub async fn exchange(mailbox: &Mailbox, lane: Lane, payload: &[u8], limits: Limits) -> Result<Vec<u8>, MailboxError> {
    let mut talk = mailbox.talk(lane).await?;
    talk.settle().await?;
    talk.expect_any(true);
    talk.ask(payload, limits, |payload| Some(payload.to_vec())).await
}
