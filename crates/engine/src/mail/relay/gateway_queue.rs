//! Queues of client messages, and the tasks that pass them to the mailboxes.

use alloc::boxed::Box;
use alloc::collections::{BTreeMap, VecDeque};
use alloc::rc::Rc;
use alloc::vec;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::future::Future;
use core::pin::Pin;
use core::time::Duration;

use ringcat_wire::mailbox::{ErrorReply, Header, Message, Protocol, gateway};

use super::dialogue::{AnswerFilter, Dialogue, ExpectedAnswer, lane};
use crate::mail::coe;
use crate::mail::conversation::{Conversation, Limits, MailboxSizes};
use crate::mail::lane::Lane;
use crate::mail::{Mailbox, MailboxError};
use crate::supervisor::{Bus, Signal};
use crate::time::Instant;

/// Messages of one client that may wait in one lane, of one type.
const PER_CLIENT: usize = 8;
/// Messages of all clients that may wait in one lane, of one type.
const QUEUE: usize = 64;
/// Answers that are kept until the gateway takes them.
const ANSWERS: usize = 1024;
/// Time limit until a SubDevice accepts a message, and until it answers; files may have to be erased first.
const LIMITS: Limits = Limits::new(Duration::from_millis(500), Duration::from_secs(1));
const FILE_LIMITS: Limits = Limits::new(Duration::from_millis(500), Duration::from_secs(3));
/// Longest time in the queue; after this time the client has repeated the message or disconnected.
const STALE: Duration = Duration::from_secs(5);
/// Longest pause of a client within a transfer.
const PAUSE: Duration = Duration::from_secs(1);
/// Longest transfer while other clients wait.
const PATIENCE: Duration = Duration::from_secs(10);

/// An answer for a client.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Relayed {
    /// Number of the client, as passed with its message.
    pub client: u64,
    /// EtherCAT header of type 5 and the mailbox message.
    pub bytes: Vec<u8>,
}

/// Counters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct RelayCounters {
    /// Messages from clients.
    pub messages: u64,
    /// Answers of SubDevices, error replies among them.
    pub answers: u64,
    /// Messages that the MainDevice refused with an error reply.
    pub refused: u64,
    /// Messages without an answer: the SubDevice did not answer, or is absent.
    pub unanswered: u64,
    /// Transfers that were ended because their client paused, disconnected, or kept others waiting.
    pub ended: u64,
    /// Malformed messages.
    pub malformed: u64,
}

/// Future answer of the MainDevice itself: payloads of the same protocol, or the detail of an error reply.
pub type OwnAnswer = Pin<Box<dyn Future<Output = Result<Vec<Vec<u8>>, u16>>>>;

/// Target of a message.
pub enum Recipient {
    /// A SubDevice, through its mailbox.
    SubDevice(Mailbox),
    /// The MainDevice itself. The future runs when it is the message's turn.
    Own(OwnAnswer),
}

struct Job {
    client: u64,
    header: Header,
    payload: Vec<u8>,
    at: Instant,
    own: Option<OwnAnswer>,
}

#[derive(Default)]
struct Queue {
    jobs: VecDeque<Job>,
    /// A task is processing its messages.
    served: bool,
    /// Number of the last turn of a client.
    turns: BTreeMap<u64, u64>,
    turn: u64,
}

#[derive(Default)]
struct State {
    queues: BTreeMap<(u16, u8), Queue>,
    answers: VecDeque<Relayed>,
    counters: RelayCounters,
}

/// Queues messages of clients and returns answers.
pub struct GatewayQueue {
    shared: Rc<Shared>,
}

struct Shared {
    bus: Bus,
    state: RefCell<State>,
    changed: Signal,
}

impl core::fmt::Debug for GatewayQueue {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("GatewayQueue").field("counters", &self.counters()).finish_non_exhaustive()
    }
}

impl GatewayQueue {
    /// An empty queue.
    pub fn new(bus: &Bus) -> GatewayQueue {
        GatewayQueue { shared: Rc::new(Shared { bus: bus.clone(), state: RefCell::default(), changed: bus.signal() }) }
    }

    /// Takes a client's message, EtherCAT header included. `find` returns the recipient, or the detail of an error
    /// reply if there is none or it does not support the protocol. The answer to a message that cannot be passed on is
    /// an error reply.
    pub fn take(&self, client: u64, bytes: &[u8], find: impl FnOnce(&Message<'_>) -> Result<Recipient, u16>) {
        self.shared.state.borrow_mut().counters.messages += 1;
        let Ok(message) = gateway::decode(bytes) else {
            self.shared.state.borrow_mut().counters.malformed += 1;
            return;
        };
        let Message { header, payload } = message;
        let mut job = Job { client, header, payload: payload.to_vec(), at: self.shared.bus.now(), own: None };
        let found = lane(header.protocol, payload).and_then(|lane| Ok((find(&message)?, lane)));
        match found {
            Ok((Recipient::SubDevice(mailbox), lane)) => self.queue(job, Some(mailbox), lane),
            Ok((Recipient::Own(answer), lane)) => {
                job.own = Some(answer);
                self.queue(job, None, lane);
            }
            Err(detail) => self.shared.refuse(&job, detail),
        }
    }

    fn queue(&self, job: Job, mailbox: Option<Mailbox>, lane: Lane) {
        let key = (job.header.address, lane.protocol().code());
        let state = &mut *self.shared.state.borrow_mut();
        let queue = state.queues.entry(key).or_default();
        let of_client = queue.jobs.iter().filter(|other| other.client == job.client).count();
        if of_client >= PER_CLIENT || queue.jobs.len() >= QUEUE {
            state.refuse(&job, ErrorReply::SERVICE_IN_WORK);
            return;
        }
        queue.jobs.push_back(job);
        if !core::mem::replace(&mut queue.served, true) {
            let shared = self.shared.clone();
            self.shared.bus.spawn(async move {
                match mailbox {
                    Some(mailbox) => serve(shared, key, mailbox, lane).await,
                    None => serve_own(shared, key).await,
                }
            });
        }
        self.shared.changed.notify();
    }

    /// A client has disconnected: its messages are dropped, its transfer is ended.
    pub fn forget(&self, client: u64) {
        {
            let state = &mut *self.shared.state.borrow_mut();
            for queue in state.queues.values_mut() {
                queue.jobs.retain(|job| job.client != client);
                // The task that processes the transfer detects the missing turn and ends the transfer.
                queue.turns.remove(&client);
            }
            state.answers.retain(|answer| answer.client != client);
        }
        self.shared.changed.notify();
    }

    /// Takes the oldest answer.
    pub fn pop(&self) -> Option<Relayed> {
        self.shared.state.borrow_mut().answers.pop_front()
    }

    /// Counters.
    pub fn counters(&self) -> RelayCounters {
        self.shared.state.borrow().counters
    }
}

impl State {
    /// Queues an answer for the client; false if it does not fit.
    fn put(&mut self, job: &Job, protocol: Protocol, payload: &[u8]) -> bool {
        let header = Header { protocol, length: payload.len() as u16, ..job.header };
        let mut bytes = vec![0; gateway::HEADER_LEN + Header::LEN + payload.len()];
        let fits = gateway::encode(&Message { header, payload }, &mut bytes).is_some() && self.answers.len() < ANSWERS;
        if fits {
            self.answers.push_back(Relayed { client: job.client, bytes });
        }
        fits
    }

    fn answer(&mut self, job: &Job, protocol: Protocol, payload: &[u8]) {
        let answered = self.put(job, protocol, payload);
        self.counters.answers += u64::from(answered);
        self.counters.unanswered += u64::from(!answered);
    }

    fn refuse(&mut self, job: &Job, detail: u16) {
        self.counters.refused += 1;
        self.put(job, Protocol::Error, &ErrorReply::new(detail).encode());
    }
}

impl Shared {
    fn refuse(&self, job: &Job, detail: u16) {
        self.state.borrow_mut().refuse(job, detail);
    }

    /// The next message, of the client with the oldest last turn. `None` if no message waits.
    fn next(&self, key: (u16, u8)) -> Option<Job> {
        let now = self.bus.now();
        let state = &mut *self.state.borrow_mut();
        let queue = state.queues.get_mut(&key)?;
        let waiting = queue.jobs.len();
        queue.jobs.retain(|job| now.since(job.at) < STALE);
        state.counters.unanswered += (waiting - queue.jobs.len()) as u64;
        let turn_of = |job: &Job| queue.turns.get(&job.client).copied().unwrap_or(0);
        let first = queue.jobs.iter().enumerate().min_by_key(|(at, job)| (turn_of(job), *at)).map(|(at, _)| at);
        let job = first.and_then(|at| queue.jobs.remove(at));
        match &job {
            Some(job) => {
                queue.turn += 1;
                queue.turns.insert(job.client, queue.turn);
            }
            None => {
                state.queues.remove(&key);
            }
        }
        job
    }

    /// The next message of a client; the inner `None` means that the client has disconnected.
    fn next_of(&self, key: (u16, u8), client: u64) -> Option<Option<Job>> {
        let state = &mut *self.state.borrow_mut();
        let queue = state.queues.get_mut(&key)?;
        if !queue.turns.contains_key(&client) {
            return Some(None);
        }
        let at = queue.jobs.iter().position(|job| job.client == client)?;
        queue.jobs.remove(at).map(Some)
    }

    /// Whether other clients wait.
    fn others_wait(&self, key: (u16, u8), client: u64) -> bool {
        let state = self.state.borrow();
        state.queues.get(&key).is_some_and(|queue| queue.jobs.iter().any(|job| job.client != client))
    }
}

/// Processes the messages for one SubDevice and lane until the queue is empty.
async fn serve(shared: Rc<Shared>, key: (u16, u8), mailbox: Mailbox, lane: Lane) {
    while let Some(job) = shared.next(key) {
        let conversation = async {
            let mut conversation = mailbox.conversation(lane).await?;
            settle(&mut conversation, lane).await?;
            Ok::<Conversation, MailboxError>(conversation)
        };
        match conversation.await {
            Ok(conversation) => hold_conversation(&shared, key, conversation, lane, job).await,
            Err(_) => shared.state.borrow_mut().counters.unanswered += 1,
        }
    }
}

/// Answers the messages for the MainDevice itself until the queue is empty.
async fn serve_own(shared: Rc<Shared>, key: (u16, u8)) {
    while let Some(mut job) = shared.next(key) {
        let Some(answer) = job.own.take() else { continue };
        match answer.await {
            Ok(payloads) => {
                let mut state = shared.state.borrow_mut();
                payloads.iter().for_each(|payload| state.answer(&job, job.header.protocol, payload));
            }
            Err(detail) => shared.refuse(&job, detail),
        }
    }
}

async fn settle(conversation: &mut Conversation, lane: Lane) -> Result<(), MailboxError> {
    match lane {
        Lane::Coe => coe::settle(conversation, LIMITS).await,
        _ => conversation.settle().await,
    }
}

/// Processes one message with its answers, and the rest of the same transfer.
async fn hold_conversation(
    shared: &Rc<Shared>,
    key: (u16, u8),
    mut conversation: Conversation,
    lane: Lane,
    first: Job,
) {
    let (client, begin) = (first.client, shared.bus.now());
    let mut dialogue = Dialogue::default();
    let mut job = first;
    loop {
        let went_well = exchange(shared, &mut conversation, &mut dialogue, lane, &job).await;
        if !dialogue.is_open() {
            return;
        }
        let wanted = || conversation.is_wanted() || shared.others_wait(key, client);
        let next = if !went_well || (wanted() && shared.bus.now().since(begin) > PATIENCE) {
            None
        } else {
            let next = shared.changed.until(|| shared.next_of(key, client));
            shared.bus.within(PAUSE, next).await.ok().flatten()
        };
        match next {
            Some(next) => job = next,
            None => break,
        }
    }
    shared.state.borrow_mut().counters.ended += 1;
    if let Some(end) = dialogue.end() {
        // A closed mailbox has no transfer to end.
        let _ = conversation.post(&end);
    }
}

/// Processes one message with its answers; false if an answer is missing.
async fn exchange(
    shared: &Rc<Shared>,
    conversation: &mut Conversation,
    dialogue: &mut Dialogue,
    lane: Lane,
    job: &Job,
) -> bool {
    let MailboxSizes { receive, send } = conversation.mailbox_sizes();
    if job.payload.len() > conversation.request_capacity() {
        shared.refuse(job, ErrorReply::INVALID_SIZE);
        return true;
    }
    let limits = if lane == Lane::Foe { FILE_LIMITS } else { LIMITS };
    let result = match dialogue.request(lane, &job.payload, receive) {
        Err(detail) => {
            shared.refuse(job, detail);
            return true;
        }
        Ok(ExpectedAnswer::None) => conversation.send(&job.payload, limits.request).await,
        Ok(ExpectedAnswer::Matching(filter)) => {
            answers(shared, conversation, dialogue, &filter, job, limits, send).await
        }
    };
    match result {
        Ok(()) => true,
        Err(MailboxError::Error(reply)) => {
            shared.state.borrow_mut().answer(job, Protocol::Error, &reply.encode());
            true
        }
        Err(_) => {
            dialogue.unanswered();
            shared.state.borrow_mut().counters.unanswered += 1;
            false
        }
    }
}

async fn answers(
    shared: &Rc<Shared>,
    conversation: &mut Conversation,
    dialogue: &mut Dialogue,
    filter: &AnswerFilter,
    job: &Job,
    limits: Limits,
    send: usize,
) -> Result<(), MailboxError> {
    if let Some(index) = filter.index() {
        conversation.mark(index);
    }
    let accept = |payload: &[u8]| filter.matches(payload).then(|| payload.to_vec());
    let mut answer = conversation.begin(&job.payload, limits, accept).await?;
    loop {
        let more = dialogue.answered(filter, &answer, send);
        shared.state.borrow_mut().answer(job, job.header.protocol, &answer);
        if !more {
            conversation.complete();
            return Ok(());
        }
        let accept = |payload: &[u8]| filter.continues(payload).then(|| payload.to_vec());
        answer = conversation.more(limits.answer, accept).await?;
    }
}
