//! Lanes of one mailbox: one per protocol, each with at most one conversation at a time.

use alloc::collections::VecDeque;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::mailbox::{ErrorReply, Protocol};

use super::answer_time::AnswerTime;
use super::error::MailboxError;
use super::unsolicited::Unsolicited;
use crate::role::Function;
use crate::time::Instant;

/// Answers that may wait in a lane; a conversation takes one at a time.
const INBOX: usize = 8;
/// Messages that may wait in a lane to be written.
const OUTBOX: usize = 64;
/// Time in which an error reply may still belong to a message without an answer.
const UNANSWERED_LIMIT: Duration = Duration::from_secs(1);
/// The same for a fragment of an Ethernet frame, and the longest wait for the answer to a request beside such frames: a
/// SubDevice refuses a fragment when it takes it, and takes messages within 100 ms (protocol 5.4, mailbox request).
/// Twice this time and a lost read are included.
const BESIDE_FRAMES: Duration = Duration::from_millis(250);
/// Usual answer times after which the answer to a request beside such frames no longer arrives.
const USUAL_TIMES: u32 = 8;

/// A lane holds one conversation at a time; the lanes work in parallel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
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
    /// Ethernet: IP parameters and address filter.
    Eoe,
    /// Ethernet: frames, which have no answer.
    Frames,
    /// Mail of a type without a lane of its own: the lower four bits of the type byte. All such types share one lane.
    Other(u8),
}

impl Lane {
    /// The function that begins a conversation in it.
    pub(super) const fn function(self) -> Function {
        match self {
            Lane::Coe => Function::SdoTransfer,
            Lane::Foe => Function::FileTransfer,
            Lane::Soe => Function::SoeAccess,
            Lane::Aoe => Function::AoeAccess,
            Lane::Voe => Function::VendorMessage,
            Lane::Eoe | Lane::Frames => Function::Ethernet,
            Lane::Other(_) => Function::RawMailbox,
        }
    }

    /// Number of lanes.
    pub(super) const COUNT: usize = 8;

    /// The lanes of the protocols.
    pub const ALL: [Lane; 7] = [Lane::Coe, Lane::Foe, Lane::Soe, Lane::Aoe, Lane::Voe, Lane::Eoe, Lane::Frames];

    /// The lane for mail of a type: the lower four bits of the type byte (protocol 6.1).
    pub const fn of(code: u8) -> Lane {
        match Protocol::from_code(code & 0x0F) {
            Protocol::Aoe => Lane::Aoe,
            Protocol::Eoe => Lane::Eoe,
            Protocol::Coe => Lane::Coe,
            Protocol::Foe => Lane::Foe,
            Protocol::Soe => Lane::Soe,
            Protocol::Voe => Lane::Voe,
            Protocol::Error => Lane::Other(0),
            Protocol::Other(code) => Lane::Other(code),
        }
    }

    /// The protocol of its messages.
    pub const fn protocol(self) -> Protocol {
        match self {
            Lane::Coe => Protocol::Coe,
            Lane::Foe => Protocol::Foe,
            Lane::Soe => Protocol::Soe,
            Lane::Aoe => Protocol::Aoe,
            Lane::Voe => Protocol::Voe,
            Lane::Eoe | Lane::Frames => Protocol::Eoe,
            Lane::Other(code) => Protocol::from_code(code & 0x0F),
        }
    }

    /// Index among all lanes.
    pub(super) const fn index(self) -> usize {
        match self {
            Lane::Coe => 0,
            Lane::Foe => 1,
            Lane::Soe => 2,
            Lane::Aoe => 3,
            Lane::Voe => 4,
            Lane::Eoe => 5,
            Lane::Frames => 6,
            Lane::Other(_) => 7,
        }
    }

    /// Kind of its mail without a waiting conversation.
    pub(super) const fn unclaimed_kind(self) -> Unsolicited {
        match self {
            Lane::Voe => Unsolicited::Voe,
            Lane::Coe | Lane::Foe | Lane::Soe | Lane::Aoe | Lane::Eoe | Lane::Frames | Lane::Other(_) => {
                Unsolicited::Other
            }
        }
    }
}

/// A message that waits to be written.
#[derive(Debug)]
pub(super) struct Outgoing {
    pub id: u32,
    pub lane: Lane,
    pub payload: Vec<u8>,
    /// Longest time that the receive mailbox may stay full.
    pub limit: Duration,
    /// Turn of the conversation that sends it.
    pub turn: u32,
    /// Time limit of the answer, if there is one.
    pub answer_limit: Option<Duration>,
}

/// A request that was written.
#[derive(Clone, Copy, Debug)]
pub(super) struct PendingRequest {
    /// Time at which it was written, or at which the last part of its answer was received.
    pub at: Instant,
    /// Time limit of the answer, or of its next part.
    pub limit: Duration,
    /// Whether the reader has polled for it.
    pub polled: bool,
    /// Time from `at` to the last poll without mail.
    pub empty_poll: Option<Duration>,
    /// A part of the answer is received, and the conversation has not requested the next one.
    pub answered: bool,
}

impl PendingRequest {
    pub(super) const fn at(at: Instant, limit: Duration) -> PendingRequest {
        PendingRequest { at, limit, polled: false, empty_poll: None, answered: false }
    }
}

/// Received mail for a lane.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Arrival {
    /// Payload of a message of its protocol.
    Payload(Vec<u8>),
    /// The SubDevice refused a message.
    Refused(ErrorReply, Refusal),
}

/// Which message an error reply belongs to (decision 0007).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Refusal {
    /// To the request: it has no answer.
    Certain,
    /// To the request or to an Ethernet frame: the answer may still arrive within [`BESIDE_FRAMES`], or within several
    /// usual answer times.
    BesideFrames,
    /// To the request or to any other message: the answer may still arrive within its time limit.
    Uncertain,
}

/// State of one lane.
#[derive(Debug, Default)]
pub(super) struct LaneState {
    /// Queue for the lane; the first entry holds it.
    pub turns: VecDeque<u32>,
    pub outbox: VecDeque<Outgoing>,
    inbox: VecDeque<Arrival>,
    /// The last message to be written, written or not.
    pub written: Option<(u32, Result<(), MailboxError>)>,
    pub pending: Option<PendingRequest>,
    /// Until when the answer to a request that was given up, or its next part, may still arrive.
    pub late_until: Option<Instant>,
    /// Time limit of each part of that answer.
    late_limit: Duration,
    /// Remaining time of that answer, while no mail can be read.
    late_for: Option<Duration>,
    /// The conversation waits for that answer before its first request.
    pub settling: bool,
    /// A request is being written, with its turn.
    writing: Option<u32>,
    /// Until when an error reply may belong to a message without an answer.
    pub unanswered_until: Option<Instant>,
    /// Mark of the last request, which distinguishes its answer from others.
    pub mark: u16,
    /// CoE header of the PDO requested by mailbox.
    pub pdo: Option<[u8; 2]>,
    /// The answer to the last message written has this mail type.
    pub expected: Option<Protocol>,
    /// Any mail of the lane's protocol counts as the answer, unless it is certainly unsolicited.
    pub any: bool,
    pub answer_time: AnswerTime,
    /// Until when an error reply may belong to a part of a message that is written in parts, of which only the last has
    /// an answer.
    pub parts_until: Option<Instant>,
    /// An error reply that was received since the first part.
    pub refusal: Option<ErrorReply>,
    /// The SubDevice has answered in this lane: it supports the protocol.
    pub proven: bool,
}

impl LaneState {
    /// Clears everything except the queue for the lane and the response times.
    pub(super) fn reset(&mut self) {
        let LaneState { turns, answer_time, .. } = core::mem::take(self);
        *self = LaneState { turns, answer_time, ..LaneState::default() };
    }

    /// As [`LaneState::reset`], but the SubDevice keeps its messages: an answer may arrive when it is reachable again.
    pub(super) fn suspend(&mut self, now: Instant) {
        let late_for = self.still_expected(now);
        let (mark, proven, expected) = (self.mark, self.proven, self.expected);
        let unanswered = self.is_unanswered(now).then_some(Instant::NEVER);
        self.reset();
        (self.mark, self.proven, self.late_for, self.expected) = (mark, proven, late_for, expected);
        self.unanswered_until = unanswered;
    }

    /// Time limit of an answer that may still arrive, and that no conversation may wait for any more.
    pub(super) fn still_expected(&self, now: Instant) -> Option<Duration> {
        let late = self.late_until.filter(|until| *until > now).map(|_| self.late_limit);
        self.pending.map(|pending| pending.limit).into_iter().chain(late).chain(self.late_for).max()
    }

    /// The SubDevice is reachable again.
    pub(super) fn resume(&mut self, now: Instant) {
        if let Some(limit) = self.late_for.take() {
            self.late_from(now, limit);
        }
        self.unanswered_until = self.unanswered_until.map(|_| now + UNANSWERED_LIMIT);
    }

    /// The answer to a request that was given up may still arrive, each part within a time limit.
    pub(super) fn late_from(&mut self, now: Instant, limit: Duration) {
        (self.late_until, self.late_limit) = (Some(now + limit), limit);
    }

    /// A part of that answer was received: its time limit starts again for the next part.
    pub(super) fn late_goes_on(&mut self, now: Instant) {
        self.late_until = self.late_until.map(|until| until.max(now + self.late_limit));
    }

    /// The conversation of a turn gives up its request; `open`: the answer is incomplete.
    pub(super) fn give_up(&mut self, turn: u32, open: bool, now: Instant, limit: Duration) {
        let unanswered = self.pending.take().is_some_and(|pending| !pending.answered);
        // The conversation only waited for a late answer: the time limit of that answer is unchanged.
        if core::mem::take(&mut self.settling) {
            return;
        }
        if self.writing == Some(turn) {
            // The time limit of the answer starts when the request is written.
            (self.late_until, self.late_limit) = (Some(Instant::NEVER), limit);
        } else if unanswered || open {
            self.late_from(now, limit);
        }
    }

    /// Whether an error reply may belong to a message without an answer.
    pub(super) fn is_unanswered(&self, now: Instant) -> bool {
        self.unanswered_until.is_some_and(|until| now < until)
    }

    pub(super) fn is_idle(&self) -> bool {
        self.turns.is_empty() && self.outbox.is_empty() && self.inbox.is_empty() && self.pending.is_none()
    }

    pub(super) fn has_space(&self) -> bool {
        self.outbox.len() < OUTBOX
    }

    /// A message is about to be written. Its answer may arrive before the write is confirmed.
    pub(super) fn writing(&mut self, message: &Outgoing, now: Instant) {
        match message.answer_limit {
            Some(_) => self.writing = Some(message.turn),
            None => self.unanswered_until = Some(Instant::NEVER),
        }
        if let Some(limit) = message.answer_limit.filter(|_| self.turns.front() == Some(&message.turn)) {
            self.pending = Some(PendingRequest::at(now, limit));
            self.expected = Some(message.lane.protocol());
        }
    }

    /// The write of a message ended; even if it failed, the message may have reached the SubDevice.
    pub(super) fn wrote(&mut self, message: &Outgoing, result: Result<(), MailboxError>, now: Instant) {
        let arrived = match result {
            Ok(()) => true,
            // The frame may have been lost after the SubDevice processed it.
            Err(MailboxError::Bus(_)) => true,
            Err(_) => false,
        };
        if let Some(limit) = message.answer_limit {
            let held = self.turns.front() == Some(&message.turn);
            if held && result.is_ok() {
                if let Some(pending) = self.pending.as_mut().filter(|pending| !pending.answered) {
                    *pending = PendingRequest::at(now, limit);
                }
            } else if held {
                self.pending = None;
                if arrived {
                    self.late_from(now, limit);
                }
            } else if self.late_until.is_some() {
                // The request was given up meanwhile, and its answer has not arrived yet.
                self.late_from(now, limit);
            }
            self.writing = None;
        } else {
            let limit = if message.lane == Lane::Frames { BESIDE_FRAMES } else { UNANSWERED_LIMIT };
            self.unanswered_until = Some(now + limit);
        }
        self.written = Some((message.id, result));
    }

    /// Time of the first poll for the expected answer.
    pub(super) fn due(&self) -> Option<Instant> {
        self.waiting().map(|pending| pending.at + self.answer_time.first_poll())
    }

    /// A poll that presumably began at `seen` found no mail.
    pub(super) fn polled_empty(&mut self, seen: Instant) {
        if let Some(pending) = self.pending.as_mut().filter(|pending| pending.polled) {
            pending.empty_poll = Some(seen.since(pending.at));
        }
    }

    /// Time in which the answer to a refused request may still arrive; `limit`: time limit of answers.
    pub(super) fn answer_after(&self, refusal: Refusal, limit: Duration) -> Option<Duration> {
        match refusal {
            Refusal::Certain => None,
            Refusal::BesideFrames => Some((self.answer_time.first_poll() * USUAL_TIMES).max(BESIDE_FRAMES).min(limit)),
            Refusal::Uncertain => Some(limit),
        }
    }

    /// The request with an answer that the reader polls for.
    pub(super) fn waiting(&self) -> Option<&PendingRequest> {
        self.pending.as_ref().filter(|pending| !pending.answered)
    }

    /// Takes a possible answer for the conversation. False if no conversation waits.
    ///
    /// `seen` is the presumed time at which it became available; `last`: no further part follows.
    pub(super) fn arrive(&mut self, arrival: Arrival, seen: Instant, last: bool) -> bool {
        let Some(pending) = &mut self.pending else {
            if last {
                self.late_until = None;
            } else {
                self.late_goes_on(seen);
            }
            return false;
        };
        self.proven |= matches!(arrival, Arrival::Payload(_));
        if !pending.answered {
            pending.answered = true;
            self.answer_time.took(seen.since(pending.at), pending.empty_poll);
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

    pub(super) fn is_full(&self) -> bool {
        self.inbox.len() >= INBOX
    }
}
