//! Files (FoE): the messages of a transfer, each a command of its own in the file, become one transfer (protocol 6.4).
//!
//! A read is its request; a write is a request and the packets behind it. RingCAT sends the acknowledgements, and
//! packets as large as the mailbox of the SubDevice takes.

use ringcat_engine::config::{FileRead, FileWrite, StartupAction};
use ringcat_wire::mailbox::foe::FoeMessage;

use crate::eni::RawMailCommand;

/// The protocol of these commands.
pub(super) const PROTOCOL: &str = "FoE";

/// A transfer, or the reason why commands are not followed.
pub(super) struct Transfer<'a> {
    /// Its first command.
    pub command: &'a RawMailCommand,
    /// What is done, or why nothing is.
    pub action: Result<StartupAction, String>,
}

/// The transfers of the commands of a SubDevice. A disabled request is left out, and so are the packets behind it.
pub(super) fn transfers(commands: &[RawMailCommand]) -> Vec<Transfer<'_>> {
    let mut rest = commands.iter().filter(|command| command.protocol == PROTOCOL).peekable();
    let mut found = Vec::new();
    while let Some(command) = rest.next() {
        let behind = |next: &&RawMailCommand| next.transitions == command.transitions && !is_request(&next.data);
        let mut packets = Vec::new();
        while let Some(next) = rest.next_if(behind) {
            packets.extend((!next.disabled).then_some(next.data.as_slice()));
        }
        let action = match (command.disabled, packets.is_empty()) {
            (true, true) => continue,
            (true, false) => Err("its request is disabled, packets behind it are not: not sent".to_owned()),
            (false, _) => action(&command.data, &packets),
        };
        found.push(Transfer { command, action });
    }
    found
}

fn is_request(message: &[u8]) -> bool {
    matches!(FoeMessage::decode(message), Ok(FoeMessage::Read { .. } | FoeMessage::Write { .. }))
}

fn action(request: &[u8], behind: &[&[u8]]) -> Result<StartupAction, String> {
    match FoeMessage::decode(request) {
        Ok(FoeMessage::Read { password, name }) => {
            let is_acknowledgement =
                |message: &&[u8]| matches!(FoeMessage::decode(message), Ok(FoeMessage::Acknowledge { .. }));
            if !behind.iter().all(is_acknowledgement) {
                return Err("only acknowledgements follow the request of a file: not sent".to_owned());
            }
            Ok(StartupAction::FileRead(FileRead::new(text(name)?).with_password(password)))
        }
        Ok(FoeMessage::Write { password, name }) => {
            let data = contents(behind)?;
            Ok(StartupAction::FileWrite(FileWrite::new(text(name)?, data).with_password(password)))
        }
        _ => Err("its Data is no request of a file, and none is before it: not sent".to_owned()),
    }
}

fn text(name: &[u8]) -> Result<&str, String> {
    // Some tools write the terminating zero of a C string.
    let name = name.strip_suffix(&[0]).unwrap_or(name);
    let name = core::str::from_utf8(name).ok().filter(|name| !name.is_empty() && !name.contains('\0'));
    name.ok_or_else(|| "the name of the file is no text: not sent".to_owned())
}

/// The contents in the packets, which are numbered from 1.
fn contents(packets: &[&[u8]]) -> Result<Vec<u8>, String> {
    if packets.is_empty() {
        return Err("no packet with the contents of the file follows: not sent".to_owned());
    }
    let mut contents = Vec::new();
    for (expected, message) in (1..).zip(packets) {
        match FoeMessage::decode(message) {
            Ok(FoeMessage::Data { packet, data }) if packet == expected => contents.extend_from_slice(data),
            Ok(FoeMessage::Data { packet, .. }) => {
                return Err(format!("packet {packet} follows where packet {expected} is expected: not sent"));
            }
            _ => return Err(format!("packet {expected} is no packet of a file: not sent")),
        }
    }
    Ok(contents)
}
