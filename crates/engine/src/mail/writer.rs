//! Writes messages one at a time, alternating between the lanes (protocol 6.1).
//!
//! A lost write is repeated with the same counter until the SubDevice accepts it; a SubDevice that received the first
//! write drops the repetition. No other message is sent meanwhile: after it, the old counter would count as new.

use alloc::format;
use alloc::rc::Rc;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::{RegisterAddress, Wkc};
use ringcat_wire::mailbox::Header;

use super::error::MailboxError;
use super::lane::{Lane, Outgoing};
use super::reader;
use super::shared::{Session, SharedMailbox};
use crate::event::Subject;

/// First pause between two attempts to write into a full mailbox; the pauses grow.
const FIRST_PAUSE: Duration = Duration::from_micros(100);
/// Longest pause.
const LONGEST_PAUSE: Duration = Duration::from_millis(1);
/// Number of losses after which a write is given up at its time limit.
const RETRIES: usize = 5;

/// Starts a writer unless one runs.
pub(super) fn start(shared: &Rc<SharedMailbox>) {
    let epoch = {
        let state = &mut *shared.state_mut();
        if state.writer == Some(state.epoch) {
            return;
        }
        state.writer = Some(state.epoch);
        state.epoch
    };
    let own = shared.clone();
    shared.bus.spawn(async move { run(own, epoch).await });
}

async fn run(shared: Rc<SharedMailbox>, epoch: u32) {
    while let Some((message, session)) = next(&shared, epoch) {
        let lane = message.lane;
        shared.state_mut().lanes.of_mut(lane).writing(&message, shared.bus.now());
        let result = write(&shared, epoch, &session, &message).await;
        {
            let state = &mut *shared.state_mut();
            if state.epoch != epoch {
                return;
            }
            state.blocked = false;
            let now = shared.bus.now();
            state.counters.written += u64::from(result.is_ok());
            if lane == Lane::Frames {
                state.ethernet.note_fragment(now);
            }
            state.lanes.of_mut(lane).wrote(&message, result, now);
        }
        shared.bus.step(Subject::Mail, || {
            let (station, protocol, length) = (session.station, lane.protocol(), message.payload.len());
            match &result {
                Ok(()) => {
                    format!("{station}: {protocol:?} mail of {length} bytes written, counter {}", session.counter)
                }
                Err(error) => format!("{station}: {protocol:?} mail of {length} bytes not written: {error}"),
            }
        });
        shared.notify_all();
        reader::start(&shared);
    }
}

/// The next message, alternating between the lanes; `None` ends the writer.
fn next(shared: &Rc<SharedMailbox>, epoch: u32) -> Option<(Outgoing, Session)> {
    let state = &mut *shared.state_mut();
    if state.epoch != epoch {
        return None;
    }
    let count = Lane::COUNT;
    for step in 0..count {
        let at = (state.next_lane + step) % count;
        let Some(session) = state.session.as_mut().filter(|_| state.open) else { break };
        if let Some(message) = state.lanes.used_at_mut(at).and_then(|lane| lane.outbox.pop_front()) {
            state.next_lane = (at + 1) % count;
            session.count();
            return Some((message, *session));
        }
    }
    state.writer = None;
    None
}

async fn write(
    shared: &Rc<SharedMailbox>,
    epoch: u32,
    session: &Session,
    message: &Outgoing,
) -> Result<(), MailboxError> {
    let bus = &shared.bus;
    let mail = encode(session, message.lane, &message.payload);
    let register = RegisterAddress(session.layout.receive_offset);
    let until = bus.now() + message.limit;
    let (mut losses, mut pause) = (0, FIRST_PAUSE);
    loop {
        match bus.write_mail(session.station, register, mail.clone(), session.layout.receive_size).await {
            Ok(reply) if reply.wkc() != Wkc(0) => return Ok(()),
            Ok(_) => {}
            Err(error) => {
                losses += 1;
                shared.state_mut().counters.rewritten += 1;
                if losses > RETRIES && bus.now() >= until {
                    return Err(error.into());
                }
                if shared.session(epoch).is_none() {
                    return Err(MailboxError::Closed);
                }
                continue;
            }
        }
        if bus.now() >= until {
            return Err(MailboxError::Full { limit: message.limit });
        }
        if shared.session(epoch).is_none() {
            return Err(MailboxError::Closed);
        }
        // A SubDevice with a full send mailbox may not empty its receive mailbox.
        shared.state_mut().blocked = true;
        reader::start(shared);
        bus.sleep(pause).await;
        pause = (pause * 3 / 2).min(LONGEST_PAUSE);
        if shared.session(epoch).is_none() {
            return Err(MailboxError::Closed);
        }
    }
}

/// The message with its header.
fn encode(session: &Session, lane: Lane, payload: &[u8]) -> Vec<u8> {
    let mut mail = Vec::with_capacity(Header::LEN + payload.len());
    let header = Header::new(lane.protocol(), session.counter, payload.len() as u16);
    mail.extend_from_slice(&header.encode());
    mail.extend_from_slice(payload);
    mail
}
