//! VoE: messages of a vendor to and from a SubDevice (protocol 6.8). Their meaning is vendor-specific.

use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::mailbox::voe::VoeMessage;

use super::conversation::{Conversation, Limits};
use super::lane::Lane;
use super::unsolicited::Unsolicited;
use super::{Mailbox, MailboxError};

/// First pause between two polls for a message; the pauses grow.
const FIRST_PAUSE: Duration = Duration::from_micros(200);
/// Longest pause.
const LONGEST_PAUSE: Duration = Duration::from_millis(2);

/// A message of a vendor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Voe {
    /// Vendor, as in the identity.
    pub vendor_id: u32,
    /// Vendor-specific type of the message.
    pub vendor_type: u16,
    /// The data.
    pub data: Vec<u8>,
}

/// Sends a message and waits until the SubDevice has accepted it.
pub async fn send(mailbox: &Mailbox, message: &Voe, limit: Duration) -> Result<(), MailboxError> {
    let mut conversation = mailbox.conversation(Lane::Voe).await?;
    let payload = encode(&conversation, message)?;
    conversation.send(&payload, limit).await
}

/// Sends a whole message, with its header, and waits until the SubDevice has accepted it.
pub(crate) async fn send_whole(mailbox: &Mailbox, message: &[u8], limit: Duration) -> Result<(), MailboxError> {
    let mut conversation = mailbox.conversation(Lane::Voe).await?;
    let (bytes, capacity) = (message.len(), conversation.request_capacity());
    if bytes > capacity {
        return Err(MailboxError::TooLong { bytes, limit: capacity });
    }
    conversation.send(message, limit).await
}

/// Sends a message and waits for the next message of the same vendor.
pub async fn exchange(mailbox: &Mailbox, message: &Voe, limits: Limits) -> Result<Voe, MailboxError> {
    let mut conversation = mailbox.conversation(Lane::Voe).await?;
    conversation.settle().await?;
    let payload = encode(&conversation, message)?;
    let accept = |payload: &[u8]| decode(payload).filter(|answer| answer.vendor_id == message.vendor_id);
    conversation.request(&payload, limits, accept).await
}

/// Waits for a message that is not an answer to [`exchange`], and polls the mailbox's status meanwhile. Malformed
/// messages are skipped.
pub async fn receive(mailbox: &Mailbox, limit: Duration) -> Result<Voe, MailboxError> {
    wait(mailbox, limit, Mailbox::poll_once).await
}

/// As [`receive`], but reads the mailbox without polling its status.
pub async fn receive_directly(mailbox: &Mailbox, limit: Duration) -> Result<Voe, MailboxError> {
    wait(mailbox, limit, Mailbox::mail_available).await
}

async fn wait(mailbox: &Mailbox, limit: Duration, poll: impl Fn(&Mailbox)) -> Result<Voe, MailboxError> {
    let bus = mailbox.bus();
    let (until, mut pause) = (bus.now() + limit, Duration::ZERO);
    loop {
        let left = until.since(bus.now());
        match mailbox.unsolicited_within(Unsolicited::Voe, pause.min(left)).await? {
            Some(unclaimed) => {
                if let Some(message) = decode(&unclaimed.payload) {
                    return Ok(message);
                }
            }
            None if left.is_zero() => return Err(MailboxError::NoAnswer { limit }),
            None => {
                poll(mailbox);
                pause = (pause * 3 / 2).clamp(FIRST_PAUSE, LONGEST_PAUSE);
            }
        }
    }
}

fn encode(conversation: &Conversation, message: &Voe) -> Result<Vec<u8>, MailboxError> {
    let Voe { vendor_id, vendor_type, ref data } = *message;
    let (bytes, limit) = (VoeMessage::OVERHEAD + data.len(), conversation.request_capacity());
    let mut payload = vec![0; limit];
    let length = VoeMessage { vendor_id, vendor_type, data }.encode(&mut payload);
    payload.truncate(length.ok_or(MailboxError::TooLong { bytes, limit })?);
    Ok(payload)
}

fn decode(payload: &[u8]) -> Option<Voe> {
    let VoeMessage { vendor_id, vendor_type, data } = VoeMessage::decode(payload).ok()?;
    Some(Voe { vendor_id, vendor_type, data: data.to_vec() })
}
