//! One request and its answer through a SubDevice's mailbox (facts 6.1, 6.2).
//!
//! A lost write is sent again with the same counter, so that the SubDevice drops it where the first one had arrived; a
//! lost read is healed with the repeat request. Mail that is no answer is not mistaken for one.

use alloc::vec;
use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;

use ringcat_wire::address::{RegisterAddress, StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::mailbox::{ErrorReply, Header, Message, Protocol, next_counter};
use ringcat_wire::register::{SyncManager, SyncManagerActivate, SyncManagerPdiControl, map};
use ringcat_wire::sii::MailboxLayout;

use crate::supervisor::{Bus, BusError, Reply};

/// Pause between two looks into an empty or full mailbox.
const PAUSE: Duration = Duration::from_micros(500);
/// How long a SubDevice may take to repeat its last mail.
const REPEAT_LIMIT: Duration = Duration::from_millis(100);
/// A lost access is healed so often.
const RETRIES: usize = 5;
/// SyncManager of the send mailbox (SubDevice to MainDevice).
const SEND_SYNC_MANAGER: u8 = 1;

/// Why there is no answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MailboxError {
    /// The bus failed.
    Bus(BusError),
    /// The message does not fit.
    TooLong {
        /// Bytes of the message.
        bytes: usize,
        /// Bytes that fit.
        limit: usize,
    },
    /// The SubDevice did not empty its receive mailbox in time.
    Full {
        /// How long was waited.
        limit: Duration,
    },
    /// No answer in time.
    NoAnswer {
        /// How long was waited.
        limit: Duration,
    },
    /// The SubDevice did not repeat a mail that was lost on the way.
    NotRepeated,
    /// The SubDevice answered with a mailbox error.
    Error(ErrorReply),
}

impl fmt::Display for MailboxError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            MailboxError::Bus(error) => error.fmt(f),
            MailboxError::TooLong { bytes, limit } => {
                write!(f, "message of {bytes} bytes, the mailbox takes {limit}")
            }
            MailboxError::Full { limit } => write!(f, "mailbox still full after {} ms", limit.as_millis()),
            MailboxError::NoAnswer { limit } => write!(f, "no answer within {} ms", limit.as_millis()),
            MailboxError::NotRepeated => f.write_str("a lost mail was not repeated"),
            MailboxError::Error(reply) => match reply.detail_name() {
                Some(name) => write!(f, "mailbox error {:#06x}: {name}", reply.detail),
                None => write!(f, "mailbox error {:#06x}", reply.detail),
            },
        }
    }
}

impl core::error::Error for MailboxError {}

impl From<BusError> for MailboxError {
    fn from(error: BusError) -> MailboxError {
        MailboxError::Bus(error)
    }
}

/// The MainDevice's end of a SubDevice's mailbox.
#[derive(Debug)]
pub struct Mailbox {
    station: StationAddress,
    layout: MailboxLayout,
    /// Counter of the last message sent.
    counter: u8,
    /// Counter of the last message received; 0 before the first.
    received: u8,
    /// The repeat request bit as last written.
    repeat: bool,
}

impl Mailbox {
    /// The mailbox of a SubDevice that has just entered PREOP.
    pub fn new(station: StationAddress, layout: MailboxLayout) -> Mailbox {
        Mailbox { station, layout, counter: 0, received: 0, repeat: false }
    }

    /// Bytes of payload that a message may have.
    pub fn capacity(&self) -> usize {
        usize::from(self.layout.receive_size.min(self.layout.send_size)).saturating_sub(Header::LEN)
    }

    /// Sends a message and waits for the mail that `accept` takes for its answer; what it does not take is passed on to
    /// `other`.
    pub async fn exchange<T>(
        &mut self,
        bus: &Bus,
        protocol: Protocol,
        payload: &[u8],
        limits: (Duration, Duration),
        mut accept: impl FnMut(&Message<'_>) -> Option<T>,
        mut other: impl FnMut(&Message<'_>),
    ) -> Result<T, MailboxError> {
        let (request_limit, answer_limit) = limits;
        self.send(bus, protocol, payload, request_limit).await?;
        let until = bus.now() + answer_limit;
        while bus.now() < until {
            let Some(mail) = self.fetch(bus).await? else {
                bus.sleep(PAUSE).await;
                continue;
            };
            let Ok(message) = Message::decode(&mail) else { continue };
            if self.is_repeated(&message.header) {
                continue;
            }
            if message.header.protocol == Protocol::Error
                && let Some(bytes) = message.payload.first_chunk()
            {
                return Err(MailboxError::Error(ErrorReply::decode(bytes)));
            }
            match accept(&message) {
                Some(answer) => return Ok(answer),
                None => other(&message),
            }
        }
        Err(MailboxError::NoAnswer { limit: answer_limit })
    }

    /// A mail that came twice: same counter, not zero.
    fn is_repeated(&mut self, header: &Header) -> bool {
        let repeated = header.counter != 0 && header.counter == self.received;
        self.received = header.counter;
        repeated
    }

    /// Writes the whole receive mailbox, so that its last byte is touched.
    async fn send(
        &mut self,
        bus: &Bus,
        protocol: Protocol,
        payload: &[u8],
        limit: Duration,
    ) -> Result<(), MailboxError> {
        let size = usize::from(self.layout.receive_size);
        let room = size.saturating_sub(Header::LEN);
        if payload.len() > room {
            return Err(MailboxError::TooLong { bytes: payload.len(), limit: room });
        }
        self.counter = next_counter(self.counter);
        let mut mail = vec![0; size];
        let header = Header::new(protocol, self.counter, payload.len() as u16);
        mail[..Header::LEN].copy_from_slice(&header.encode());
        mail[Header::LEN..Header::LEN + payload.len()].copy_from_slice(payload);
        let until = bus.now() + limit;
        let mut losses = 0;
        loop {
            let target = Target::Station(self.station, RegisterAddress(self.layout.receive_offset));
            match bus.transfer_once(Command::Fpwr, target, mail.clone()).await {
                Ok(reply) if reply.wkc() == Wkc(0) => {
                    // After a loss a full mailbox may hold the message that was thought lost.
                    if losses > 0 {
                        return Ok(());
                    }
                }
                Ok(_) => return Ok(()),
                Err(error) => {
                    losses += 1;
                    if losses > RETRIES {
                        return Err(error.into());
                    }
                    continue;
                }
            }
            if bus.now() >= until {
                return Err(MailboxError::Full { limit });
            }
            bus.sleep(PAUSE).await;
        }
    }

    /// Reads the whole send mailbox; `None` where it is empty.
    async fn fetch(&mut self, bus: &Bus) -> Result<Option<Vec<u8>>, MailboxError> {
        let target = Target::Station(self.station, RegisterAddress(self.layout.send_offset));
        let size = usize::from(self.layout.send_size);
        let mut losses = 0;
        loop {
            match bus.transfer_once(Command::Fprd, target, vec![0; size]).await {
                Ok(Reply { data, main, redundant, .. }) => {
                    return Ok((main.plus(redundant) != Wkc(0)).then_some(data));
                }
                Err(error) => {
                    losses += 1;
                    if losses > RETRIES {
                        return Err(error.into());
                    }
                    self.request_repeat(bus).await?;
                }
            }
        }
    }

    /// Asks for the last mail again: toggles the repeat request and waits for its acknowledgement (facts 6.2).
    async fn request_repeat(&mut self, bus: &Bus) -> Result<(), MailboxError> {
        self.repeat = !self.repeat;
        let activate = SyncManagerActivate { enable: true, repeat_request: self.repeat, ..Default::default() };
        let register = map::sync_manager(SEND_SYNC_MANAGER);
        let at = register.offset(SyncManager::ACTIVATE);
        bus.fpwr(self.station, at, &activate.encode()).await?;
        let until = bus.now() + REPEAT_LIMIT;
        loop {
            let at = register.offset(SyncManager::PDI_CONTROL);
            let control = SyncManagerPdiControl::decode(&bus.fprd_array(self.station, at).await?);
            if control.repeat_acknowledge == self.repeat {
                return Ok(());
            }
            if bus.now() >= until {
                return Err(MailboxError::NotRepeated);
            }
            bus.sleep(PAUSE).await;
        }
    }
}
