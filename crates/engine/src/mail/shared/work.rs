//! Work for the tasks of a mailbox: starts a task that is not running.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::mailbox::Header;
use ringcat_wire::mailbox::coe::pdo_objects::is_of_pdos;
use ringcat_wire::mailbox::sdo::SdoRequest;

use super::SharedMailbox;
use crate::mail::error::MailboxError;
use crate::mail::lane::{Lane, Outgoing};
use crate::mail::{reader, writer};

/// Whether a message begins a download to an object of PDO assignment or mapping.
fn writes_pdos(payload: &[u8]) -> bool {
    match SdoRequest::decode(payload) {
        Ok(SdoRequest::DownloadExpedited { index, .. } | SdoRequest::DownloadNormal { index, .. }) => is_of_pdos(index),
        _ => false,
    }
}

impl SharedMailbox {
    /// Queues a message; returns its number.
    pub(in crate::mail) fn queue(
        self: &Rc<SharedMailbox>,
        lane: Lane,
        payload: Vec<u8>,
        limit: Duration,
        (turn, answer_limit): (u32, Option<Duration>),
    ) -> Result<u32, MailboxError> {
        let id = {
            let state = &mut *self.state_mut();
            let session = state.session.as_ref().filter(|_| state.open).ok_or(MailboxError::Closed)?;
            let capacity = usize::from(session.layout.receive_size).saturating_sub(Header::LEN);
            if payload.len() > capacity {
                return Err(MailboxError::TooLong { bytes: payload.len(), limit: capacity });
            }
            let queue = state.lanes.of_mut(lane);
            if !queue.has_space() {
                state.counters.refused += 1;
                return Err(MailboxError::Full { limit });
            }
            state.next_id = state.next_id.wrapping_add(1);
            state.has_written_pdos |= lane == Lane::Coe && writes_pdos(&payload);
            queue.outbox.push_back(Outgoing { id: state.next_id, lane, payload, limit, turn, answer_limit });
            state.next_id
        };
        writer::start(self);
        Ok(id)
    }

    /// Opens a suspended mailbox again, with the same session.
    pub(in crate::mail) fn resume(self: &Rc<SharedMailbox>) {
        {
            let state = &mut *self.state_mut();
            if state.open || state.session.is_none() {
                return;
            }
            let repeat = state.repeat;
            let now = self.bus.now();
            state.begin_epoch(true);
            state.repeat = repeat;
            state.lanes.iter_mut().for_each(|lane| lane.resume(now));
        }
        self.notify_all();
        reader::start(self);
    }

    /// The send mailbox is full, or may be: the reader reads it.
    pub(in crate::mail) fn mail_available(self: &Rc<SharedMailbox>) {
        {
            let state = &mut *self.state_mut();
            state.full = true;
            state.available_at = self.bus.now();
        }
        reader::start(self);
    }

    /// The reader polls the status of the send mailbox once.
    pub(in crate::mail) fn poll_once(self: &Rc<SharedMailbox>) {
        self.state_mut().poll_requested = true;
        reader::start(self);
    }
}
