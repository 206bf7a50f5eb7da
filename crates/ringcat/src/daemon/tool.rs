//! Answers to the questions of the command line tool, one file per subject.
//!
//! Every number in a question is checked here or by the service that it is for. Waits until the answer is there.

mod application;
mod dictionary;
mod files;
mod master;
mod record;
mod service;
mod siis;
mod subdevices;

use ringcat_control::message::Answer;
use ringcat_control::refusal::Refusal;
use ringcat_control::tool::{IpParameters, ToolAnswer, ToolQuery};
use ringcat_engine::config::IpSettings;
use ringcat_engine::event::{LogFilter, LogLevel};
use ringcat_engine::mail::eoe;
use ringcat_engine::main_device::RawDatagram;
use ringcat_wire::address::{Position, RegisterAddress};
use ringcat_wire::al::AlState;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;

use service::{Answered, LONG, expected, subdevice};

use super::refusing::refusal;
use crate::error::Error;
use crate::limits::TransferLimits;
use crate::services::Services;
use crate::supervisor_thread::SupervisorThread;

/// Most bytes of registers.
const MOST_REGISTERS: usize = 1024;
/// Port of EoE whose parameters are set.
const PORT: u8 = 0;

/// The answer to a question, and data that was read. `bytes` is data to write.
///
/// # Errors
/// The question is wrong, or it failed.
pub(super) fn answer(supervisor: &SupervisorThread, ask: ToolQuery, bytes: Vec<u8>) -> Answered {
    let at = |position: u16| subdevice(supervisor, position);
    let answered = match ask {
        ToolQuery::Master => master::report(supervisor).map(|report| ToolAnswer::Master(Box::new(report))),
        ToolQuery::SubDevices { from } => subdevices::list(supervisor, from).map(ToolAnswer::SubDevices),
        ToolQuery::Description { position } => {
            return subdevices::describe(supervisor, position)
                .map(|it| (Answer::Tool(ToolAnswer::Description(Box::new(it))), Vec::new()));
        }
        ToolQuery::Ports { from, most } => subdevices::ports(supervisor, from, most).map(ToolAnswer::Ports),
        ToolQuery::Objects { position } => dictionary::objects(supervisor, position).map(ToolAnswer::Objects),
        ToolQuery::Object { position, index } => {
            dictionary::object(supervisor, position, index).map(ToolAnswer::Object)
        }
        ToolQuery::Entry { position, index, sub_index } => {
            at(position).sdo_entry(index, sub_index).map(|entry| ToolAnswer::Entry(dictionary::line(entry)))
        }
        ToolQuery::Transfers { position } => siis::transfers(supervisor, position).map(ToolAnswer::Transfers),
        ToolQuery::SiiImages { positions } => return siis::images(supervisor, &positions),
        ToolQuery::Declared { from } => application::declared(supervisor, from).map(ToolAnswer::Declared),
        ToolQuery::Domains => return application::domains(supervisor),
        ToolQuery::Ethernet => master::ethernet(supervisor).map(ToolAnswer::Ethernet),
        other => return act(supervisor, other, bytes),
    };
    answered.map(|answer| (Answer::Tool(answer), Vec::new())).map_err(|error| refusal(&error))
}

/// What reads or writes data.
fn act(supervisor: &SupervisorThread, ask: ToolQuery, bytes: Vec<u8>) -> Answered {
    let at = |position: u16| subdevice(supervisor, position);
    let done = match ask {
        ToolQuery::FileRead { position, name } => return files::read(supervisor, position, name),
        ToolQuery::FilePart { transfer, offset } => return files::part(transfer, offset, bytes),
        ToolQuery::FileWrite { position, name, transfer } => return files::write(supervisor, position, name, transfer),
        ToolQuery::SiiWrite { position, force } => at(position).within(LONG).sii_write(bytes, force).map(|_| ()),
        ToolQuery::AliasWrite { position, alias, force } => at(position).write_alias(alias, force).map(|_| ()),
        ToolQuery::StartState { position, state } => return start_state(supervisor, position, state),
        ToolQuery::UrgentWrite { position, address } => return write_urgently(supervisor, position, address, bytes),
        ToolQuery::Record => return record::write(supervisor),
        ToolQuery::SetIp { position, ip } => return set_ip(supervisor, position, ip),
        ToolQuery::SetDebugLevel { level } => supervisor.set_log_filter(LogFilter::new(LogLevel::from_number(level))),
        _ => return Err(expected("a query of this version")),
    };
    finished(done)
}

fn finished(done: Result<(), Error>) -> Answered {
    done.map(|()| (Answer::Done, Vec::new())).map_err(|error| refusal(&error))
}

/// Requests a state; it goes on without the client.
fn start_state(supervisor: &SupervisorThread, position: u16, state: u8) -> Answered {
    let state = AlState::from_code(state).ok_or_else(|| expected("a state: 1, 2, 3, 4 or 8"))?;
    let begun = supervisor.act(move |engine| {
        let requested = engine.start_state_request(Position(position), state);
        engine.spawn(async move {
            // An event reports its failure.
            let _ = requested.ended().await;
        });
    });
    finished(begun)
}

/// Writes registers before all that waits. A SubDevice that no scan has found gets the datagram by its place.
fn write_urgently(supervisor: &SupervisorThread, position: u16, address: u16, bytes: Vec<u8>) -> Answered {
    if !(1..=MOST_REGISTERS).contains(&bytes.len()) {
        return Err(expected(&format!("1 to {MOST_REGISTERS} bytes of registers, not {}", bytes.len())));
    }
    let register = RegisterAddress(address);
    let is_known = supervisor.act(move |engine| engine.station(Position(position)).is_some());
    if is_known.map_err(|error| refusal(&error))? {
        return finished(subdevice(supervisor, position).register_write_urgently(register, bytes));
    }
    let write = RawDatagram::new(Command::Apwr, Target::Position(Position(position), register), bytes);
    let replies = supervisor.datagrams(vec![write.with_resend(true)]).map_err(|error| refusal(&error))?;
    match replies.into_iter().next() {
        Some(Ok(reply)) if reply.wkc().0 == 1 => Ok((Answer::Done, Vec::new())),
        Some(Err(error)) => Err(Refusal::Failed(error.to_string())),
        Some(Ok(_)) | None => Err(Refusal::Failed(format!("no SubDevice at position {position} has taken the write"))),
    }
}

fn set_ip(supervisor: &SupervisorThread, position: u16, ip: IpParameters) -> Answered {
    let IpParameters { mac, address, mask, gateway, dns, name } = ip;
    let settings = IpSettings::default().with_mac(mac).with_address(address).with_mask(mask);
    let settings = settings.with_gateway(gateway).with_dns(dns).with_name(name);
    let limits = TransferLimits::default().of_message();
    let set = supervisor.start_procedure(move |engine| {
        let mailbox = engine.mailbox(Position(position));
        async move {
            match mailbox {
                Some(mailbox) => {
                    eoe::set_ip(&mailbox, PORT, &settings, limits).await.map_err(|error| error.to_string())
                }
                None => Err(format!("SubDevice at position {position} has no mailbox in use")),
            }
        }
    });
    match set.wait() {
        Ok(Ok(())) => Ok((Answer::Done, Vec::new())),
        Ok(Err(text)) => Err(Refusal::Failed(text)),
        Err(error) => Err(refusal(&error)),
    }
}
