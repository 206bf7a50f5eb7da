//! One SubDevice: classifies its commands by register and derives its declaration.

use std::time::Duration;

use ringcat_engine::config::{DeclaredSyncManager, StartupCommand, StateTimeout, SubDeviceConfig};
use ringcat_wire::al::AlState;
use ringcat_wire::command::Addressing;
use ringcat_wire::register::{SyncManager, map};

use super::areas::{self, Piece};
use super::bus::Bus;
use super::messages::{command_name, contradiction, named};
use super::notices::Notices;
use super::register_commands::{Class, NotSent, class, is_write, planned, register_command};
use super::registers::{Registers, UP, is_complete};
use super::{assignment, clocks, identity, mail, sync_managers};
use crate::eni::{EcatCommand, Eni, EniError, Place, Target, Transition};

/// The declaration of a SubDevice and the mapping of its process data.
pub(super) fn follow(
    eni: &Eni,
    index: usize,
    bus: &Bus,
    notices: &mut Notices,
) -> Result<(SubDeviceConfig, Vec<Piece>), EniError> {
    let subdevice = &eni.subdevices[index];
    let commands = &subdevice.init_commands;
    let registers = Registers::after(commands, &UP);
    let complete = is_complete(commands);
    let mut config = SubDeviceConfig::at(bus.addresses[index]);
    config.expected = identity::expected(eni, index, complete)?;
    let word = |register| registers.word(register).or_else(|| bus.commands.registers.word(register));
    config.watchdog_divider = word(map::WATCHDOG_DIVIDER);
    config.pdi_watchdog_intervals = word(map::WATCHDOG_TIME_PDI);
    config.watchdog_intervals = word(map::WATCHDOG_TIME_PROCESS_DATA);
    config.sii_to_pdi = identity::keeps_eeprom(commands);
    config.declared = sync_managers::declared(eni, index, &registers, complete, notices)?;
    if config.declared.is_none() {
        config.pdos = assignment::of_commands(subdevice, bus.ccs_is_reversed);
    }
    config.declared_bootstrap = sync_managers::bootstrap(eni, index)?;
    config.sync = clocks::of_subdevice(eni, index, &registers, complete, notices);
    let mut startup: Vec<(Place, StartupCommand)> = Vec::new();
    let requests = requests_of_init(commands);
    let mut eeprom_address = None;
    for command in commands {
        if !is_own(eni, index, command, bus, notices) {
            continue;
        }
        check_addresses(eni, index, command)?;
        if identity::is_eeprom_address(command) {
            eeprom_address = Some(command);
        }
        match class(command) {
            Class::Handled if identity::is_sent(command, eeprom_address) => {
                for command in eeprom_address.into_iter().chain([command]) {
                    raw(eni, index, command, &requests, &mut startup, notices)?;
                }
            }
            Class::Handled => {}
            Class::State => config.state_timeouts.extend(time_limits(eni, index, command)?),
            Class::Refused(reason) => {
                notices.add(Some(command.place), Some(index), named("InitCmd", &command.comment), reason)
            }
            Class::Raw => raw(eni, index, command, &requests, &mut startup, notices)?,
        }
    }
    late_sync_managers(index, commands, &registers, config.declared.as_deref_mut().unwrap_or_default(), notices);
    mail::startup(eni, index, bus, &mut startup, notices)?;
    startup.sort_by_key(|(place, _)| *place);
    let own = startup.into_iter().map(|(_, command)| command);
    config.startup = bus.commands.around(index, own);
    let pieces = areas::pieces(eni, index, config.declared.as_deref().unwrap_or_default(), &registers, notices)?;
    Ok((config, pieces))
}

/// Whether a command addresses the SubDevice that contains it; otherwise a notice is added.
fn is_own(eni: &Eni, index: usize, command: &EcatCommand, bus: &Bus, notices: &mut Notices) -> bool {
    let subdevice = &eni.subdevices[index];
    let mut note = |reason: String| {
        notices.add(Some(command.place), Some(index), named("InitCmd", &command.comment), reason);
        false
    };
    let Target::Register { adp, .. } = command.datagram.target else {
        return note("a logical command among those of a SubDevice is not sent".to_owned());
    };
    let name = command_name(command.datagram.command);
    match command.datagram.command.addressing() {
        Addressing::None => false,
        Addressing::AutoIncrement if bus.groups[index].is_some() => true,
        Addressing::AutoIncrement => match subdevice.auto_increment {
            Some(own) if own != adp && subdevice.station == Some(adp) => note(format!(
                "{name} counts positions, but Adp {adp} is the PhysAddr; no SubDevice has this position: not sent \
                 (Cmd 4 and 5 address by PhysAddr)"
            )),
            Some(own) if own != adp => note(format!("{name} with Adp {adp} goes to another SubDevice: not sent")),
            None if subdevice.station == Some(adp) => note(format!(
                "{name} counts positions, but Adp {adp} is the PhysAddr; no SubDevice has this position: not sent \
                 (Cmd 4 and 5 address by PhysAddr)"
            )),
            Some(_) | None => true,
        },
        Addressing::Station => {
            subdevice.station == Some(adp)
                || note(format!("{name} with Adp {adp} goes to another SubDevice or address: not sent"))
        }
        Addressing::Broadcast | Addressing::Logical => {
            note(format!("{name}, a broadcast, among the commands of a SubDevice is not sent"))
        }
    }
}

/// Checks that the written station address equals `PhysAddr`.
fn check_addresses(eni: &Eni, index: usize, command: &EcatCommand) -> Result<(), EniError> {
    let Target::Register { ado, .. } = command.datagram.target else { return Ok(()) };
    let (true, Some(station)) = (ado == map::STATION_ADDRESS, eni.subdevices[index].station) else { return Ok(()) };
    let Some(bytes) = command.datagram.data.first_chunk().filter(|_| is_write(command.datagram.command)) else {
        return Ok(());
    };
    let written = u16::from_le_bytes(*bytes);
    if written == station || written == 0 {
        return Ok(());
    }
    let what = "the station address that is set";
    let hint = "PhysAddr and the command to register 0x0010 must agree: export the file again";
    Err(contradiction(eni, index, command.place, what, station.to_string(), written.to_string(), hint))
}

/// Source and target state of a transition.
pub(crate) const fn states(transition: Transition) -> (AlState, AlState) {
    use AlState::{Boot, Init, Op, PreOp, SafeOp};
    match transition {
        Transition::Ii => (Init, Init),
        Transition::Ip => (Init, PreOp),
        Transition::Pp => (PreOp, PreOp),
        Transition::Pi => (PreOp, Init),
        Transition::Ps => (PreOp, SafeOp),
        Transition::Po => (PreOp, Op),
        Transition::Ss => (SafeOp, SafeOp),
        Transition::Sp => (SafeOp, PreOp),
        Transition::Si => (SafeOp, Init),
        Transition::So => (SafeOp, Op),
        Transition::Os => (Op, SafeOp),
        Transition::Op => (Op, PreOp),
        Transition::Oi => (Op, Init),
        Transition::Ib => (Init, Boot),
        Transition::Bi => (Boot, Init),
    }
}

/// State in the lower bits of AL control and AL status.
const AL_STATE: u8 = 0x0F;

/// Time limits from the checks of AL status. The state requested by AL control must be the state of the transition.
fn time_limits(eni: &Eni, index: usize, command: &EcatCommand) -> Result<Vec<StateTimeout>, EniError> {
    let Target::Register { ado, .. } = command.datagram.target else { return Ok(Vec::new()) };
    let mut limits = Vec::new();
    for transition in &command.transitions {
        let (from, to) = states(*transition);
        if ado == map::AL_CONTROL && is_write(command.datagram.command) {
            let asked = command.datagram.data.first().copied().unwrap_or_default() & AL_STATE;
            // Some tools go through INIT first, or request the current state again.
            if ![to, from, AlState::Init].iter().any(|state| state.code() == asked) {
                let what = format!("AL control at the transition {}", transition.name());
                return Err(contradiction(
                    eni,
                    index,
                    command.place,
                    what,
                    to.to_string(),
                    format!("{asked:#04x}"),
                    "",
                ));
            }
        }
        if let Some(validate) = &command.validate
            && ado == map::AL_STATUS
            && from != to
            && validate.timeout_ms > 0
            && validate.data.first().is_some_and(|state| state & AL_STATE == to.code())
        {
            limits.push(StateTimeout::new(from, to, Duration::from_millis(validate.timeout_ms.into())));
        }
    }
    Ok(limits)
}

/// Converts a command that is sent unchanged.
fn raw(
    eni: &Eni,
    index: usize,
    command: &EcatCommand,
    requests: &[(Transition, Option<Place>)],
    startup: &mut Vec<(Place, StartupCommand)>,
    notices: &mut Notices,
) -> Result<(), EniError> {
    let subject = named("InitCmd", &command.comment);
    match register_command(command) {
        Ok(register) => {
            startup.extend(planned(command, register, Some(index), &subject, notices));
            note_order(index, command, requests, &subject, notices);
            Ok(())
        }
        Err(NotSent::Because(reason)) => {
            notices.add(Some(command.place), Some(index), subject, reason);
            Ok(())
        }
        Err(NotSent::BeyondMemory(got)) => {
            Err(contradiction(eni, index, command.place, subject, "an end within 64 KiB", got, ""))
        }
    }
}

/// Ways to INIT, with the last request of INIT that the file has at each.
fn requests_of_init(commands: &[EcatCommand]) -> [(Transition, Option<Place>); 4] {
    let mut last =
        [Transition::Pi, Transition::Si, Transition::Oi, Transition::Bi].map(|transition| (transition, None));
    for command in commands {
        let is_request = matches!(command.datagram.target, Target::Register { ado, .. } if ado == map::AL_CONTROL);
        if !is_request || !is_write(command.datagram.command) {
            continue;
        }
        let named = last.iter_mut().filter(|(transition, _)| command.transitions.contains(transition));
        named.for_each(|(_, place)| *place = (*place).max(Some(command.place)));
    }
    last
}

/// A command to a register on a way to INIT is sent in INIT, also if the file has it before the request of INIT.
fn note_order(
    index: usize,
    command: &EcatCommand,
    requests: &[(Transition, Option<Place>)],
    subject: &str,
    notices: &mut Notices,
) {
    let is_early = |(transition, place): &&(Transition, Option<Place>)| {
        *place > Some(command.place) && command.transitions.contains(transition)
    };
    let names: Vec<&str> = requests.iter().filter(is_early).map(|(transition, _)| transition.name()).collect();
    if !names.is_empty() {
        let reason = format!("at {}: sent in INIT, in the file before the request of INIT", names.join(", "));
        notices.add(Some(command.place), Some(index), subject, reason);
    }
}

/// SyncManagers of process data that the file activates at SO are active in OP only: outputs that take effect in SAFEOP
/// would be dangerous. A notice reports other SyncManagers that differ at SO.
fn late_sync_managers(
    index: usize,
    commands: &[EcatCommand],
    up: &Registers,
    declared: &mut [DeclaredSyncManager],
    notices: &mut Notices,
) {
    let early = Registers::after(commands, &UP[..2]);
    for (number, register, place) in up.sync_managers().filter(|(_, register, _)| register.activate.enable) {
        let before: [u8; SyncManager::LEN] = early.read(map::sync_manager(number));
        if before == register.encode() {
            continue;
        }
        let found = declared.iter_mut().find(|sm| sm.index == number && sm.role.direction().is_some());
        match found.filter(|_| !SyncManager::decode(&before).activate.enable) {
            Some(late) => late.op_only = true,
            None => {
                let reason = "set before SAFEOP, not before OP: RingCAT sets all SyncManagers there";
                notices.add(Some(place), Some(index), format!("SyncManager {number} at SO"), reason);
            }
        }
    }
}
