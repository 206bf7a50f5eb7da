//! Whose a mail is (decision 0007).

use alloc::rc::Rc;

use ringcat_wire::mailbox::coe::{CoeHeader, CoeService, Emergency};
use ringcat_wire::mailbox::{ErrorReply, Message, Protocol};

use super::lane::{Arrival, Lane, LaneState};
use super::protocol_error;
use super::recent::Way;
use super::room::{Room, State};
use super::unsolicited::{Unclaimed, Unsolicited};
use crate::event::Event;
use crate::time::Instant;

/// SoE services that are answers; the others come unasked (facts 6.6).
const SOE_ANSWERS: [u8; 2] = [2, 4];
/// Offset of the flags in an AoE header, and the bit of an answer (facts 6.7).
const AOE_FLAGS_AT: usize = 18;
const AOE_RESPONSE: u8 = 0x01;
/// EoE types that are answers: set IP, set filter, get IP, get filter (facts 6.5).
const EOE_ANSWERS: [u8; 4] = [3, 5, 7, 9];

/// Takes in the content of the send mailbox. Any bytes are allowed. True where somebody waited for it.
pub(super) fn deliver(room: &Rc<Room>, mail: &[u8], way: Way) -> bool {
    let wanted = {
        let state = &mut *room.state();
        let Ok(message) = Message::decode(mail) else {
            state.counters.malformed += 1;
            return false;
        };
        if is_double(state, &message, way, room.bus.now()) {
            state.counters.duplicates += 1;
            return false;
        }
        if let Some(error) = protocol_error::told_by(&message) {
            state.last_error = error;
        }
        sort(room, state, &message)
    };
    room.news.notify();
    wanted
}

fn is_double(state: &mut State, message: &Message<'_>, way: Way, now: Instant) -> bool {
    // What a repeat brings may be the mail before the one that was lost.
    let way = if state.repeated && way == Way::Usual { Way::Repeat } else { way };
    let double = state.recent.is_double(message.header.counter, message.payload, way, now);
    state.repeated &= double || way != Way::Repeat;
    double
}

fn sort(room: &Rc<Room>, state: &mut State, message: &Message<'_>) -> bool {
    let payload = message.payload;
    let first = payload.first().copied().unwrap_or(0);
    match message.header.protocol {
        Protocol::Error => refused(state, payload, room.bus.now()),
        Protocol::Coe => coe(room, state, message),
        Protocol::Foe => answer(state, Lane::Foe, message, Unsolicited::Other),
        Protocol::Soe if SOE_ANSWERS.contains(&(first & 0x07)) => answer(state, Lane::Soe, message, Unsolicited::Other),
        Protocol::Soe => shelve(state, message, Unsolicited::Soe),
        Protocol::Aoe if payload.get(AOE_FLAGS_AT).is_some_and(|flags| flags & AOE_RESPONSE != 0) => {
            answer(state, Lane::Aoe, message, Unsolicited::Other)
        }
        Protocol::Aoe => shelve(state, message, Unsolicited::Aoe),
        Protocol::Voe => answer(state, Lane::Voe, message, Unsolicited::Voe),
        Protocol::Eoe if EOE_ANSWERS.contains(&(first & 0x0F)) => answer(state, Lane::Eoe, message, Unsolicited::Other),
        Protocol::Eoe if state.ethernet.attached => {
            state.ethernet.take(payload, room.bus.now());
            false
        }
        Protocol::Eoe => shelve(state, message, Unsolicited::Ethernet),
        Protocol::Other(_) => shelve(state, message, Unsolicited::Other),
    }
}

fn coe(room: &Rc<Room>, state: &mut State, message: &Message<'_>) -> bool {
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
            state.shelves.emergencies().push((room.bus.now(), emergency));
            room.bus.report(Event::Emergency { subdevice: room.subdevice, emergency });
            false
        }
        // An abort has the service of a request, whoever sends it.
        CoeService::SdoRequest | CoeService::SdoResponse | CoeService::SdoInformation => {
            answer(state, Lane::Coe, message, Unsolicited::Other)
        }
        CoeService::TxPdo | CoeService::RxPdo if state.lanes[Lane::Coe as usize].pdo == Some(*header) => {
            answer(state, Lane::Coe, message, Unsolicited::Other)
        }
        CoeService::TxPdo
        | CoeService::RxPdo
        | CoeService::TxPdoRemote
        | CoeService::RxPdoRemote
        | CoeService::Other(_) => shelve(state, message, Unsolicited::Other),
    }
}

/// To whoever waits in a lane; without one, onto a shelf.
fn answer(state: &mut State, lane: Lane, message: &Message<'_>, else_to: Unsolicited) -> bool {
    let arrival = Arrival::Payload(message.payload.to_vec());
    if state.lanes[lane as usize].arrive(arrival, state.seen) {
        return true;
    }
    if else_to == Unsolicited::Other {
        state.counters.unclaimed += 1;
    }
    shelve(state, message, else_to)
}

fn shelve(state: &mut State, message: &Message<'_>, kind: Unsolicited) -> bool {
    let unclaimed = Unclaimed { protocol: message.header.protocol, payload: message.payload.to_vec() };
    state.shelves.ring(kind).push(unclaimed);
    false
}

/// An error reply does not say to what. It goes to the request that waits; of several, first to one whose protocol the
/// SubDevice has not shown to know, then to the oldest. Whoever writes a message in parts is told, too. It is certain only
/// where it can be to nothing else; else the answer to the request that it ends may still come.
fn refused(state: &mut State, payload: &[u8], now: Instant) -> bool {
    let Some(bytes) = payload.first_chunk() else {
        state.counters.malformed += 1;
        return false;
    };
    let reply = ErrorReply::decode(bytes);
    let mut in_parts = false;
    for lane in state.lanes.iter_mut().filter(|lane| lane.parts_until.is_some_and(|until| now < until)) {
        lane.refusal = Some(reply);
        in_parts = true;
    }
    let waiting = |proven| state.lanes.iter().filter(|l| l.waiting().is_some() && l.proven == proven).count();
    let is_late = |lane: &LaneState| lane.late_until.is_some_and(|until| now < until);
    // Only a protocol that is not known is refused for itself.
    let unknown = reply.detail == ErrorReply::UNSUPPORTED_PROTOCOL && waiting(false) > 0;
    let others = if unknown { waiting(false) } else { waiting(false) + waiting(true) };
    let late = state.lanes.iter().any(|lane| is_late(lane) && !(unknown && lane.proven));
    let doubtful = in_parts || late || others > 1;
    let candidates = state.lanes.iter_mut().filter(|lane| lane.waiting().is_some());
    match candidates.min_by_key(|lane| (lane.proven, lane.asked.map(|asked| asked.at))) {
        Some(lane) => lane.arrive(Arrival::Refused(reply, doubtful), state.seen),
        None => {
            state.counters.unclaimed += u64::from(!in_parts);
            false
        }
    }
}
