//! Answers to questions of a daemon's clients, from the MainDevice that drives the segment: that of the daemon, or that
//! of an application.
//!
//! Every number in a question is checked here. Waits until the answer is there.

use std::time::Duration;

use ringcat_control::message::{Answer, Ask, EventLine};
use ringcat_control::refusal::Refusal;
use ringcat_wire::address::{Position, RegisterAddress};
use ringcat_wire::al::AlState;

use crate::error::Error;
use crate::services::Services;
use crate::supervisor_thread::SupervisorThread;
use crate::text::{Names, describe};

/// Most events in an answer.
const MOST_EVENTS: usize = 256;
/// Most bytes of registers.
const MOST_REGISTERS: usize = 1024;
/// Longest time for a service of a SubDevice, and for a scan.
const LIMIT: Duration = Duration::from_secs(20);

/// The answer to a question, and data that was read. `bytes` is data to write.
///
/// # Errors
/// The question is wrong, or it failed.
pub fn answer(supervisor: &SupervisorThread, ask: Ask, bytes: Vec<u8>) -> Result<(Answer, Vec<u8>), Refusal> {
    let done = |(): ()| (Answer::Done, Vec::new());
    let data = |bytes: Vec<u8>| (Answer::Data, bytes);
    let subdevice = |position: u16| supervisor.subdevice(Position(position)).within(LIMIT);
    let result = match ask {
        Ask::Masters => return Err(expected("a question about one master")),
        Ask::State => supervisor.snapshot().map(|state| (Answer::State(Box::new(state)), Vec::new())),
        Ask::Events { from } => events(supervisor, from).map(|events| (events, Vec::new())),
        Ask::AlStatus { position } => subdevice(position)
            .state()
            .map(|(status, code)| (Answer::AlStatus { status: status.bits(), code: code.0 }, Vec::new())),
        Ask::SdoUpload { position, index, sub_index } => match sub_index {
            Some(sub_index) => subdevice(position).sdo_read::<Vec<u8>>(index, sub_index),
            None => subdevice(position).sdo_read_complete(index),
        }
        .map(data),
        Ask::SdoDownload { position, index, sub_index } => match sub_index {
            Some(sub_index) => subdevice(position).sdo_write(index, sub_index, bytes),
            None => subdevice(position).sdo_write_complete(index, bytes),
        }
        .map(done),
        Ask::RegisterRead { position, address, length } => {
            let length = registers(usize::from(length))?;
            subdevice(position).register_read_bytes(RegisterAddress(address), length).map(data)
        }
        Ask::RegisterWrite { position, address } => {
            registers(bytes.len())?;
            subdevice(position).register_write(RegisterAddress(address), bytes).map(done)
        }
        Ask::SiiRead { position } => subdevice(position).sii_read().map(data),
        Ask::RequestState { position, state } => {
            let state = AlState::from_code(state).ok_or_else(|| expected("a state: 1, 2, 3, 4 or 8"))?;
            subdevice(position).request_state(state).map(done)
        }
        Ask::Rescan => supervisor.rescan(LIMIT).map(|_| (Answer::Done, Vec::new())),
        _ => return Err(expected("a question that this version knows")),
    };
    result.map_err(|error: Error| Refusal::Failed(error.to_string()))
}

fn registers(length: usize) -> Result<usize, Refusal> {
    if (1..=MOST_REGISTERS).contains(&length) {
        Ok(length)
    } else {
        Err(expected(&format!("1 to {MOST_REGISTERS} bytes of registers, not {length}")))
    }
}

fn expected(expected: &str) -> Refusal {
    Refusal::Unexpected { expected: expected.to_owned() }
}

fn events(supervisor: &SupervisorThread, from: u64) -> Result<Answer, Error> {
    let mut since = supervisor.events_since(from)?;
    let left = since.events.len().saturating_sub(MOST_EVENTS);
    since.events.truncate(MOST_EVENTS);
    let names = Names(Vec::new());
    let line = |event: &ringcat_engine::event::TimedEvent| EventLine {
        number: event.number,
        at_ns: event.at.0,
        text: describe(event, &names),
    };
    let next = since.next.saturating_sub(left as u64);
    Ok(Answer::Events {
        epoch: since.epoch,
        missed: since.missed,
        next,
        events: since.events.iter().map(line).collect(),
    })
}
