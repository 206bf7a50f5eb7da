//! A conversation that holds a lane: it sends, and waits for its answers.

use alloc::rc::Rc;
use core::time::Duration;

use ringcat_wire::mailbox::Header;

use super::delivery;
use super::error::MailboxError;
use super::lane::{Arrival, Lane, LaneState, PendingRequest, Refusal};
use super::reader;
use super::shared::SharedMailbox;
use crate::role::Function;
use crate::time::Instant;

/// Time limits of one message and its answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Limits {
    /// Until the mailbox of the SubDevice accepts the message.
    pub request: Duration,
    /// Until the answer is available.
    pub answer: Duration,
}

impl Limits {
    /// These limits for a message and for its answer.
    pub const fn new(request: Duration, answer: Duration) -> Limits {
        Limits { request, answer }
    }
}

/// Longest time that messages without an answer may stay in the mailbox.
const POST_LIMIT: Duration = Duration::from_millis(100);

/// Time after the end of a conversation in which an error reply may still belong to one of its parts.
const PARTS_LIMIT: Duration = Duration::from_secs(1);

/// Largest number of parts of a late answer: they are counted with 16 bits (protocol 6.3, 6.6).
const LATE_PARTS: usize = 1 << 16;

/// A conversation with a SubDevice, which holds a lane of its mailbox. When it is dropped, the lane is free for the
/// next. A request without an answer is remembered, so that its late answer does not count as the answer to another
/// request.
#[derive(Debug)]
pub struct Conversation {
    shared: Rc<SharedMailbox>,
    lane: Lane,
    turn: u32,
    epoch: u32,
    /// Time limit of answers; late ones may take as long again.
    limit: Duration,
    /// A request was written, and its answer is incomplete.
    open: bool,
}

/// A place in the queue for a lane; when it is dropped before its turn, the place is removed.
struct Turn {
    shared: Rc<SharedMailbox>,
    lane: Lane,
    turn: u32,
    kept: bool,
}

impl Drop for Turn {
    fn drop(&mut self) {
        if !self.kept {
            leave(&self.shared, self.lane, self.turn);
        }
    }
}

fn leave(shared: &Rc<SharedMailbox>, lane: Lane, turn: u32) {
    shared.state_mut().lanes.of_mut(lane).turns.retain(|other| *other != turn);
    shared.changed.notify();
}

/// Lengths of the mailboxes of a SubDevice in bytes, header included.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct MailboxSizes {
    /// The mailbox that the SubDevice receives.
    pub receive: usize,
    /// The mailbox that the SubDevice sends.
    pub send: usize,
}

impl Conversation {
    /// Waits until the lane is free, and takes it.
    pub(super) async fn take(
        shared: &Rc<SharedMailbox>,
        lane: Lane,
        function: Function,
    ) -> Result<Conversation, MailboxError> {
        shared.bus.permit(function)?;
        let (mut turn, epoch) = {
            let state = &mut *shared.state_mut();
            if !state.open {
                return Err(MailboxError::Closed);
            }
            state.next_id = state.next_id.wrapping_add(1);
            let next_id = state.next_id;
            state.lanes.of_mut(lane).turns.push_back(next_id);
            (Turn { shared: shared.clone(), lane, turn: state.next_id, kept: false }, state.epoch)
        };
        let ready = || {
            let state = shared.state();
            if state.epoch != epoch {
                return Some(Err(MailboxError::Closed));
            }
            let front = state.lanes.of(lane).and_then(|lane| lane.turns.front());
            (front == Some(&turn.turn)).then_some(Ok(()))
        };
        shared.changed.until(ready).await?;
        turn.kept = true;
        Ok(Conversation { shared: shared.clone(), lane, turn: turn.turn, epoch, limit: Duration::ZERO, open: false })
    }

    fn with<T>(&self, work: impl FnOnce(&mut LaneState) -> T) -> Result<T, MailboxError> {
        let state = &mut *self.shared.state_mut();
        if state.epoch != self.epoch { Err(MailboxError::Closed) } else { Ok(work(state.lanes.of_mut(self.lane))) }
    }

    /// Largest payload of a message in both directions, in bytes.
    pub fn capacity(&self) -> usize {
        let state = self.shared.state();
        state.session.map_or(0, |session| {
            usize::from(session.layout.receive_size.min(session.layout.send_size)).saturating_sub(Header::LEN)
        })
    }

    /// Largest payload of a message to the SubDevice, in bytes.
    pub fn request_capacity(&self) -> usize {
        let state = self.shared.state();
        state.session.map_or(0, |session| usize::from(session.layout.receive_size).saturating_sub(Header::LEN))
    }

    /// Lengths of the mailboxes; zero while they are not in use.
    pub fn mailbox_sizes(&self) -> MailboxSizes {
        let state = self.shared.state();
        let sizes = state.session.map(|session| (session.layout.receive_size, session.layout.send_size));
        let (receive, send) = sizes.unwrap_or_default();
        MailboxSizes { receive: receive.into(), send: send.into() }
    }

    /// Whether another conversation waits for the lane.
    pub fn is_wanted(&self) -> bool {
        self.with(|lane| lane.turns.len() > 1).unwrap_or(true)
    }

    /// A number that is unique among the recent requests of this mailbox.
    pub fn number(&mut self) -> u32 {
        let state = &mut *self.shared.state_mut();
        state.next_id = state.next_id.wrapping_add(1);
        state.next_id
    }

    /// The time.
    pub fn now(&self) -> Instant {
        self.shared.bus.now()
    }

    /// Waits; ends early with an error if the mailbox is closed.
    pub async fn pause(&self, pause: Duration) -> Result<(), MailboxError> {
        let closed = || self.with(|_| ()).err();
        match self.shared.bus.within(pause, self.shared.changed.until(closed)).await {
            Ok(error) => Err(error),
            Err(_) => Ok(()),
        }
    }

    /// Sets the mark of the next request: a number by which [`Conversation::late_mark`] identifies it.
    pub fn mark(&mut self, mark: u16) {
        let _ = self.with(|lane| lane.mark = mark);
    }

    /// The answer to the next request is a PDO with this CoE header; other PDOs are kept as unsolicited mail.
    pub(super) fn expect_pdo(&mut self, header: Option<[u8; 2]>) {
        let _ = self.with(|lane| lane.pdo = header);
    }

    /// Any mail of the lane's protocol counts as the answer to the next request, except certainly unsolicited mail.
    pub(super) fn expect_any(&mut self, any: bool) {
        let _ = self.with(|lane| lane.any = any);
    }

    /// The mark of a request that was given up and may still be answered.
    pub fn late_mark(&self) -> Option<u16> {
        self.with(|lane| lane.late_until.map(|_| lane.mark)).ok().flatten()
    }

    /// The late answer was received, or can no longer arrive.
    pub fn forget_late(&mut self) {
        let _ = self.with(|lane| lane.late_until = None);
    }

    /// The answer to a request that was given up may arrive within a time.
    pub(super) fn expect_late(&mut self, limit: Duration) {
        let now = self.shared.bus.now();
        let _ = self.with(|lane| lane.late_from(now, limit));
    }

    /// Waits until all parts of the answer to an earlier request that was given up are received or can no longer
    /// arrive. For protocols in which an answer does not name its request.
    pub async fn settle(&mut self) -> Result<(), MailboxError> {
        for _ in 0..LATE_PARTS {
            let now = self.shared.bus.now();
            let Some(until) = self.with(|lane| lane.late_until)?.filter(|until| *until > now) else { break };
            self.limit = until.since(now);
            self.with(|lane| lane.settling = true)?;
            self.poll_for_more()?;
            // If the late request is written only now, its time limit starts now.
            let ready = || {
                let received = |lane: &mut LaneState| match lane.take() {
                    Some(arrival) => Some(Some(arrival)),
                    None => (lane.late_until != Some(until)).then_some(None),
                };
                self.with(received).transpose()
            };
            let received =
                self.shared.bus.within(self.limit, self.shared.changed.until(ready)).await.unwrap_or(Ok(None))?;
            let Some(arrival) = received else { continue };
            let (is_part, is_over) = match &arrival {
                Arrival::Payload(payload) => (true, delivery::is_last(self.lane, payload)),
                Arrival::Refused(_, refusal) => (false, *refusal == Refusal::Certain),
            };
            delivery::keep_unclaimed(&mut self.shared.state_mut(), self.lane, arrival);
            if is_over {
                break;
            }
            if is_part {
                let now = self.shared.bus.now();
                self.with(|lane| lane.late_goes_on(now))?;
            }
        }
        self.with(|lane| (lane.settling, lane.late_until) = (false, None))?;
        self.complete();
        Ok(())
    }

    /// Begins a message in parts, of which only the last has an answer: an error reply before it may belong to one of
    /// them.
    pub(super) fn begin_parts(&mut self) {
        let _ = self.with(|lane| (lane.parts_until, lane.refusal) = (Some(Instant::NEVER), None));
    }

    /// Ends a message in parts.
    ///
    /// # Errors
    /// An error reply was received meanwhile: a part may be missing.
    pub(super) fn end_parts(&mut self) -> Result<(), MailboxError> {
        self.check_parts()?;
        self.with(|lane| lane.parts_until = None)
    }

    /// Fails if an error reply was received since the first part.
    pub(super) fn check_parts(&self) -> Result<(), MailboxError> {
        self.with(|lane| lane.refusal)?.map_or(Ok(()), |reply| Err(MailboxError::Error(reply)))
    }

    /// The answer is complete.
    pub fn complete(&mut self) {
        self.open = false;
        let _ = self.with(|lane| lane.pending = None);
        self.keep_unclaimed();
    }

    /// Sends a message without an answer. It is written even when the conversation ends.
    pub fn post(&mut self, payload: &[u8]) -> Result<(), MailboxError> {
        self.with(|_| ())?;
        self.shared.queue(self.lane, payload.to_vec(), POST_LIMIT, (self.turn, None)).map(drop)
    }

    /// Sends a message and waits until the SubDevice has accepted it.
    pub async fn send(&mut self, payload: &[u8], limit: Duration) -> Result<(), MailboxError> {
        self.write(payload, limit, None).await
    }

    /// Sends a request and waits for the mail that `accept` recognises as its answer; other mail of the lane is kept as
    /// unsolicited mail and counted.
    pub async fn request<T>(
        &mut self,
        payload: &[u8],
        limits: Limits,
        accept: impl FnMut(&[u8]) -> Option<T>,
    ) -> Result<T, MailboxError> {
        let answer = self.begin(payload, limits, accept).await?;
        self.complete();
        Ok(answer)
    }

    /// As [`Conversation::request`], for an answer in several parts: call [`Conversation::more`] for further parts,
    /// then [`Conversation::complete`].
    pub async fn begin<T>(
        &mut self,
        payload: &[u8],
        limits: Limits,
        accept: impl FnMut(&[u8]) -> Option<T>,
    ) -> Result<T, MailboxError> {
        self.limit = limits.answer;
        self.keep_unclaimed();
        // The answer may arrive before the write is confirmed.
        self.open = true;
        self.write(payload, limits.request, Some(limits.answer)).await.inspect_err(|_| self.open = false)?;
        self.answer(limits.answer, accept).await
    }

    /// Waits for a further part of an answer.
    pub async fn more<T>(
        &mut self,
        limit: Duration,
        accept: impl FnMut(&[u8]) -> Option<T>,
    ) -> Result<T, MailboxError> {
        self.limit = limit;
        self.poll_for_more()?;
        self.answer(limit, accept).await
    }

    /// Makes the reader poll for a further mail.
    fn poll_for_more(&mut self) -> Result<(), MailboxError> {
        let (now, limit) = (self.shared.bus.now(), self.limit);
        self.with(|lane| {
            if !lane.has_arrivals() {
                lane.pending = Some(PendingRequest::at(now, limit));
            }
        })?;
        reader::start(&self.shared);
        Ok(())
    }

    async fn write(
        &mut self,
        payload: &[u8],
        limit: Duration,
        answer_limit: Option<Duration>,
    ) -> Result<(), MailboxError> {
        let id = self.shared.queue(self.lane, payload.to_vec(), limit, (self.turn, answer_limit))?;
        let ready = || match self.with(|lane| lane.written) {
            Err(error) => Some(Err(error)),
            Ok(Some((written, result))) if written == id => Some(result),
            Ok(_) => None,
        };
        self.shared.changed.until(ready).await
    }

    async fn arrival(&self, limit: Duration) -> Result<Arrival, MailboxError> {
        let ready = || self.with(LaneState::take).transpose();
        match self.shared.bus.within(limit, self.shared.changed.until(ready)).await {
            Ok(arrival) => arrival,
            Err(_) => Err(MailboxError::NoAnswer { limit }),
        }
    }

    async fn answer<T>(
        &mut self,
        limit: Duration,
        mut accept: impl FnMut(&[u8]) -> Option<T>,
    ) -> Result<T, MailboxError> {
        let until = self.shared.bus.now() + limit;
        loop {
            let left = until.since(self.shared.bus.now());
            match self.arrival(left).await {
                Ok(Arrival::Refused(reply, refusal)) => {
                    match self.with(|lane| lane.answer_after(refusal, limit))? {
                        Some(limit) => {
                            self.limit = limit;
                            self.give_up();
                        }
                        None => self.complete(),
                    }
                    return Err(MailboxError::Error(reply));
                }
                Ok(Arrival::Payload(payload)) => {
                    if let Some(answer) = accept(&payload) {
                        return Ok(answer);
                    }
                    delivery::keep_unclaimed(&mut self.shared.state_mut(), self.lane, Arrival::Payload(payload));
                    self.poll_for_more()?;
                }
                Err(MailboxError::NoAnswer { .. }) => {
                    self.give_up();
                    return Err(MailboxError::NoAnswer { limit });
                }
                Err(error) => return Err(error),
            }
        }
    }

    /// Gives up the request; its answer may arrive late.
    fn give_up(&mut self) {
        let (now, limit, turn) = (self.shared.bus.now(), self.limit, self.turn);
        let open = core::mem::take(&mut self.open);
        let _ = self.with(|lane| lane.give_up(turn, open, now, limit));
        self.keep_unclaimed();
    }

    /// Keeps received mail that the conversation did not take as unsolicited mail.
    fn keep_unclaimed(&self) {
        let state = &mut *self.shared.state_mut();
        if state.epoch != self.epoch {
            return;
        }
        while let Some(arrival) = state.lanes.of_mut(self.lane).take() {
            delivery::keep_unclaimed(state, self.lane, arrival);
        }
    }

    /// An error reply to the written parts may still arrive.
    fn leave_parts(&mut self) {
        let now = self.shared.bus.now();
        let _ = self.with(|lane| {
            if lane.parts_until.take().is_some() {
                lane.parts_until = Some(now + PARTS_LIMIT);
            }
        });
    }

    /// Withdraws queued messages when the conversation ends, except those without an answer.
    fn withdraw(&mut self) {
        let withdraw = |lane: &mut LaneState| {
            let queued = lane.outbox.len();
            lane.outbox.retain(|message| message.answer_limit.is_none());
            lane.outbox.len() < queued
        };
        if self.with(withdraw).unwrap_or(false) {
            self.open = false;
        }
    }
}

impl Drop for Conversation {
    fn drop(&mut self) {
        self.withdraw();
        self.give_up();
        self.leave_parts();
        self.expect_pdo(None);
        self.expect_any(false);
        leave(&self.shared, self.lane, self.turn);
    }
}
