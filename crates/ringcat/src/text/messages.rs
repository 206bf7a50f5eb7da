//! Messages of the acyclic half as lines of text.

use std::fmt::Write;

use ringcat_engine::event::{Message, MessageContent};
use ringcat_wire::command::Addressing;
use ringcat_wire::datagram::Datagram;
use ringcat_wire::frame::Frame;

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
