//! The SubDevice's end of the mailbox: counters, duplicates, answers in order, repeat of a lost one (facts 6.1, 6.2).
//!
//! In: AL events of the two mailbox SyncManagers, virtual time. Out: messages for a protocol server and its answers in
//! the send mailbox, some time later. What the messages mean is the servers' matter ([`coe`](super::coe)).

use std::collections::VecDeque;

use ringcat_wire::address::RegisterAddress;
use ringcat_wire::mailbox::{ErrorReply, Header, Message, MessageError, Protocol, next_counter};
use ringcat_wire::register::{SyncManager, SyncManagerPdiControl, map};
use ringcat_wire::sii::MailboxLayout;

use super::coe::Answer;
use super::process_data::event_bit;
use crate::controller::Controller;
use crate::time::SimTime;

/// Answers that may wait for the send mailbox; with more, messages stay in the receive mailbox.
const MAX_ANSWERS: usize = 4;

/// An answer on its way.
#[derive(Clone, Debug)]
struct Queued {
    ready: SimTime,
    bytes: Vec<u8>,
}

/// The mailbox of a device while it is in use.
#[derive(Clone, Debug)]
pub struct Mailbox {
    layout: MailboxLayout,
    receive_manager: u8,
    send_manager: u8,
    received_counter: u8,
    sent_counter: u8,
    queue: VecDeque<Queued>,
    /// The answer put into the send mailbox last, and the one before it.
    last: Option<Vec<u8>>,
    before_last: Option<Vec<u8>>,
    repeat: bool,
    /// An answer is ready and the send mailbox is full.
    blocked: bool,
}

impl Mailbox {
    /// The mailbox is taken into use; the repeat request that stands in the register is none (facts 6.2.4).
    pub fn open(
        layout: MailboxLayout,
        (receive_manager, send_manager): (u8, u8),
        controller: &mut Controller,
        now: SimTime,
    ) -> Mailbox {
        let mut mailbox = Mailbox {
            layout,
            receive_manager,
            send_manager,
            received_counter: 0,
            sent_counter: 0,
            queue: VecDeque::new(),
            last: None,
            before_last: None,
            repeat: false,
            blocked: false,
        };
        mailbox.repeat = mailbox.read_send_manager(controller, now).activate.repeat_request;
        mailbox.acknowledge_repeat(controller, now);
        mailbox
    }

    /// Places and sizes.
    pub const fn layout(&self) -> &MailboxLayout {
        &self.layout
    }

    /// AL events that call for a step.
    pub fn events(&self) -> u32 {
        let receive = if self.queue.len() < MAX_ANSWERS { event_bit(self.receive_manager) } else { 0 };
        let send = if self.blocked { event_bit(self.send_manager) } else { 0 };
        receive | send
    }

    /// When the next answer is ready.
    pub fn next_deadline(&self) -> Option<SimTime> {
        if self.blocked { None } else { self.queue.front().map(|queued| queued.ready) }
    }

    /// Takes the message that is in the receive mailbox, if there is one and an answer to it may be queued.
    pub fn take(&mut self, controller: &mut Controller, events: u32, now: SimTime) -> Option<Vec<u8>> {
        if events & event_bit(self.receive_manager) == 0 || self.queue.len() >= MAX_ANSWERS {
            return None;
        }
        let mut bytes = vec![0; usize::from(self.layout.receive_size)];
        controller.pdi_read(RegisterAddress(self.layout.receive_offset), &mut bytes, now).then_some(bytes)
    }

    /// Serves one message with `server`, which gets protocol, payload and the room for its answer. The answer is sent
    /// at `ready` or later.
    pub fn serve(&mut self, bytes: &[u8], ready: SimTime, server: impl FnOnce(Protocol, &[u8], usize) -> Answer) {
        let room = usize::from(self.layout.send_size).saturating_sub(Header::LEN);
        let (header, answer) = match Message::decode(bytes) {
            Ok(Message { header, payload }) => {
                if header.counter != 0 && header.counter == self.received_counter {
                    return;
                }
                self.received_counter = header.counter;
                let answer = if header.channel == 0 {
                    server(header.protocol, payload, room)
                } else {
                    Answer::Error(ErrorReply::INVALID_CHANNEL)
                };
                (header, answer)
            }
            Err(MessageError::Short { .. }) => return,
            Err(MessageError::Length { .. }) => {
                let header = bytes.first_chunk().map_or(Header::new(Protocol::Error, 0, 0), Header::decode);
                (header, Answer::Error(ErrorReply::INVALID_HEADER))
            }
        };
        match answer {
            Answer::Silence => {}
            Answer::Payload(payload) => self.queue(header.protocol, header.address, &payload, ready),
            Answer::Error(detail) => {
                self.queue(Protocol::Error, header.address, &ErrorReply::new(detail).encode(), ready);
            }
        }
    }

    fn queue(&mut self, protocol: Protocol, address: u16, payload: &[u8], ready: SimTime) {
        self.sent_counter = next_counter(self.sent_counter);
        let length = u16::try_from(payload.len()).unwrap_or(u16::MAX);
        let header = Header { address, ..Header::new(protocol, self.sent_counter, length) };
        let mut bytes = header.encode().to_vec();
        bytes.extend_from_slice(payload);
        // The last byte of the SyncManager gives the mailbox away.
        bytes.resize(usize::from(self.layout.send_size), 0);
        self.queue.push_back(Queued { ready, bytes });
    }

    /// Puts the next answer into the send mailbox if it is time and there is room.
    pub fn send(&mut self, controller: &mut Controller, now: SimTime) {
        self.blocked = false;
        let Some(queued) = self.queue.front() else {
            return;
        };
        if queued.ready > now {
            return;
        }
        if !controller.pdi_write(RegisterAddress(self.layout.send_offset), &queued.bytes, now) {
            self.blocked = true;
            return;
        }
        self.before_last = self.last.take();
        self.last = self.queue.pop_front().map(|queued| queued.bytes);
        // What is ready too waits until this one is read.
        self.blocked = self.queue.front().is_some_and(|next| next.ready <= now);
    }

    /// The activation of a SyncManager changed: repeats the last answer if that is what the MainDevice asks for.
    pub fn check_repeat(&mut self, controller: &mut Controller, now: SimTime) {
        let manager = self.read_send_manager(controller, now);
        if manager.activate.repeat_request == self.repeat {
            return;
        }
        self.repeat = manager.activate.repeat_request;
        let lost = if manager.status.mailbox_full {
            // The message that waits was put there after the lost one had been read; it goes second.
            if let Some(waiting) = self.last.take() {
                self.queue.push_front(Queued { ready: now, bytes: waiting });
            }
            self.empty_send_mailbox(controller, now);
            self.before_last.take()
        } else {
            self.last.take()
        };
        if let Some(bytes) = lost {
            self.queue.push_front(Queued { ready: now, bytes });
        }
        self.send(controller, now);
        self.acknowledge_repeat(controller, now);
    }

    /// Switching a SyncManager off and on again discards what is in it.
    fn empty_send_mailbox(&self, controller: &mut Controller, now: SimTime) {
        for deactivate in [true, false] {
            self.write_pdi_control(deactivate, !self.repeat, controller, now);
        }
    }

    fn acknowledge_repeat(&self, controller: &mut Controller, now: SimTime) {
        self.write_pdi_control(false, self.repeat, controller, now);
    }

    fn write_pdi_control(&self, deactivate: bool, repeat_acknowledge: bool, controller: &mut Controller, now: SimTime) {
        let control = SyncManagerPdiControl { deactivate, repeat_acknowledge, ..SyncManagerPdiControl::default() };
        let address = map::sync_manager(self.send_manager).offset(SyncManager::PDI_CONTROL);
        controller.pdi_write(address, &control.encode(), now);
    }

    fn read_send_manager(&self, controller: &mut Controller, now: SimTime) -> SyncManager {
        let mut bytes = [0; SyncManager::LEN];
        controller.pdi_read(map::sync_manager(self.send_manager), &mut bytes, now);
        SyncManager::decode(&bytes)
    }
}
