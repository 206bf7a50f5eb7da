//! A SubDevice that consists of a mailbox only: two SyncManagers, counters, the repeat request (protocol 6.1, 6.2).

use alloc::collections::VecDeque;
use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::command::Command;
use ringcat_wire::datagram::HEADER_LEN;
use ringcat_wire::frame::Frame;
use ringcat_wire::mailbox::{Header, Message, Protocol, next_counter};
use ringcat_wire::sii::MailboxLayout;

use crate::time::Instant;

pub const STATION: u16 = 0x1001;
const STATUS: u16 = 0x080D;
const ACTIVATE: u16 = 0x080E;
const PDI_CONTROL: u16 = 0x080F;

/// Answers of the application.
pub trait Server {
    fn serve(&mut self, protocol: Protocol, payload: &[u8]) -> Vec<(Protocol, Vec<u8>)>;
}

pub struct Device<S> {
    pub server: S,
    pub layout: MailboxLayout,
    pub delay: Duration,
    begun: Vec<u8>,
    received: Option<Vec<u8>>,
    ready: Option<Vec<u8>>,
    queue: VecDeque<(Instant, Vec<u8>)>,
    last: Option<Vec<u8>>,
    before_last: Option<Vec<u8>>,
    received_counter: u8,
    sent_counter: u8,
    repeat: bool,
    /// Counters of the served messages, for the checks.
    pub served: Vec<u8>,
}

impl<S: Server> Device<S> {
    pub fn new(size: u16, server: S) -> Device<S> {
        let layout =
            MailboxLayout { receive_offset: 0x1000, receive_size: size, send_offset: 0x1000 + size, send_size: size };
        Device {
            server,
            layout,
            delay: Duration::from_micros(300),
            begun: Vec::new(),
            received: None,
            ready: None,
            queue: VecDeque::new(),
            last: None,
            before_last: None,
            received_counter: 0,
            sent_counter: 0,
            repeat: false,
            served: Vec::new(),
        }
    }

    /// Queues unsolicited mail.
    pub fn queue_mail(&mut self, protocol: Protocol, payload: &[u8], now: Instant) {
        self.sent_counter = next_counter(self.sent_counter);
        let mut mail = Header::new(protocol, self.sent_counter, payload.len() as u16).encode().to_vec();
        mail.extend_from_slice(payload);
        mail.resize(usize::from(self.layout.send_size), 0);
        self.queue.push_back((now, mail));
    }

    /// Queues unsolicited mail before all waiting mail.
    pub fn queue_first(&mut self, protocol: Protocol, payload: &[u8], now: Instant) {
        self.queue_mail(protocol, payload, now);
        if let Some(mail) = self.queue.pop_back() {
            self.queue.push_front(mail);
        }
    }

    /// Runs the application.
    pub fn run(&mut self, now: Instant) {
        // With several answers queued, the SubDevice accepts no further message.
        if self.queue.len() < 4
            && let Some(mail) = self.received.take()
            && let Ok(message) = Message::decode(&mail)
            && message.header.counter != self.received_counter
        {
            self.received_counter = message.header.counter;
            self.served.push(message.header.counter);
            for (protocol, payload) in self.server.serve(message.header.protocol, message.payload) {
                self.queue_mail(protocol, &payload, now + self.delay);
            }
        }
        if self.ready.is_none() && self.queue.front().is_some_and(|(at, _)| *at <= now) {
            self.ready = self.queue.pop_front().map(|(_, mail)| mail);
            self.before_last = self.last.take();
            self.last.clone_from(&self.ready);
        }
    }

    fn request_repeat(&mut self, now: Instant) {
        let lost = if let Some(waiting) = self.ready.take() {
            self.last = None;
            self.queue.push_front((now, waiting));
            self.before_last.take()
        } else {
            self.last.take()
        };
        if let Some(mail) = lost {
            self.queue.push_front((now, mail));
        }
        self.run(now);
    }

    /// Processes a frame.
    pub fn pass(&mut self, frame: &mut [u8], now: Instant) {
        self.run(now);
        let datagrams: Vec<_> = {
            let parsed = Frame::parse(frame).unwrap();
            let mut at = parsed.payload_offset();
            let datagram_at = |datagram: ringcat_wire::datagram::Datagram<'_>| {
                let data = at + HEADER_LEN;
                at = data + datagram.data.len() + 2;
                let header = datagram.header;
                (header.command, header.adp(), header.ado().0, data..data + datagram.data.len())
            };
            parsed.datagrams().map(datagram_at).collect()
        };
        for (command, station, register, data) in datagrams {
            let end = data.end;
            if station == STATION && self.access(command, register, &mut frame[data], now) {
                let wkc = u16::from_le_bytes([frame[end], frame[end + 1]]) + 1;
                frame[end..end + 2].copy_from_slice(&wkc.to_le_bytes());
            }
        }
        frame[6] |= 0x02;
        self.run(now);
    }

    fn access(&mut self, command: Command, register: u16, data: &mut [u8], now: Instant) -> bool {
        match (command, register) {
            (Command::Fpwr, at) if at == self.layout.receive_offset => {
                let free = self.received.is_none();
                if free {
                    self.begun = data.to_vec();
                    self.begun.resize(usize::from(self.layout.receive_size), 0);
                    if data.len() == self.begun.len() {
                        self.received = Some(core::mem::take(&mut self.begun));
                    }
                }
                free
            }
            // The last byte completes the write.
            (Command::Fpwr, at) if at == self.layout.receive_offset + self.layout.receive_size - 1 => {
                let complete = self.received.is_none() && !self.begun.is_empty();
                if complete {
                    self.received = Some(core::mem::take(&mut self.begun));
                }
                complete
            }
            (Command::Fprd, at) if at == self.layout.send_offset => match self.ready.take() {
                Some(mail) => {
                    data.copy_from_slice(&mail);
                    true
                }
                None => false,
            },
            (Command::Fprd, STATUS) => {
                data[0] = if self.ready.is_some() { 0x08 } else { 0 };
                true
            }
            (Command::Fprd, ACTIVATE) => {
                data[0] = 0x01 | if self.repeat { 0x02 } else { 0 };
                true
            }
            (Command::Fpwr, ACTIVATE) => {
                let repeat = data[0] & 0x02 != 0;
                if repeat != self.repeat {
                    self.repeat = repeat;
                    self.request_repeat(now);
                }
                true
            }
            (Command::Fprd, PDI_CONTROL) => {
                data[0] = if self.repeat { 0x02 } else { 0 };
                true
            }
            _ => false,
        }
    }
}

/// Pseudo-random bytes from a seed, for objects and files.
pub fn pattern(seed: u32, length: usize) -> Vec<u8> {
    let mut bytes = vec![0; length];
    let mut state = seed | 1;
    for byte in &mut bytes {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *byte = (state >> 24) as u8;
    }
    bytes
}
