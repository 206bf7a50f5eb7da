//! Messages of the acyclic half, and single datagrams with wrong working counters, as lines of text.

use std::fmt::Write;

use ringcat_engine::event::{Event, Message, MessageContent};
use ringcat_engine::ring_status::Occupant;
use ringcat_wire::command::Addressing;
use ringcat_wire::datagram::{Datagram, Target};
use ringcat_wire::frame::Frame;

use super::names::Names;

/// Bytes of a datagram's data that a line shows.
const SHOWN: usize = 32;

/// A message in one line. A frame is a list of its datagrams: command, address, working counter, the beginning of the
/// data.
pub fn message(message: &Message) -> String {
    match &message.content {
        MessageContent::Step(text) => text.clone(),
        MessageContent::Sent { link, frame } => format!("{link} sent {}", frame_in_words(frame)),
        MessageContent::Received { link, frame } => format!("{link} received {}", frame_in_words(frame)),
        // A newer engine may report others.
        other => format!("{other:?}"),
    }
}

fn frame_in_words(bytes: &[u8]) -> String {
    match Frame::parse(bytes) {
        Ok(frame) => {
            let datagrams: Vec<String> = frame.datagrams().map(datagram_in_words).collect();
            format!("{} bytes: {}", bytes.len(), datagrams.join("; "))
        }
        Err(error) => format!("{} bytes: {error}", bytes.len()),
    }
}

fn datagram_in_words(Datagram { header, data, wkc }: Datagram<'_>) -> String {
    let address = match header.command.addressing() {
        Addressing::None => String::new(),
        Addressing::Logical => format!(" {}", header.logical()),
        _ => format!(" {:#06x}:{}", header.adp(), header.ado()),
    };
    let mut line = format!("{}{address} working counter {wkc}, {} bytes", header.command, data.len());
    for byte in data.iter().take(SHOWN) {
        // Writing to a string cannot fail.
        let _ = write!(line, " {byte:02x}");
    }
    if data.len() > SHOWN {
        line.push_str(" ...");
    }
    line
}

/// Single datagrams with wrong working counters.
pub(super) fn of_command(event: &Event, names: &Names, [occupant, _]: [Option<Occupant>; 2]) -> Option<String> {
    Some(match event {
        Event::CyclicCommand { domain, command, logical, length, expected, got, cycles, subdevices } => {
            let of: Vec<String> = subdevices.iter().map(|it| names.of(*it).to_string()).collect();
            let of = if of.is_empty() { String::new() } else { format!(": {}", of.join(", ")) };
            format!(
                "domain {domain}: {command} {logical} of {length} bytes, working counter {got} instead of {expected} \
                 in {cycles} cycles{of}"
            )
        }
        Event::AcyclicCommand { command, target, expected, got, count } => {
            let to = match target {
                Target::None => "several addresses".to_owned(),
                Target::Position(position, register) => {
                    format!("{}, register {register}", names.at(*position, occupant))
                }
                Target::Station(station, register) => {
                    let declared = occupant.and_then(|occupant| occupant.declared);
                    let name = declared.map_or_else(String::new, |it| format!("{}, ", names.of(it)));
                    format!("{name}station {station}, register {register}")
                }
                Target::Broadcast(register) => format!("all SubDevices, register {register}"),
                Target::Logical(address) => format!("logical address {address}"),
            };
            format!("{command} to {to}: working counter {got} instead of {expected}, {count} times")
        }
        _ => return None,
    })
}
