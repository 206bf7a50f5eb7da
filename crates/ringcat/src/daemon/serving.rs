//! Answers to questions of a daemon's clients, from the MainDevice that drives the segment: that of the daemon, or that
//! of an application.
//!
//! Every number in a question is checked here. Waits until the answer is there.

mod faults;
mod overview;

use ringcat_control::message::{Answer, EventLine, Query};
use ringcat_control::refusal::Refusal;
use ringcat_wire::address::{Position, RegisterAddress};
use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::soe::Idn;

use self::faults::{LIMIT, expected};
pub use self::overview::overview;
use super::refusing::refusal;
use super::tool;
use crate::error::Error;
use crate::limits::TransferLimits;
use crate::services::Services;
use crate::supervisor_thread::SupervisorThread;
use crate::text::{Names, describe};

/// Most events in an answer.
const MOST_EVENTS: usize = 256;
/// Most bytes of the value of an IDN.
const MOST_VALUE: usize = 16 << 20;
/// Most bytes of registers.
const MOST_REGISTERS: usize = 1024;

/// The answer to a question, and data that was read. `bytes` is data to write.
///
/// # Errors
/// The question is wrong, or it failed.
pub fn answer(supervisor: &SupervisorThread, ask: Query, bytes: Vec<u8>) -> Result<(Answer, Vec<u8>), Refusal> {
    let done = |(): ()| (Answer::Done, Vec::new());
    let data = |bytes: Vec<u8>| (Answer::Data, bytes);
    let subdevice = |position: u16| supervisor.subdevice(Position(position)).within(LIMIT);
    let largest = TransferLimits::default().with_bytes(MOST_VALUE);
    let result = match ask {
        Query::Tool(ask) => return tool::answer(supervisor, ask, bytes),
        Query::Masters => return Err(expected("a question about one master")),
        Query::State => supervisor.snapshot().map(|state| (Answer::State(Box::new(state)), Vec::new())),
        Query::Events { from } => events(supervisor, from).map(|events| (events, Vec::new())),
        Query::AlStatus { position } => subdevice(position)
            .state()
            .map(|it| (Answer::AlStatus { status: it.status.bits(), code: it.code.0 }, Vec::new())),
        Query::SdoUpload { position, index, sub_index } => match sub_index {
            Some(sub_index) => subdevice(position).sdo_read::<Vec<u8>>(index, sub_index),
            None => subdevice(position).sdo_read_complete(index),
        }
        .map(data),
        Query::SdoDownload { position, index, sub_index } => match sub_index {
            Some(sub_index) => subdevice(position).sdo_write(index, sub_index, bytes),
            None => subdevice(position).sdo_write_complete(index, bytes),
        }
        .map(done),
        Query::RegisterRead { position, address, length } => {
            let length = registers(usize::from(length))?;
            subdevice(position).register_read_bytes(RegisterAddress(address), length).map(data)
        }
        Query::RegisterWrite { position, address } => {
            registers(bytes.len())?;
            subdevice(position).register_write(RegisterAddress(address), bytes).map(done)
        }
        Query::RequestState { position, state } => {
            let state = AlState::from_code(state).ok_or_else(|| expected("a state: 1, 2, 3, 4 or 8"))?;
            subdevice(position).request_state(state).map(done)
        }
        Query::Rescan => supervisor.rescan(LIMIT).map(|_| (Answer::Done, Vec::new())),
        Query::Overview => overview(supervisor).map(|overview| (Answer::Overview(overview), Vec::new())),
        Query::IdnRead { position, drive, idn } => {
            subdevice(position).limits(largest).soe_read::<Vec<u8>>(faults::drive(drive)?, Idn(idn)).map(data)
        }
        Query::IdnWrite { position, drive, idn } => {
            subdevice(position).soe_write(faults::drive(drive)?, Idn(idn), bytes).map(done)
        }
        _ => return Err(expected("a query of this version")),
    };
    result.map_err(|error: Error| refusal(&error))
}

fn registers(length: usize) -> Result<usize, Refusal> {
    if (1..=MOST_REGISTERS).contains(&length) {
        Ok(length)
    } else {
        Err(expected(&format!("1 to {MOST_REGISTERS} bytes of registers, not {length}")))
    }
}

fn events(supervisor: &SupervisorThread, from: u64) -> Result<Answer, Error> {
    let mut since = supervisor.events_since(from)?;
    // Numbers have gaps where events were not kept: those behind the last event of this answer belong to the next one.
    if let Some(next) = since.events.get(MOST_EVENTS).map(|event| event.number) {
        since.events.truncate(MOST_EVENTS);
        since.next = next;
        since.missed = next.saturating_sub(from).saturating_sub(since.events.len() as u64);
    }
    let names = Names(Vec::new());
    let line = |event: &ringcat_engine::event::TimedEvent| EventLine {
        number: event.number,
        at_ns: event.at.0,
        text: describe(event, &names),
    };
    let next = since.next;
    Ok(Answer::Events {
        epoch: since.epoch,
        missed: since.missed,
        next,
        events: since.events.iter().map(line).collect(),
    })
}
