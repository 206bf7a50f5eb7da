//! Reads the send mailbox when it is full, and polls it while a conversation waits for an answer (protocol 6.1, 6.2).
//!
//! A lost read is recovered with the repeat request. Received mail is passed to `delivery`.

use alloc::rc::Rc;
use core::time::Duration;

use ringcat_wire::address::{RegisterAddress, Wkc};
use ringcat_wire::register::{SyncManager, SyncManagerActivate, SyncManagerPdiControl, SyncManagerStatus, map};

use super::answer_time::{AnswerTime, ShortestTrip};
use super::delivery;
use super::error::MailboxError;
use super::recent::ReadKind;
use super::shared::{Session, SharedMailbox};
use crate::supervisor::{Bus, BusError};
use crate::time::Instant;

/// Time limit of the repeat acknowledge.
const REPEAT_LIMIT: Duration = Duration::from_millis(100);
/// Pause between two polls for it.
const REPEAT_PAUSE: Duration = Duration::from_micros(200);
/// Pause after a failed access, so that an unreachable SubDevice does not cause continuous traffic.
const FAILURE_PAUSE: Duration = Duration::from_millis(5);

/// Kinds of accesses.
const POLL: usize = 0;
const READ: usize = 1;

/// Starts a reader unless one runs.
pub(super) fn start(shared: &Rc<SharedMailbox>) {
    let epoch = {
        let state = &mut *shared.state_mut();
        let recently_active = state.ethernet.recently_active(shared.bus.now()).is_some();
        if !state.open || !(state.full || state.poll_requested || state.repeat || state.waiting() || recently_active) {
            return;
        }
        state.tasks = state.tasks.wrapping_add(1);
        if state.reader == Some(state.epoch) {
            shared.work.notify();
            return;
        }
        state.reader = Some(state.epoch);
        state.epoch
    };
    let own = shared.clone();
    shared.bus.spawn(async move { run(own, epoch).await });
}

/// Next step of the reader.
enum Step {
    /// No conversation waits, and there is no sign of mail.
    End,
    /// Request the mail of a lost read again.
    Repeat,
    /// Read the mailbox.
    Read,
    /// Poll its status.
    Poll,
    /// Wait.
    Wait(Instant),
}

async fn run(shared: Rc<SharedMailbox>, epoch: u32) {
    // Earliest times of the next poll, after an empty poll, and of the next access, after a failed access.
    let (mut next_poll, mut hold) = (Instant::default(), Instant::default());
    while let Some(session) = shared.session(epoch) {
        while let Some(stray) = shared.bus.stray_mail(session.station) {
            {
                let state = &mut *shared.state_mut();
                state.counters.strays += 1;
                state.available_at = shared.bus.now();
            }
            // Mail that was read in an earlier session is dropped.
            if stray.sent_at >= session.since {
                delivery::deliver(&shared, &stray.mail, ReadKind::Stray, stray.sent_at);
            }
        }
        let found = match step(&shared, next_poll, hold) {
            Step::End => return,
            Step::Wait(until) => {
                let limit = until.since(shared.bus.now());
                let tasks = shared.state().tasks;
                let more = || (shared.session(epoch).is_none() || shared.state().tasks != tasks).then_some(());
                if shared.bus.within(limit, shared.work.until(more)).await.is_ok() {
                    // The answer of another lane may be available earlier.
                    next_poll = shared.bus.now();
                }
                continue;
            }
            Step::Repeat => repeat(&shared, &session).await,
            Step::Read => read(&shared, epoch, &session).await,
            Step::Poll => poll(&shared, &session).await,
        };
        let now = shared.bus.now();
        next_poll = match found {
            Ok(true) => now,
            Ok(false) => now + pause(&shared, now),
            Err(_) => {
                hold = now + FAILURE_PAUSE;
                hold
            }
        };
    }
}

/// The step that is due.
fn step(shared: &Rc<SharedMailbox>, next_poll: Instant, hold: Instant) -> Step {
    let now = shared.bus.now();
    let state = &mut *shared.state_mut();
    if now < hold {
        return Step::Wait(hold);
    }
    if state.repeat {
        return Step::Repeat;
    }
    if state.full {
        return Step::Read;
    }
    if core::mem::take(&mut state.poll_requested) {
        return Step::Poll;
    }
    let Some((due, sure)) = first_poll(state, now) else {
        state.reader = None;
        return Step::End;
    };
    let due = due.max(next_poll);
    if now < due {
        return Step::Wait(due);
    }
    for lane in state.lanes.iter_mut() {
        if lane.due().is_some_and(|due| due <= now)
            && let Some(pending) = &mut lane.pending
        {
            pending.polled = true;
        }
    }
    if sure { Step::Read } else { Step::Poll }
}

/// When to poll for the first of the expected answers, and whether to read the mailbox at once. The reader also polls
/// for fragments of Ethernet frames while fragments were transferred recently.
fn first_poll(state: &super::shared::MailboxState, now: Instant) -> Option<(Instant, bool)> {
    if state.blocked || (state.ethernet.recently_active(now).is_some() && !state.waiting()) {
        return Some((Instant::default(), false));
    }
    let polls = state.lanes.iter().filter_map(|lane| {
        let pending = lane.waiting()?;
        Some((lane.due()?, !pending.polled && lane.answer_time.is_sure()))
    });
    // An answer that is due now precedes Ethernet: the mailbox may be read at once.
    let ethernet = state.ethernet.recently_active(now).map(|_| (now, false));
    polls.chain(ethernet).min_by_key(|(due, _)| *due)
}

/// Pause after an empty poll: a part of the waiting time of the oldest request, or of the time since the last fragment
/// of an Ethernet frame.
fn pause(shared: &Rc<SharedMailbox>, now: Instant) -> Duration {
    let state = shared.state();
    let waited = state.lanes.iter().filter_map(|lane| lane.waiting()).map(|pending| now.since(pending.at)).max();
    let pause = waited.map(AnswerTime::pause).into_iter().chain(state.ethernet.pause(now)).min();
    pause.unwrap_or(AnswerTime::pause(Duration::ZERO))
}

/// Presumed time at which an access left the send queue: it was requested at `begun` and has just ended.
fn started_at(bus: &Bus, begun: Instant, trip: &mut ShortestTrip) -> Instant {
    let took = bus.now().since(begun);
    begun + (took - trip.took(took).min(took))
}

/// Polls the status of the send mailbox; records that it is full.
async fn poll(shared: &Rc<SharedMailbox>, session: &Session) -> Result<bool, MailboxError> {
    shared.state_mut().counters.polls += 1;
    let begun = shared.bus.now();
    let [status] = shared.bus.fprd_array(session.station, session.send_status()).await?;
    let full = SyncManagerStatus::from_bits(status).mailbox_full;
    let state = &mut *shared.state_mut();
    let seen = started_at(&shared.bus, begun, &mut state.trips[POLL]);
    if full && !state.full {
        state.full = true;
        state.available_at = seen;
    } else if !full {
        state.lanes.iter_mut().for_each(|lane| lane.polled_empty(seen));
    }
    Ok(full)
}

/// Reads the whole send mailbox; false if it is empty.
async fn read(shared: &Rc<SharedMailbox>, epoch: u32, session: &Session) -> Result<bool, MailboxError> {
    let register = RegisterAddress(session.layout.send_offset);
    let begun = shared.bus.now();
    shared.state_mut().reading = true;
    let reply = shared.bus.read_mail(session.station, register, usize::from(session.layout.send_size)).await;
    if shared.session(epoch).is_none() {
        // After an interruption the session may be the same: then the mail is still valid.
        let lasts = shared.state().session.is_some_and(|now| now.since == session.since);
        if let Ok(reply) = reply
            && lasts
            && reply.wkc() != Wkc(0)
        {
            delivery::deliver(shared, &reply.data, ReadKind::Stray, begun);
        }
        return Err(MailboxError::Closed);
    }
    shared.state_mut().reading = false;
    match reply {
        Ok(reply) if reply.wkc() == Wkc(0) => {
            let state = &mut *shared.state_mut();
            state.full = false;
            state.counters.empty_reads += 1;
            let seen = started_at(&shared.bus, begun, &mut state.trips[READ]);
            state.lanes.iter_mut().for_each(|lane| lane.polled_empty(seen));
            Ok(false)
        }
        Ok(reply) => {
            {
                let state = &mut *shared.state_mut();
                let seen = started_at(&shared.bus, begun, &mut state.trips[READ]);
                if !core::mem::take(&mut state.full) {
                    state.available_at = seen;
                }
                state.counters.read += 1;
            }
            let wanted = delivery::deliver(shared, &reply.data, ReadKind::Expected, begun);
            // Further unsolicited mail often follows.
            if !wanted
                && !shared.state().waiting()
                && shared.state().ethernet.recently_active(shared.bus.now()).is_none()
            {
                poll(shared, session).await?;
            }
            Ok(true)
        }
        Err(_) => {
            shared.state_mut().repeat = true;
            Ok(true)
        }
    }
}

/// Requests the last mail again; then the send mailbox contains it.
async fn repeat(shared: &Rc<SharedMailbox>, session: &Session) -> Result<bool, MailboxError> {
    request_repeat(&shared.bus, session).await?;
    let state = &mut *shared.state_mut();
    state.repeat = false;
    state.full = true;
    state.repeated = true;
    state.counters.repeats += 1;
    Ok(true)
}

/// Toggles the repeat request and waits for its acknowledgement (protocol 6.2). A missing acknowledgement does no harm:
/// the next read returns the next mail.
async fn request_repeat(bus: &Bus, session: &Session) -> Result<(), BusError> {
    let register = map::sync_manager(session.send_manager);
    let at = register.offset(SyncManager::ACTIVATE);
    let [activate] = bus.fprd_array(session.station, at).await?;
    let before = SyncManagerActivate::from_bits(activate);
    let repeat_request = !before.repeat_request;
    let activate = SyncManagerActivate { repeat_request, ..before };
    bus.fpwr(session.station, at, &[activate.bits()]).await?;
    let until = bus.now() + REPEAT_LIMIT;
    loop {
        let [control] = bus.fprd_array(session.station, register.offset(SyncManager::PDI_CONTROL)).await?;
        let acknowledged = SyncManagerPdiControl::from_bits(control).repeat_acknowledge == repeat_request;
        if acknowledged || bus.now() >= until {
            return Ok(());
        }
        bus.sleep(REPEAT_PAUSE).await;
    }
}
