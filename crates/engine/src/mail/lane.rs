//! Lanes: what may be under way in one mailbox side by side, one conversation each.

use alloc::collections::VecDeque;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::mailbox::{ErrorReply, Protocol};

use super::answer_time::AnswerTime;
use super::error::MailboxError;
use crate::time::Instant;

/// Answers that may wait in a lane; whoever talks takes one after the other.
const INBOX: usize = 8;
/// Messages that may wait to be written in a lane.
const OUTBOX: usize = 64;

/// One conversation at a time; different lanes run side by side.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Lane {
    /// SDO and SDO information.
    Coe,
    /// Files.
    Foe,
    /// Servo drives.
    Soe,
    /// ADS.
    Aoe,
    /// Vendor protocol.
    Voe,
    /// Ethernet: the settings of its addresses.
    Eoe,
    /// Ethernet: its frames. Nobody answers them.
    Frames,
}

impl Lane {
    /// All lanes.
    pub const ALL: [Lane; 7] = [Lane::Coe, Lane::Foe, Lane::Soe, Lane::Aoe, Lane::Voe, Lane::Eoe, Lane::Frames];

    /// The protocol of its messages.
    pub const fn protocol(self) -> Protocol {
        match self {
            Lane::Coe => Protocol::Coe,
            Lane::Foe => Protocol::Foe,
            Lane::Soe => Protocol::Soe,
            Lane::Aoe => Protocol::Aoe,
            Lane::Voe => Protocol::Voe,
            Lane::Eoe | Lane::Frames => Protocol::Eoe,
        }
    }
}

/// A message that waits to be written.
#[derive(Debug)]
pub(super) struct Outgoing {
    pub id: u32,
    pub payload: Vec<u8>,
    /// How long the SubDevice may refuse it.
    pub limit: Duration,
    /// Who sends it: the turn of a talk.
    pub turn: u32,
    /// How long an answer is waited for, where one is.
    pub asks: Option<Duration>,
}

/// A request that was written.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asked {
    /// When it was written, or when the last part of its answer came.
    pub at: Instant,
    /// Whether it was looked for.
    pub looked: bool,
    /// How long after that the last look found nothing.
    pub vain: Option<Duration>,
    /// A part of the answer is there, and whoever asked has not said that more is to come.
    pub answered: bool,
}

impl Asked {
    pub(super) const fn at(at: Instant) -> Asked {
        Asked { at, looked: false, vain: None, answered: false }
    }
}

/// What came for a lane.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Arrival {
    /// Payload of a message of its protocol.
    Payload(Vec<u8>),
    /// The SubDevice refused a message; whether it may have been another one, so that an answer may still come.
    Refused(ErrorReply, bool),
}

/// State of one lane.
#[derive(Debug, Default)]
pub(super) struct LaneState {
    /// Who wants to talk; the first one does.
    pub turns: VecDeque<u32>,
    pub outbox: VecDeque<Outgoing>,
    inbox: VecDeque<Arrival>,
    /// The message that was written last, or not.
    pub written: Option<(u32, Result<(), MailboxError>)>,
    pub asked: Option<Asked>,
    /// Until when the answer to a request that was given up may still come.
    pub late_until: Option<Instant>,
    /// What the last request was about, so that its answer can be told from that to another one.
    pub mark: u16,
    /// CoE header of the PDO that was asked for by mailbox.
    pub pdo: Option<[u8; 2]>,
    pub answer_time: AnswerTime,
    /// A message is written in parts, of which only the last one is answered, or was until lately: until then an error
    /// reply may be to one of them.
    pub parts_until: Option<Instant>,
    /// An error reply that came meanwhile.
    pub refusal: Option<ErrorReply>,
    /// The SubDevice has answered in this lane: it knows the protocol.
    pub proven: bool,
}

impl LaneState {
    /// Forgets everything but who wants to talk and how long answers take.
    pub(super) fn reset(&mut self) {
        let LaneState { turns, answer_time, .. } = core::mem::take(self);
        *self = LaneState { turns, answer_time, ..LaneState::default() };
    }

    pub(super) fn is_idle(&self) -> bool {
        self.turns.is_empty() && self.outbox.is_empty() && self.inbox.is_empty() && self.asked.is_none()
    }

    pub(super) fn has_room(&self) -> bool {
        self.outbox.len() < OUTBOX
    }

    /// A message of a talk is about to be written. Its answer may come before it is known that it was.
    pub(super) fn writing(&mut self, message: &Outgoing, now: Instant) {
        if message.asks.is_some() && self.turns.front() == Some(&message.turn) {
            self.asked = Some(Asked::at(now));
        }
    }

    /// A message of a talk was handed to the SubDevice, or may have been.
    pub(super) fn wrote(&mut self, message: &Outgoing, result: Result<(), MailboxError>, now: Instant) {
        let arrived = match result {
            Ok(()) => true,
            // Frames that were lost may have been lost on their way back.
            Err(MailboxError::Bus(_)) => true,
            Err(_) => false,
        };
        if let Some(limit) = message.asks {
            let held = self.turns.front() == Some(&message.turn);
            if held && result.is_ok() {
                if let Some(asked) = self.asked.as_mut().filter(|asked| !asked.answered) {
                    *asked = Asked::at(now);
                }
            } else {
                if held {
                    self.asked = None;
                }
                if arrived {
                    self.late_until = Some(now + limit);
                }
            }
        }
        self.written = Some((message.id, result));
    }

    /// When the answer that is waited for is looked for first.
    pub(super) fn due(&self) -> Option<Instant> {
        self.waiting().map(|asked| asked.at + self.answer_time.first_look())
    }

    /// A look that began then, for all one knows, has found nothing.
    pub(super) fn looked_in_vain(&mut self, seen: Instant) {
        if let Some(asked) = self.asked.as_mut().filter(|asked| asked.looked) {
            asked.vain = Some(seen.since(asked.at));
        }
    }

    /// The request whose answer is looked for.
    pub(super) fn waiting(&self) -> Option<&Asked> {
        self.asked.as_ref().filter(|asked| !asked.answered)
    }

    /// An answer, or what may be one, for whoever talks. False where nobody waits for one.
    ///
    /// `seen` is when it was there, for all one knows.
    pub(super) fn arrive(&mut self, arrival: Arrival, seen: Instant) -> bool {
        let Some(asked) = &mut self.asked else {
            self.late_until = None;
            return false;
        };
        self.proven |= matches!(arrival, Arrival::Payload(_));
        if !asked.answered {
            asked.answered = true;
            self.answer_time.took(seen.since(asked.at), asked.vain);
        }
        if self.inbox.len() >= INBOX {
            self.inbox.pop_front();
        }
        self.inbox.push_back(arrival);
        true
    }

    pub(super) fn take(&mut self) -> Option<Arrival> {
        self.inbox.pop_front()
    }

    pub(super) fn has_arrivals(&self) -> bool {
        !self.inbox.is_empty()
    }

    pub(super) fn forget_arrivals(&mut self) {
        self.inbox.clear();
    }
}
