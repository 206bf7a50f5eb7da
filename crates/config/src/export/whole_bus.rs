//! `Master`: name, addresses of the frames, the commands for the whole bus with which a start begins.

use ringcat_wire::address::RegisterAddress;
use ringcat_wire::command::Command;
use ringcat_wire::register::map;

use crate::eni::{Datagram, EcatCommand, MainDevice, Place, Requires, Target, Transition};

/// Frames go to all.
const DESTINATION: [u8; 6] = [0xFF; 6];
/// Repetitions of a command with a wrong working counter.
const RETRIES: u16 = 3;
/// The second address of the data link layer; it is not used.
const SECOND_ADDRESS: RegisterAddress = RegisterAddress(0x0103);
/// Bytes of 16 FMMUs, and of 16 SyncManagers with what is behind them.
const ALL: usize = 256;

pub(super) fn main_device(name: String) -> MainDevice {
    let commands: [(&str, RegisterAddress, Vec<u8>); 9] = [
        ("clear configured addresses", map::STATION_ADDRESS, vec![0; 2]),
        ("clear crc register", map::RX_ERROR_COUNTER, vec![0; 8]),
        ("clear fmmu", map::FMMU_BASE, vec![0; ALL]),
        ("clear sm", map::SYNC_MANAGER_BASE, vec![0; ALL]),
        ("clear dc system time", map::DC_SYSTEM_TIME, vec![0; 32]),
        ("clear dc cycle cfg", map::DC_ACTIVATION, vec![0]),
        ("reset dc speed", map::DC_SPEED_COUNTER_START, vec![0x00, 0x10]),
        ("configure dc filter", map::DC_FILTER_DIFFERENCE, vec![0x00, 0x0C]),
        ("disable second physical address", SECOND_ADDRESS, vec![0]),
    ];
    MainDevice {
        name,
        destination: DESTINATION.to_vec(),
        source: vec![0; 6],
        init_commands: commands.into_iter().map(|(comment, ado, data)| broadcast(comment, ado, data)).collect(),
        ..MainDevice::default()
    }
}

fn broadcast(comment: &str, ado: RegisterAddress, data: Vec<u8>) -> EcatCommand {
    EcatCommand {
        place: Place::default(),
        transitions: vec![Transition::Ip],
        before_subdevices: true,
        comment: comment.to_owned(),
        requires: Some(Requires::Cycle),
        datagram: Datagram { command: Command::Bwr, target: Target::Register { adp: 0, ado }, data, count: None },
        retries: RETRIES,
        validate: None,
        timeout_ms: None,
    }
}
