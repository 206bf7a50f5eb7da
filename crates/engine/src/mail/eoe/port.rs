//! The handle to the Ethernet of one SubDevice, and the sending task.

use alloc::rc::Rc;
use core::time::Duration;

use super::fragments::Fragments;
use super::traffic::{EthernetFrame, EthernetStatus, Outgoing, QueueError, TimeStamp};
use crate::mail::conversation::Conversation;
use crate::mail::lane::Lane;
use crate::mail::shared::SharedMailbox;
use crate::mail::{Mailbox, MailboxError};
use crate::role::Function;
use ringcat_wire::mailbox::eoe::EoeFragment;

/// Longest time that a SubDevice may leave a fragment in its mailbox; then its frame is dropped, as a network does.
const SEND_LIMIT: Duration = Duration::from_millis(500);

/// The Ethernet port of one SubDevice: frames to it and from it. A mailbox has at most one port; it is closed when
/// dropped.
///
/// It stays valid while the SubDevice is absent. While the mailbox is not in use, the port is down: frames are refused,
/// and queued frames are dropped and counted.
#[derive(Debug)]
pub struct EthernetPort {
    shared: Rc<SharedMailbox>,
}

impl EthernetPort {
    /// Opens the port of a mailbox; `None` if it is already open.
    pub fn open(mailbox: &Mailbox) -> Option<EthernetPort> {
        let shared = mailbox.shared().clone();
        let attachment = {
            let traffic = &mut shared.state_mut().ethernet;
            if core::mem::replace(&mut traffic.attached, true) {
                return None;
            }
            traffic.attachment = traffic.attachment.wrapping_add(1);
            traffic.attachment
        };
        let own = shared.clone();
        shared.bus.spawn(async move { send_all(own, attachment).await });
        Some(EthernetPort { shared })
    }

    /// Whether it is the port of this mailbox.
    pub(crate) fn is_of(&self, mailbox: &Mailbox) -> bool {
        Rc::ptr_eq(&self.shared, mailbox.shared())
    }

    /// Whether frames can be sent and received.
    pub fn is_up(&self) -> bool {
        is_up(&self.shared)
    }

    /// Queues a frame, without check sequence, for sending.
    pub fn send(&self, frame: &[u8]) -> Result<(), QueueError> {
        self.queue(frame, false).map(drop)
    }

    /// As [`EthernetPort::send`], and requests the time at which the SubDevice forwards the frame: the result is a
    /// [`TimeStamp`] with the returned number.
    pub fn send_with_time(&self, frame: &[u8]) -> Result<u8, QueueError> {
        self.queue(frame, true)
    }

    fn queue(&self, frame: &[u8], wants_time: bool) -> Result<u8, QueueError> {
        if !self.is_up() {
            return Err(QueueError::Down);
        }
        let number = self.shared.state_mut().ethernet.queue(frame, wants_time)?;
        self.shared.changed.notify();
        Ok(number)
    }

    /// Number of frames that can be queued now; 0 while the port is down.
    pub fn room(&self) -> usize {
        if self.is_up() { self.shared.state().ethernet.room() } else { 0 }
    }

    /// Waits until a frame can be queued.
    pub async fn ready(&self) {
        self.shared.changed.until(|| (self.room() > 0).then_some(())).await;
    }

    /// Takes the oldest received frame.
    pub fn pop_frame(&self) -> Option<EthernetFrame> {
        self.shared.state_mut().ethernet.pop_received()
    }

    /// Waits for a frame from the SubDevice.
    pub async fn frame(&self) -> EthernetFrame {
        self.shared.changed.until(|| self.pop_frame()).await
    }

    /// Takes the oldest received time stamp.
    pub fn pop_time_stamp(&self) -> Option<TimeStamp> {
        self.shared.state_mut().ethernet.pop_time_stamp()
    }

    /// Counters, rates, queue length.
    pub fn status(&self) -> EthernetStatus {
        let up = self.is_up();
        self.shared.state_mut().ethernet.status(up, self.shared.bus.now())
    }
}

impl Drop for EthernetPort {
    fn drop(&mut self) {
        {
            let traffic = &mut self.shared.state_mut().ethernet;
            traffic.attached = false;
            traffic.reset();
        }
        self.shared.changed.notify();
    }
}

fn is_up(shared: &SharedMailbox) -> bool {
    let state = shared.state();
    state.session.is_some_and(|session| {
        let size = session.layout.receive_size.min(session.layout.send_size);
        state.open && EoeFragment::max_data(usize::from(size)) > 0
    })
}

/// Sends queued frames until the port is dropped.
async fn send_all(shared: Rc<SharedMailbox>, attachment: u32) {
    loop {
        let work = || {
            let here = {
                let traffic = &shared.state().ethernet;
                (traffic.attached && traffic.attachment == attachment).then(|| traffic.has_outgoing())
            };
            match here {
                None => Some(false),
                Some(any) => (any && is_up(&shared)).then_some(true),
            }
        };
        if !shared.changed.until(work).await {
            return;
        }
        if shared.bus.permit(Function::Ethernet).is_err() {
            while let Some(frame) = next(&shared, attachment) {
                let now = shared.bus.now();
                shared.state_mut().ethernet.sent(frame.bytes.len(), false, now);
            }
            continue;
        }
        // The mailbox was closed meanwhile: its queued frames are dropped, too.
        let Ok(mut conversation) = Conversation::take(&shared, Lane::Frames, Function::Ethernet).await else {
            continue;
        };
        while let Some(frame) = next(&shared, attachment) {
            let result = send(&mut conversation, &frame).await;
            let now = shared.bus.now();
            shared.state_mut().ethernet.sent(frame.bytes.len(), result.is_ok(), now);
            if result == Err(MailboxError::Closed) {
                // When the mailbox is open again, a new conversation is needed.
                break;
            }
        }
    }
}

fn next(shared: &Rc<SharedMailbox>, attachment: u32) -> Option<Outgoing> {
    let frame = {
        let traffic = &mut shared.state_mut().ethernet;
        if traffic.attachment != attachment {
            return None;
        }
        traffic.next_outgoing()
    };
    // A sender may wait for space in the queue.
    shared.changed.notify();
    frame
}

async fn send(conversation: &mut Conversation, frame: &Outgoing) -> Result<(), MailboxError> {
    let size = conversation.mailbox_sizes().receive;
    let Some(fragments) = Fragments::new(&frame.bytes, frame.number, size, frame.wants_time) else {
        return Err(MailboxError::Closed);
    };
    for payload in fragments {
        conversation.send(&payload, SEND_LIMIT).await?;
    }
    Ok(())
}
