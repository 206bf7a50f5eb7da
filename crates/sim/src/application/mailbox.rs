//! The mailbox of the SubDevice: counters, duplicates, order of responses, repetition of a lost response (protocol 6.1,
//! 6.2).
//!
//! Input: AL events of the two mailbox SyncManagers, virtual time, [`faults`]. Output: messages for a protocol server
//! and, after the response time, its responses in the send mailbox, interleaved with unsolicited mail. The servers
//! ([`servers`](super::servers)) interpret the messages.

pub mod faults;
pub mod record;

use std::collections::VecDeque;

use ringcat_wire::address::RegisterAddress;
use ringcat_wire::mailbox::{ErrorReply, Header, Message, MessageError, Protocol, next_counter};
use ringcat_wire::register::{SyncManager, SyncManagerPdiControl, map};
use ringcat_wire::sii::MailboxLayout;

use super::answer::Answer;
use super::process_data::event_bit;
use crate::controller::Controller;
use crate::time::SimTime;
use faults::MailFaults;

/// Maximum number of responses waiting for the send mailbox; beyond it, messages stay in the receive mailbox.
const MAX_ANSWERS: usize = 4;

/// Maximum number of unsolicited messages of servers waiting; more would delay requests too long.
const MAX_OWN: usize = 2;
/// Maximum number of messages waiting for the send mailbox, responses and others; further unsolicited messages are
/// dropped.
const MAX_POSTED: usize = 64;

/// A message that waits for the send mailbox.
#[derive(Clone, Debug)]
struct Queued {
    ready: SimTime,
    mail: Mail,
    /// Whether the message is written twice with the same counter.
    twice: bool,
}

#[derive(Clone, Debug)]
enum Mail {
    /// A new message. Its counter is assigned when it is sent, unless a fault sets this value.
    New { protocol: Protocol, address: u16, payload: Vec<u8>, counter: Option<u8> },
    /// A repetition, byte for byte.
    Again(Vec<u8>),
}

/// The mailbox of a device in operation.
#[derive(Clone, Debug)]
pub struct Mailbox {
    layout: MailboxLayout,
    receive_manager: u8,
    send_manager: u8,
    received_counter: u8,
    sent_counter: u8,
    queue: VecDeque<Queued>,
    /// The last response written to the send mailbox, and the one before it.
    last: Option<Vec<u8>>,
    before_last: Option<Vec<u8>>,
    repeat: bool,
    /// Whether a response is ready while the send mailbox is full.
    blocked: bool,
}

impl Mailbox {
    /// Opens the mailbox; the current value of the repeat request in the register is the initial one (protocol 6.2,
    /// step 4).
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

    /// Addresses and lengths.
    pub const fn layout(&self) -> &MailboxLayout {
        &self.layout
    }

    /// AL events that require a step.
    pub fn events(&self, faults: &MailFaults) -> u32 {
        let takes = self.queue.len() < MAX_ANSWERS && faults.full_until().is_none();
        let receive = if takes { event_bit(self.receive_manager) } else { 0 };
        let send = if self.blocked { event_bit(self.send_manager) } else { 0 };
        receive | send
    }

    /// Time at which the next message is ready for sending.
    pub fn next_deadline(&self) -> Option<SimTime> {
        if self.blocked { None } else { self.queue.iter().map(|queued| queued.ready).min() }
    }

    /// Takes the message from the receive mailbox, if there is one and its response can be queued.
    pub fn take(
        &mut self,
        controller: &mut Controller,
        events: u32,
        faults: &MailFaults,
        now: SimTime,
    ) -> Option<Vec<u8>> {
        let event = event_bit(self.receive_manager);
        if events & self.events(faults) & event == 0 {
            return None;
        }
        let mut bytes = vec![0; usize::from(self.layout.receive_size)];
        controller.pdi_read(RegisterAddress(self.layout.receive_offset), &mut bytes, now).then_some(bytes)
    }

    /// Serves one message with `server`, which receives protocol and payload. Its responses are sent at `ready` or
    /// later.
    pub fn serve(
        &mut self,
        bytes: &[u8],
        ready: SimTime,
        faults: &mut MailFaults,
        server: impl FnOnce(Protocol, &[u8]) -> Answer,
    ) {
        let (header, answer) = match Message::decode(bytes) {
            Ok(Message { header, payload }) => {
                if header.counter != 0 && header.counter == self.received_counter {
                    return;
                }
                self.received_counter = header.counter;
                let answer = if header.channel != 0 {
                    Answer::Error(ErrorReply::INVALID_CHANNEL)
                } else if let Some(answer) = faults.instead_of_serving(header.protocol, payload) {
                    answer
                } else {
                    server(header.protocol, payload)
                };
                (header, answer)
            }
            Err(MessageError::Short { .. }) => return,
            Err(MessageError::Length { .. }) => {
                let header = bytes.first_chunk().map_or(Header::new(Protocol::Error, 0, 0), Header::decode);
                (header, Answer::Error(ErrorReply::INVALID_HEADER))
            }
        };
        let (protocol, payloads) = match answer {
            Answer::Silence => return,
            Answer::Payloads(payloads) => (header.protocol, payloads),
            Answer::Error(detail) => (Protocol::Error, vec![ErrorReply::new(detail).encode().to_vec()]),
        };
        for payload in payloads {
            self.queue(protocol, header.address, payload, ready, faults);
        }
    }

    /// Whether servers may add unsolicited messages.
    pub fn has_room(&self) -> bool {
        self.queue.len() < MAX_OWN
    }

    /// Largest payload of a message from the MainDevice, after the header.
    pub fn receive_room(&self) -> usize {
        usize::from(self.layout.receive_size).saturating_sub(Header::LEN)
    }

    /// Largest payload of a message to the MainDevice, after the header.
    pub fn room(&self) -> usize {
        usize::from(self.layout.send_size).saturating_sub(Header::LEN)
    }

    /// Sends an unsolicited message; false if too many are waiting.
    pub fn post(&mut self, protocol: Protocol, payload: Vec<u8>, ready: SimTime) -> bool {
        if self.queue.len() >= MAX_POSTED || payload.len() > self.room() {
            return false;
        }
        self.queue.push_back(Queued {
            ready,
            mail: Mail::New { protocol, address: 0, payload, counter: None },
            twice: false,
        });
        true
    }

    fn queue(&mut self, protocol: Protocol, address: u16, payload: Vec<u8>, ready: SimTime, faults: &mut MailFaults) {
        let Some(effect) = faults.answer() else {
            return;
        };
        let ready = ready + effect.delay;
        if let Some(payload) = effect.before {
            let mail = Mail::New { protocol: Protocol::Coe, address: 0, payload, counter: None };
            self.queue.push_back(Queued { ready, mail, twice: false });
        }
        let mail = Mail::New { protocol, address, payload, counter: effect.counter };
        self.queue.push_back(Queued { ready, mail, twice: effect.twice });
    }

    fn encode(&mut self, mail: Mail) -> Vec<u8> {
        let (protocol, address, payload, counter) = match mail {
            Mail::New { protocol, address, payload, counter } => (protocol, address, payload, counter),
            Mail::Again(bytes) => return bytes,
        };
        let counter = counter.unwrap_or_else(|| {
            self.sent_counter = next_counter(self.sent_counter);
            self.sent_counter
        });
        let length = u16::try_from(payload.len()).unwrap_or(u16::MAX);
        let header = Header { address, ..Header::new(protocol, counter, length) };
        let mut bytes = header.encode().to_vec();
        bytes.extend_from_slice(&payload);
        // The last byte of the SyncManager completes the mailbox.
        bytes.resize(usize::from(self.layout.send_size), 0);
        bytes
    }

    /// Writes the next ready message to the send mailbox if that is empty.
    pub fn send(&mut self, controller: &mut Controller, now: SimTime) {
        self.blocked = false;
        let Some(place) = self.queue.iter().position(|queued| queued.ready <= now) else {
            return;
        };
        let Some(Queued { ready, mail, twice }) = self.queue.remove(place) else {
            return;
        };
        let bytes = self.encode(mail);
        if !controller.pdi_write(RegisterAddress(self.layout.send_offset), &bytes, now) {
            // The message has its counter and remains the next one.
            self.queue.push_front(Queued { ready, mail: Mail::Again(bytes), twice });
            self.blocked = true;
            return;
        }
        if twice {
            self.queue.push_front(Queued { ready: now, mail: Mail::Again(bytes.clone()), twice: false });
        }
        self.before_last = self.last.replace(bytes);
        // Further ready messages wait until this one is read.
        self.blocked = self.queue.iter().any(|next| next.ready <= now);
    }

    /// Handles a changed activation of a SyncManager: repeats the last response if the MainDevice requests it.
    pub fn check_repeat(&mut self, controller: &mut Controller, now: SimTime) {
        let manager = self.read_send_manager(controller, now);
        if manager.activate.repeat_request == self.repeat {
            return;
        }
        self.repeat = manager.activate.repeat_request;
        let lost = if manager.status.mailbox_full {
            // The waiting message was written after the lost response had been read; it follows the repetition.
            if let Some(waiting) = self.last.take() {
                self.queue.push_front(Queued { ready: now, mail: Mail::Again(waiting), twice: false });
            }
            self.empty_send_mailbox(controller, now);
            self.before_last.take()
        } else {
            self.last.take()
        };
        if let Some(bytes) = lost {
            self.queue.push_front(Queued { ready: now, mail: Mail::Again(bytes), twice: false });
        }
        self.send(controller, now);
        self.acknowledge_repeat(controller, now);
    }

    /// Disables and enables the SyncManager, which discards its content.
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
