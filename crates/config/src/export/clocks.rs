//! Distributed clocks: registers of the SYNC signals, `DC`, the cyclic commands.

use ringcat_engine::config::{ReferenceClock, SyncSignals};
use ringcat_wire::address::RegisterAddress;
use ringcat_wire::command::Command;
use ringcat_wire::register::map;

use crate::configuration::Configuration;
use crate::eni::{CyclicCommand, CyclicState, Datagram, DistributedClock, Place, Target};

/// Bytes of the system time that are distributed.
const TIME: usize = 4;

/// The registers of SYNC0 and SYNC1, the activation last.
pub(super) fn registers(sync: &SyncSignals) -> Vec<(&'static str, RegisterAddress, Vec<u8>)> {
    let cycles = [sync.sync0_cycle_ns.to_le_bytes(), sync.sync1_register_ns().to_le_bytes()].concat();
    vec![
        ("set DC cycle time", map::DC_SYNC0_CYCLE, cycles),
        // The MainDevice that reads the file writes the time.
        ("set DC start time", map::DC_START_TIME, vec![0; 8]),
        ("set DC activation", map::DC_CYCLIC_UNIT_CONTROL, sync.assign_activate.to_le_bytes().to_vec()),
    ]
}

/// The SubDevice with the reference clock.
fn reference(whole: &Configuration) -> Option<usize> {
    match whole.declaration.clocks.as_ref()?.reference {
        ReferenceClock::Declared(subdevice) => Some(subdevice.0),
        _ => None,
    }
}

/// `DC` of a SubDevice.
pub(super) fn of_subdevice(whole: &Configuration, index: usize) -> Option<DistributedClock> {
    let sync = whole.declaration.subdevices[index].sync;
    let reference = reference(whole) == Some(index);
    (sync.is_some() || reference).then(|| DistributedClock {
        place: Place::default(),
        reference,
        cycle_0_ns: sync.map_or(0, |sync| sync.sync0_cycle_ns),
        cycle_1_ns: sync.map_or(0, |sync| sync.sync1_register_ns()),
        shift_ns: sync.map_or(0, |sync| sync.sync0_shift_ns),
    })
}

/// The commands that distribute the time.
pub(super) fn cyclic(whole: &Configuration) -> Vec<CyclicCommand> {
    let Some(clocks) = &whole.declaration.clocks else { return Vec::new() };
    let station = reference(whole).and_then(|index| whole.subdevices[index].station);
    let command = |command, comment: &str, adp| CyclicCommand {
        place: Place::default(),
        states: vec![CyclicState::PreOp, CyclicState::SafeOp, CyclicState::Op],
        comment: comment.to_owned(),
        datagram: Datagram {
            command,
            target: Target::Register { adp, ado: map::DC_SYSTEM_TIME },
            data: vec![0; TIME],
            count: None,
        },
        input_offset: None,
        output_offset: None,
        copies: Vec::new(),
    };
    let shift = clocks.bus_shift.then(|| match station {
        Some(station) => command(Command::Fpwr, "system time of the reference clock", station),
        None => command(Command::Bwr, "system time of all clocks", 0),
    });
    let distribute = station.map(|station| command(Command::Frmw, "system time to all clocks", station));
    shift.into_iter().chain(distribute).collect()
}
