//! Commands to registers: which of them RingCAT performs itself, and those that become start-up commands.

use std::time::Duration;

use ringcat_engine::config::{RegisterAccess, RegisterCommand, StartupAction, StartupCommand};
use ringcat_wire::command::Command;

use super::notices::Notices;
use super::transitions::{Planned, comment};
use crate::eni::{EcatCommand, Place, Target};

/// How a command is handled.
pub(super) enum Class {
    /// RingCAT performs it itself, or it has become part of the declaration.
    Handled,
    /// A state change or the check of its result.
    State,
    /// Sent unchanged.
    Raw,
    /// Not sent.
    Refused(&'static str),
}

/// The class by the addressed register (protocol 3).
pub(super) fn class(command: &EcatCommand) -> Class {
    let Target::Register { ado, .. } = command.datagram.target else { return Class::Handled };
    let zero = command.datagram.data.iter().all(|byte| *byte == 0);
    match ado.0 {
        0x0010..=0x0011 => Class::Handled,
        0x0100..=0x0117 => Class::Refused("RingCAT controls ports and forwarding: not sent"),
        0x0120..=0x0137 => Class::State,
        0x0300..=0x0313 => Class::Handled,
        0x0400 | 0x0410 | 0x0420 => Class::Handled,
        0x0500..=0x050F => Class::Handled,
        0x0600..=0x06FF | 0x0800..=0x087F => Class::Handled,
        0x0980 if is_latch_only(&command.datagram.data) => Class::Raw,
        0x0900..=0x0937 | 0x0980..=0x09A7 => Class::Handled,
        0x09A8..=0x09A9 if zero => Class::Handled,
        _ => Class::Raw,
    }
}

/// Whether the word of 0x0980 assigns or activates units, but no SYNC signal (protocol ES-60).
fn is_latch_only(data: &[u8]) -> bool {
    /// SYNC0 and SYNC1 in the byte at 0x0981.
    const SIGNALS: u8 = 0x06;
    matches!(data, [low, high] if (*low, *high) != (0, 0) && high & SIGNALS == 0)
}

/// Whether it only writes.
pub(super) fn is_write(command: Command) -> bool {
    command.writes() && !command.reads()
}

/// Why a command is not sent.
pub(super) enum NotSent {
    /// The reason.
    Because(&'static str),
    /// It ends beyond the memory of a controller: what it accesses.
    BeyondMemory(String),
}

/// The command of the engine for one that is sent unchanged.
pub(super) fn register_command(command: &EcatCommand) -> Result<RegisterCommand, NotSent> {
    let Target::Register { ado, .. } = command.datagram.target else {
        return Err(NotSent::Because("a logical command is not sent"));
    };
    let access = match (command.datagram.command, &command.validate) {
        (Command::Aprw | Command::Fprw | Command::Brw | Command::Armw | Command::Frmw, _) => {
            return Err(NotSent::Because("a command that reads and writes at once is not sent"));
        }
        (_, Some(validate)) if validate.data.is_empty() => {
            return Err(NotSent::Because("Validate has no data: not sent"));
        }
        (_, Some(validate)) => RegisterAccess::Check {
            data: validate.data.clone(),
            mask: validate.mask.clone(),
            limit: Duration::from_millis(validate.timeout_ms.into()),
        },
        (command, None) if command.reads() => {
            return Err(NotSent::Because("a read whose answer is not compared is not sent"));
        }
        (_, None) if command.datagram.data.is_empty() => {
            return Err(NotSent::Because("a write without data is not sent"));
        }
        (_, None) => RegisterAccess::Write(command.datagram.data.clone()),
    };
    if usize::from(ado.0) + command.datagram.data.len() > 0x1_0000 {
        return Err(NotSent::BeyondMemory(format!("{} bytes at {ado}", command.datagram.data.len())));
    }
    let is_required = command.datagram.count.is_some_and(|count| count > 0);
    Ok(RegisterCommand::new(ado, access).with_retries(command.retries).with_required(is_required))
}

/// The start-up commands at the transitions of a command.
pub(super) fn planned(
    command: &EcatCommand,
    register: RegisterCommand,
    subdevice: Option<usize>,
    subject: &str,
    notices: &mut Notices,
) -> impl Iterator<Item = (Place, StartupCommand)> {
    let EcatCommand { place, transitions, .. } = command;
    let action = StartupAction::Register(register);
    let commands = Planned { place: *place, transitions, subdevice, subject, action }.at_transitions(notices);
    let words = comment(&command.comment);
    commands.into_iter().map(move |(place, command)| (place, command.with_comment(words.clone())))
}
