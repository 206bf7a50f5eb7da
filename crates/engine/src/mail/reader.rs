//! Reads mail when there is some, or while a conversation waits for an answer (protocol 6.1, 6.2).
//!
//! A lost read is recovered with the repeat request. Received mail is passed to `delivery`.

use alloc::rc::Rc;
use core::time::Duration;

use ringcat_wire::address::{RegisterAddress, Wkc};
use ringcat_wire::register::{SyncManager, SyncManagerActivate, SyncManagerPdiControl, SyncManagerStatus, map};

use super::answer_time::{AnswerTime, ShortestTrip};
use super::delivery;
use super::error::MailboxError;
use super::recent::Way;
use super::room::{Room, Session};
use crate::supervisor::{Bus, BusError};
use crate::time::Instant;

/// Time limit for a SubDevice to repeat its last mail.
const REPEAT_LIMIT: Duration = Duration::from_millis(100);
/// Pause between two polls for that.
const REPEAT_PAUSE: Duration = Duration::from_micros(200);
/// Pause after a failed access, so that a SubDevice that is unreachable does not cause continuous traffic.
const FAILURE_PAUSE: Duration = Duration::from_millis(5);

/// Kinds of accesses.
const LOOK: usize = 0;
const READ: usize = 1;

/// Starts a reader unless one runs.
pub(super) fn start(room: &Rc<Room>) {
    let time = {
        let state = &mut *room.state();
        let lively = state.ethernet.lively(room.bus.now()).is_some();
        if !state.open || !(state.full || state.curious || state.repeat || state.waiting() || lively) {
            return;
        }
        state.tasks = state.tasks.wrapping_add(1);
        if state.reader == Some(state.time) {
            room.work.notify();
            return;
        }
        state.reader = Some(state.time);
        state.time
    };
    let own = room.clone();
    room.bus.spawn(async move { run(own, time).await });
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
    Look,
    /// Wait.
    Wait(Instant),
}

async fn run(room: Rc<Room>, time: u32) {
    // Times of the next poll, after one in vain, and of the next access of any kind, after a failed one.
    let (mut next_look, mut hold) = (Instant::default(), Instant::default());
    while let Some(session) = room.session(time) {
        while let Some(stray) = room.bus.stray_mail(session.station) {
            {
                let state = &mut *room.state();
                state.counters.strays += 1;
                state.seen = room.bus.now();
            }
            // Content read from a mailbox of an earlier session is dropped when it arrives in this one.
            if stray.sent_at >= session.since {
                delivery::deliver(&room, &stray.mail, Way::Stray, stray.sent_at);
            }
        }
        let found = match step(&room, next_look, hold) {
            Step::End => return,
            Step::Wait(until) => {
                let limit = until.since(room.bus.now());
                let tasks = room.look().tasks;
                let more = || (room.session(time).is_none() || room.look().tasks != tasks).then_some(());
                if room.bus.within(limit, room.work.until(more)).await.is_ok() {
                    // The answer of another lane may come sooner.
                    next_look = room.bus.now();
                }
                continue;
            }
            Step::Repeat => repeat(&room, &session).await,
            Step::Read => read(&room, time, &session).await,
            Step::Look => look(&room, &session).await,
        };
        let now = room.bus.now();
        next_look = match found {
            Ok(true) => now,
            Ok(false) => now + pause(&room, now),
            Err(_) => {
                hold = now + FAILURE_PAUSE;
                hold
            }
        };
    }
}

/// The step that is due.
fn step(room: &Rc<Room>, next_look: Instant, hold: Instant) -> Step {
    let now = room.bus.now();
    let state = &mut *room.state();
    if now < hold {
        return Step::Wait(hold);
    }
    if state.repeat {
        return Step::Repeat;
    }
    if state.full {
        return Step::Read;
    }
    if core::mem::take(&mut state.curious) {
        return Step::Look;
    }
    let Some((due, sure)) = first_look(state, now) else {
        state.reader = None;
        return Step::End;
    };
    let due = due.max(next_look);
    if now < due {
        return Step::Wait(due);
    }
    for lane in &mut state.lanes {
        if lane.due().is_some_and(|due| due <= now)
            && let Some(asked) = &mut lane.asked
        {
            asked.looked = true;
        }
    }
    if sure { Step::Read } else { Step::Look }
}

/// When to poll for the first of the expected answers, and whether it will certainly be available then. The reader
/// polls for fragments of Ethernet frames while some were transferred recently.
fn first_look(state: &super::room::State, now: Instant) -> Option<(Instant, bool)> {
    if state.blocked || (state.ethernet.lively(now).is_some() && !state.waiting()) {
        return Some((Instant::default(), false));
    }
    let looks = state.lanes.iter().filter_map(|lane| {
        let asked = lane.waiting()?;
        Some((lane.due()?, !asked.looked && lane.answer_time.is_sure()))
    });
    // An answer due now comes first: the poll may read it at once.
    let ethernet = state.ethernet.lively(now).map(|_| (now, false));
    looks.chain(ethernet).min_by_key(|(due, _)| *due)
}

/// Pause after a poll in vain: a part of the time that the oldest answer was waited for, or of the time since the last
/// fragment of an Ethernet frame.
fn pause(room: &Rc<Room>, now: Instant) -> Duration {
    let state = room.look();
    let waited = state.lanes.iter().filter_map(|lane| lane.waiting()).map(|asked| now.since(asked.at)).max();
    let pause = waited.map(AnswerTime::pause).into_iter().chain(state.ethernet.pause(now)).min();
    pause.unwrap_or(AnswerTime::pause(Duration::ZERO))
}

/// Presumed start of an access that began then and has just ended, had it not been queued.
fn asked_at(bus: &Bus, begun: Instant, trip: &mut ShortestTrip) -> Instant {
    let took = bus.now().since(begun);
    begun + (took - trip.took(took).min(took))
}

/// Polls the status of the send mailbox; records where it is full.
async fn look(room: &Rc<Room>, session: &Session) -> Result<bool, MailboxError> {
    room.state().counters.looks += 1;
    let begun = room.bus.now();
    let [status] = room.bus.fprd_array(session.station, session.send_status()).await?;
    let full = SyncManagerStatus::from_bits(status).mailbox_full;
    let state = &mut *room.state();
    let seen = asked_at(&room.bus, begun, &mut state.trips[LOOK]);
    if full && !state.full {
        state.full = true;
        state.seen = seen;
    } else if !full {
        state.lanes.iter_mut().for_each(|lane| lane.looked_in_vain(seen));
    }
    Ok(full)
}

/// Reads the whole send mailbox; false where it is empty.
async fn read(room: &Rc<Room>, time: u32, session: &Session) -> Result<bool, MailboxError> {
    let register = RegisterAddress(session.layout.send_offset);
    let begun = room.bus.now();
    room.state().reading = true;
    let reply = room.bus.read_mail(session.station, register, usize::from(session.layout.send_size)).await;
    if room.session(time).is_none() {
        // The mailbox may be the same after a time in which it was unusable.
        let lasts = room.look().session.is_some_and(|now| now.since == session.since);
        if let Ok(reply) = reply
            && lasts
            && reply.wkc() != Wkc(0)
        {
            delivery::deliver(room, &reply.data, Way::Stray, begun);
        }
        return Err(MailboxError::Closed);
    }
    room.state().reading = false;
    match reply {
        Ok(reply) if reply.wkc() == Wkc(0) => {
            let state = &mut *room.state();
            state.full = false;
            state.counters.empty_reads += 1;
            let seen = asked_at(&room.bus, begun, &mut state.trips[READ]);
            state.lanes.iter_mut().for_each(|lane| lane.looked_in_vain(seen));
            Ok(false)
        }
        Ok(reply) => {
            {
                let state = &mut *room.state();
                let seen = asked_at(&room.bus, begun, &mut state.trips[READ]);
                if !core::mem::take(&mut state.full) {
                    state.seen = seen;
                }
                state.counters.read += 1;
            }
            let wanted = delivery::deliver(room, &reply.data, Way::Usual, begun);
            // Unsolicited mail rarely comes alone.
            if !wanted && !room.look().waiting() && room.look().ethernet.lively(room.bus.now()).is_none() {
                look(room, session).await?;
            }
            Ok(true)
        }
        Err(_) => {
            room.state().repeat = true;
            Ok(true)
        }
    }
}

/// Requests the last mail again; it is in the mailbox then.
async fn repeat(room: &Rc<Room>, session: &Session) -> Result<bool, MailboxError> {
    request_repeat(&room.bus, session).await?;
    let state = &mut *room.state();
    state.repeat = false;
    state.full = true;
    state.repeated = true;
    state.counters.repeats += 1;
    Ok(true)
}

/// Requests the last mail again: toggles the repeat request and waits for its acknowledgement (protocol 6.2). A missing
/// acknowledgement does no harm: the next read brings the mail that would have come next.
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
