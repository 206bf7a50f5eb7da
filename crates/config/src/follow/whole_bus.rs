//! Commands to the whole bus (`Master/InitCmds`). RingCAT performs those of every MainDevice itself. Each other one is
//! sent to every SubDevice at its own transitions, so that it also reaches those that come later or lost their power;
//! as a broadcast it would reach those that are there, in whatever state they are.

use std::collections::HashMap;

use ringcat_engine::config::StartupCommand;
use ringcat_wire::command::{Addressing, Command};

use super::messages::{command_name, named};
use super::notices::Notices;
use super::register_commands::{Class, NotSent, class, is_write, planned, register_command};
use super::registers::{Registers, UP};
use crate::eni::{EcatCommand, Eni, EniError, Place, Problem, Target};

/// Commands to the whole bus, as start-up commands.
#[derive(Default)]
pub(super) struct WholeBus {
    /// Registers that RingCAT sets from the declaration, such as those of the watchdogs.
    pub registers: Registers,
    /// Sent before those of the SubDevices (`BeforeSlave`).
    before: Vec<ToSend>,
    /// Sent behind them.
    behind: Vec<ToSend>,
}

/// A command, and the SubDevice that it addresses; `None`: all.
type ToSend = (Option<usize>, StartupCommand);

/// Most memory that commands to all may take, as each SubDevice has its own copy: 64 of 1 KiB for 1,000 SubDevices.
const MAX_BYTES: usize = 64 << 20;
/// Approximate memory of a command besides its data.
const COMMAND: usize = 128;

impl WholeBus {
    /// `stations`: SubDevices by `PhysAddr`.
    pub fn of(eni: &Eni, stations: &HashMap<u16, usize>, notices: &mut Notices) -> Result<WholeBus, EniError> {
        let mut bus = WholeBus::default();
        let mut declared = Vec::new();
        let mut bytes = 0_usize;
        let mut by_position = HashMap::new();
        for (index, subdevice) in eni.subdevices.iter().enumerate() {
            subdevice.auto_increment.map(|adp| *by_position.entry(adp).or_insert(index));
        }
        let addresses = Addresses { stations, by_position };
        for command in eni.main_device.init_commands.iter().filter(|command| !is_own(command)) {
            let subject = named("Master/InitCmd", &command.comment);
            match sent(command, &addresses) {
                Ok(Way::Declared) => declared.push(command.clone()),
                Ok(Way::Sent(subdevice, register)) => {
                    let copies = command.transitions.len() * subdevice.map_or(eni.subdevices.len(), |_| 1);
                    let size = COMMAND + command.datagram.data.len() + command.comment.len();
                    bytes = bytes.saturating_add(size.saturating_mul(copies));
                    if bytes > MAX_BYTES {
                        let what = "bytes of commands to the whole bus, in each SubDevice";
                        return Err(EniError::of_file(Problem::TooMuch { what, limit: MAX_BYTES }));
                    }
                    let commands = planned(command, register, None, &subject, notices);
                    let list = if command.before_subdevices { &mut bus.before } else { &mut bus.behind };
                    list.extend(commands.map(|(_, command): (Place, _)| (subdevice, command)));
                }
                Err(reason) => notices.add(Some(command.place), None, subject, reason),
            }
        }
        bus.registers = Registers::after(&declared, &UP);
        Ok(bus)
    }

    /// The commands of a SubDevice with those to the whole bus before and behind them.
    pub fn around(&self, subdevice: usize, own: impl Iterator<Item = StartupCommand>) -> Vec<StartupCommand> {
        let to_it = |list: &[ToSend]| {
            let list = list.iter().filter(|(target, _)| target.is_none_or(|target| target == subdevice));
            list.map(|(_, command)| command.clone()).collect::<Vec<_>>()
        };
        to_it(&self.before).into_iter().chain(own).chain(to_it(&self.behind)).collect()
    }
}

/// How a command reaches the SubDevices.
enum Way {
    /// As a part of the declaration.
    Declared,
    /// As a start-up command of one or of all.
    Sent(Option<usize>, ringcat_engine::config::RegisterCommand),
}

/// Commands of every MainDevice: RingCAT counts, addresses and resets SubDevices in its own way.
fn is_own(command: &EcatCommand) -> bool {
    let zero = command.datagram.data.iter().all(|byte| *byte == 0);
    let Target::Register { ado, .. } = command.datagram.target else { return false };
    match ado.0 {
        0x0010..=0x0011 | 0x0120..=0x0135 | 0x0300..=0x0313 | 0x0500..=0x050F => true,
        0x0600..=0x06FF | 0x0800..=0x08FF | 0x0900..=0x09FF => true,
        // The second address is always disabled.
        0x0103 => zero,
        _ => command.datagram.command == Command::Nop,
    }
}

/// SubDevices by the addresses of the file.
struct Addresses<'a> {
    stations: &'a HashMap<u16, usize>,
    by_position: HashMap<u16, usize>,
}

/// How a command is sent, or why it is not.
fn sent(command: &EcatCommand, addresses: &Addresses<'_>) -> Result<Way, String> {
    let code = command.datagram.command;
    let Target::Register { adp, ado } = command.datagram.target else {
        return Err("logical commands to the whole bus are not sent".to_owned());
    };
    if ado.0 == 0x0200 {
        return Err("not sent: RingCAT does not use the event requests in datagrams".to_owned());
    }
    let target = match code.addressing() {
        Addressing::Station => Some(addresses.stations.get(&adp).copied()),
        Addressing::AutoIncrement => Some(addresses.by_position.get(&adp).copied()),
        Addressing::None | Addressing::Broadcast | Addressing::Logical => None,
    };
    if target == Some(None) {
        return Err(format!("{} with Adp {adp} addresses no SubDevice of the file: not sent", command_name(code)));
    }
    match class(command) {
        Class::Refused(reason) => return Err(reason.to_owned()),
        Class::Handled | Class::State if target.is_none() && is_write(code) => return Ok(Way::Declared),
        Class::Handled | Class::State => {
            return Err(format!("{} to register {ado}: RingCAT sets it itself, not sent", command_name(code)));
        }
        Class::Raw => {}
    }
    // A broadcast returns the OR of all registers: only 0 is information about a single one.
    if let Some(validate) = command.validate.as_ref().filter(|_| code == Command::Brd)
        && validate.data.iter().any(|byte| *byte != 0)
    {
        return Err("it compares the OR of the registers of all SubDevices: not sent".to_owned());
    }
    match register_command(command) {
        Ok(register) => Ok(Way::Sent(target.flatten(), register)),
        Err(NotSent::Because(reason)) => Err(reason.to_owned()),
        Err(NotSent::BeyondMemory(got)) => Err(format!("{got}, beyond the memory of a controller: not sent")),
    }
}
