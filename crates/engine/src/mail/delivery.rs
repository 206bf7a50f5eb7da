//! Delivers a mail to its lane (decision 0007).

use alloc::format;
use alloc::rc::Rc;

use ringcat_wire::mailbox::coe::{CoeHeader, CoeService, Emergency, SdoInformation};
use ringcat_wire::mailbox::soe::SoeMessage;
use ringcat_wire::mailbox::{ErrorReply, Message, Protocol};

use super::lane::{Arrival, Lane, LaneState, Refusal};
use super::protocol_error;
use super::recent::ReadKind;
use super::shared::{MailboxState, SharedMailbox};
use super::unsolicited::{Unclaimed, Unsolicited};
use crate::event::{Notice, Subject};
use crate::time::Instant;

/// SoE services that are answers; the others are unsolicited (protocol 6.6).
const SOE_ANSWERS: [u8; 2] = [2, 4];
/// Offset of the flags in an AoE header, and the bit of an answer (protocol 6.7).
const AOE_FLAGS_AT: usize = 18;
const AOE_RESPONSE: u8 = 0x01;
/// Details of error replies about the mailbox header or the service, not about length, content or memory.
const ABOUT_HEADERS: [u16; 5] = [
    ErrorReply::SYNTAX,
    ErrorReply::UNSUPPORTED_PROTOCOL,
    ErrorReply::INVALID_CHANNEL,
    ErrorReply::SERVICE_NOT_SUPPORTED,
    ErrorReply::INVALID_HEADER,
];
/// EoE types that are answers: set IP, set filter, get IP, get filter (protocol 6.5).
const EOE_ANSWERS: [u8; 4] = [3, 5, 7, 9];

/// Takes the content of the send mailbox. Any bytes are allowed. True if a conversation waited for it.
pub(super) fn deliver(shared: &Rc<SharedMailbox>, mail: &[u8], kind: ReadKind, sent: Instant) -> bool {
    shared.bus.step(Subject::Mail, || {
        let station = shared.state().session.map(|session| session.station).unwrap_or_default();
        match Message::decode(mail) {
            Ok(Message { header, payload }) => {
                let (protocol, counter) = (header.protocol, header.counter);
                format!("{station}: {protocol:?} mail of {} bytes read, counter {counter}", payload.len())
            }
            Err(error) => format!("{station}: mail that cannot be read: {error:?}"),
        }
    });
    let wanted = {
        let state = &mut *shared.state_mut();
        let Ok(message) = Message::decode(mail) else {
            state.counters.malformed += 1;
            return false;
        };
        if is_duplicate(state, &message, kind, sent) {
            state.counters.duplicates += 1;
            return false;
        }
        if let Some(error) = protocol_error::error_in(&message) {
            state.last_error = error;
        }
        sort(shared, state, &message)
    };
    shared.changed.notify();
    wanted
}

fn is_duplicate(state: &mut MailboxState, message: &Message<'_>, kind: ReadKind, sent: Instant) -> bool {
    // A repeat may return the mail before the lost one.
    let kind = if state.repeated && kind == ReadKind::Expected { ReadKind::Repeat } else { kind };
    let duplicate = state.recent.is_duplicate(message.header.counter, message.payload, kind, sent);
    state.repeated &= duplicate || kind != ReadKind::Repeat;
    duplicate
}

fn sort(shared: &Rc<SharedMailbox>, state: &mut MailboxState, message: &Message<'_>) -> bool {
    let payload = message.payload;
    let first = payload.first().copied().unwrap_or(0);
    // Ethernet frames have no answer, but a SubDevice that sends frames supports EoE.
    if message.header.protocol == Protocol::Eoe {
        state.lanes.of_mut(Lane::Frames).proven = true;
    }
    match message.header.protocol {
        Protocol::Error => refused(state, message, shared.bus.now()),
        Protocol::Coe => coe(shared, state, message),
        Protocol::Foe => answer(state, Lane::Foe, message),
        Protocol::Soe if SOE_ANSWERS.contains(&(first & 0x07)) => answer(state, Lane::Soe, message),
        Protocol::Soe => keep(state, message, Unsolicited::Soe),
        Protocol::Aoe if payload.get(AOE_FLAGS_AT).is_some_and(|flags| flags & AOE_RESPONSE != 0) => {
            answer(state, Lane::Aoe, message)
        }
        Protocol::Aoe => keep(state, message, Unsolicited::Aoe),
        Protocol::Voe => answer(state, Lane::Voe, message),
        Protocol::Eoe if EOE_ANSWERS.contains(&(first & 0x0F)) => answer(state, Lane::Eoe, message),
        Protocol::Eoe if state.ethernet.attached => {
            state.ethernet.take(payload, shared.bus.now());
            false
        }
        Protocol::Eoe => keep(state, message, Unsolicited::Ethernet),
        protocol @ Protocol::Other(code)
            if state.lanes.of(Lane::Other(code)).is_some_and(|lane| lane.expected == Some(protocol)) =>
        {
            answer(state, Lane::Other(code), message)
        }
        Protocol::Other(_) => keep(state, message, Unsolicited::Other),
    }
}

fn coe(shared: &Rc<SharedMailbox>, state: &mut MailboxState, message: &Message<'_>) -> bool {
    let Some((header, rest)) = message.payload.split_first_chunk() else {
        state.counters.malformed += 1;
        return false;
    };
    match CoeHeader::decode(header).service {
        CoeService::Emergency => {
            let Some(bytes) = rest.first_chunk() else {
                state.counters.malformed += 1;
                return false;
            };
            let emergency = Emergency::decode(bytes);
            state.emergencies.push(shared.bus.now(), &emergency);
            shared.bus.notice(Notice::Emergency { subdevice: shared.subdevice.get(), emergency });
            false
        }
        // An abort has the service of a request in both directions.
        CoeService::SdoRequest | CoeService::SdoResponse | CoeService::SdoInformation => {
            answer(state, Lane::Coe, message)
        }
        CoeService::TxPdo | CoeService::RxPdo
            if state.lanes.of(Lane::Coe).is_some_and(|lane| lane.pdo == Some(*header)) =>
        {
            answer(state, Lane::Coe, message)
        }
        CoeService::Other(_) if state.lanes.of(Lane::Coe).is_some_and(|lane| lane.any) => {
            answer(state, Lane::Coe, message)
        }
        CoeService::TxPdo
        | CoeService::RxPdo
        | CoeService::TxPdoRemote
        | CoeService::RxPdoRemote
        | CoeService::Other(_) => keep(state, message, Unsolicited::Other),
    }
}

/// Passes a mail to the conversation in the lane; without a waiting conversation it is kept as unsolicited mail.
fn answer(state: &mut MailboxState, lane: Lane, message: &Message<'_>) -> bool {
    let arrival = Arrival::Payload(message.payload.to_vec());
    let own = state.lanes.of_mut(lane);
    // A conversation takes one answer at a time; if the queue is full, the oldest one is not the expected answer.
    let oldest = if own.is_full() { own.take() } else { None };
    let wanted = own.arrive(arrival, state.available_at, is_last(lane, message.payload));
    if let Some(oldest) = oldest {
        keep_unclaimed(state, lane, oldest);
    }
    if !wanted {
        keep_unclaimed(state, lane, Arrival::Payload(message.payload.to_vec()));
    }
    wanted
}

/// Whether a mail ends an answer: SoE and SDO information may have further parts.
pub(super) fn is_last(lane: Lane, payload: &[u8]) -> bool {
    match lane {
        Lane::Soe => SoeMessage::decode(payload).is_ok_and(|part| part.error || !part.incomplete),
        Lane::Coe => SdoInformation::decode(payload).map_or(true, |part| !part.incomplete),
        Lane::Foe | Lane::Aoe | Lane::Voe | Lane::Eoe | Lane::Frames | Lane::Other(_) => true,
    }
}

/// Keeps a mail that no conversation waits for: unsolicited mail, or a late answer.
pub(super) fn keep_unclaimed(state: &mut MailboxState, lane: Lane, arrival: Arrival) {
    let (kind, protocol, payload) = match arrival {
        Arrival::Payload(payload) => (lane.unclaimed_kind(), lane.protocol(), payload),
        Arrival::Refused(reply, _) => (Unsolicited::Other, Protocol::Error, reply.encode().to_vec()),
    };
    if kind == Unsolicited::Other {
        state.counters.unclaimed += 1;
    }
    state.unsolicited.of_kind(kind).push(Unclaimed { protocol, payload });
}

fn keep(state: &mut MailboxState, message: &Message<'_>, kind: Unsolicited) -> bool {
    let unclaimed = Unclaimed { protocol: message.header.protocol, payload: message.payload.to_vec() };
    state.unsolicited.of_kind(kind).push(unclaimed);
    false
}

/// Delivers an error reply. It does not name its request: it goes to the waiting request; of several, first to one of a
/// protocol that the SubDevice has not proven to support, then to the oldest. A sender of a message in parts receives
/// it, too. The assignment is certain only if the reply can belong to no other message: neither to a request that was
/// given up nor to a message without an answer. Otherwise the answer to the ended request may still arrive.
fn refused(state: &mut MailboxState, message: &Message<'_>, now: Instant) -> bool {
    let Some(bytes) = message.payload.first_chunk() else {
        state.counters.malformed += 1;
        return false;
    };
    let reply = ErrorReply::decode(bytes);
    let mut in_parts = false;
    for lane in state.lanes.iter_mut().filter(|lane| lane.parts_until.is_some_and(|until| now < until)) {
        lane.refusal = Some(reply);
        in_parts = true;
    }
    let is_waiting = |lane: &LaneState| lane.waiting().is_some();
    let is_late = |lane: &LaneState| !lane.settling && lane.late_until.is_some_and(|until| now < until);
    let may_be_to = |lane: &LaneState| is_waiting(lane) || is_late(lane) || lane.is_unanswered(now);
    // A protocol that the SubDevice has proven to support is not refused as unsupported.
    let unknown = reply.detail == ErrorReply::UNSUPPORTED_PROTOCOL
        && state.lanes.iter().any(|lane| !lane.proven && may_be_to(lane));
    let in_question = |lane: &LaneState| !(unknown && lane.proven);
    let lanes = || state.lanes.iter().filter(|lane| in_question(lane));
    let frames = state.lanes.of(Lane::Frames);
    // Fragments differ in length and content only: a SubDevice that sends frames itself accepts their header.
    let to_frames = frames.is_some_and(|frames| {
        in_question(frames) && frames.is_unanswered(now) && !(frames.proven && ABOUT_HEADERS.contains(&reply.detail))
    });
    let is_frames = |lane: &LaneState| frames.is_some_and(|frames| core::ptr::eq(lane, frames));
    let others = lanes().any(|lane| is_late(lane) || (lane.is_unanswered(now) && !is_frames(lane)));
    let refusal = if in_parts || others || lanes().filter(|lane| is_waiting(lane)).count() > 1 {
        Refusal::Uncertain
    } else if to_frames {
        Refusal::BesideFrames
    } else {
        Refusal::Certain
    };
    let candidates = state.lanes.iter_mut().filter(|lane| is_waiting(lane) && in_question(lane));
    match candidates.min_by_key(|lane| (lane.proven, lane.pending.map(|pending| pending.at))) {
        Some(lane) => lane.arrive(Arrival::Refused(reply, refusal), state.available_at, true),
        None if in_parts => false,
        None => {
            state.counters.unclaimed += 1;
            keep(state, message, Unsolicited::Other)
        }
    }
}
