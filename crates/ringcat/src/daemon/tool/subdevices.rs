//! SubDevices as the tool lists them: from the last scan, with what their registers show now.

use ringcat_control::refusal::{Refusal, ServiceFault};
use ringcat_control::tool::{
    ClockFeatures, Description, MOST_SUBDEVICES, PdoEntryLine, PdoLine, Piece, PortLine, PortsLine, SubDeviceLine,
    SyncManagerLine,
};
use ringcat_engine::info::{PdoInfo, SubDeviceInfo};
use ringcat_engine::main_device::{MainDevice as Engine, RawDatagram};
use ringcat_engine::{Neighbour, PortReport, SubDevicePorts};
use ringcat_wire::address::StationAddress;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{PortKind, map};
use ringcat_wire::sii::{MailboxLayout, SyncManagerKind};

use super::service::subdevice;
use crate::daemon::refusing::refusal;
use crate::error::Error;
use crate::services::Services;
use crate::supervisor_thread::SupervisorThread;

/// Bits of a SyncManager's control byte: the direction; zero is read by the MainDevice, 4 written by it.
const DIRECTION: u8 = 0x0C;
/// Direction "written by the MainDevice".
const WRITTEN: u8 = 0x04;

/// SubDevices from a position on, with their AL states.
pub(super) fn list(supervisor: &SupervisorThread, from: u16) -> Result<Piece<SubDeviceLine>, Error> {
    let (total, stations, mut these) = supervisor.act(move |engine| known(engine, from))?;
    if these.is_empty() {
        return Ok(Piece { total, these });
    }
    let read = |command, target| RawDatagram::new(command, target, vec![0; 2]).with_resend(true);
    let states = stations.iter().map(|station| read(Command::Fprd, Target::Station(*station, map::AL_STATUS)));
    // The broadcast shows how many answer on each link.
    let all = states.chain([read(Command::Brd, Target::Broadcast(map::AL_STATUS))]).collect();
    let mut replies = supervisor.datagrams(all)?;
    let on_main = match replies.pop() {
        Some(Ok(reply)) if reply.redundant.0 > 0 => reply.main.0,
        _ => u16::MAX,
    };
    for (line, reply) in these.iter_mut().zip(replies) {
        line.is_redundant = line.position >= on_main;
        line.status = match reply {
            Ok(reply) if reply.wkc().0 == 1 => reply.data.first_chunk().map(|bytes| u16::from_le_bytes(*bytes)),
            _ => None,
        };
    }
    Ok(Piece { total, these })
}

fn known(engine: &mut Engine, from: u16) -> (u32, Vec<StationAddress>, Vec<SubDeviceLine>) {
    let all = engine.subdevices();
    let these = all.iter().skip(from.into()).take(MOST_SUBDEVICES);
    let line = |info: &SubDeviceInfo| SubDeviceLine {
        position: info.position.0,
        alias: info.alias,
        identity: identity(info),
        name: info.name.clone(),
        order: info.order_code.clone(),
        ..SubDeviceLine::default()
    };
    (all.len() as u32, these.clone().map(|info| info.station).collect(), these.map(line).collect())
}

/// What is known of a SubDevice. Needs no frame.
pub(super) fn describe(supervisor: &SupervisorThread, position: u16) -> Result<Description, Refusal> {
    let info = subdevice(supervisor, position).info().map_err(|error| refusal(&error))?;
    info.map(|info| description(&info)).ok_or_else(|| Refusal::Service {
        fault: ServiceFault::NoSubDevice,
        text: format!("nothing is known of the SubDevice at position {position}"),
    })
}

fn description(info: &SubDeviceInfo) -> Description {
    let features = &info.controller.features;
    let layout = |it: &MailboxLayout| [(it.receive_offset, it.receive_size), (it.send_offset, it.send_size)];
    let texts = [&info.group, &info.image, &info.order_code, &info.name];
    let has_numbers = (info.coe.0, info.flags.0, info.ebus_current_ma) != (0, 0, 0);
    let sync_managers = info.sync_managers.iter().enumerate().map(|(number, own)| SyncManagerLine {
        start: own.start,
        length: own.length,
        control: own.control,
        enable: own.enable,
        is_output: is_output(own.kind, own.control),
        pdos: info.assigned_pdos(number as u8).map(pdo).collect(),
    });
    Description {
        identity: identity(info),
        alias: info.alias,
        name: info.name.clone(),
        port_kinds: info.controller.ports.map(port_kind),
        features: ClockFeatures { fmmu_bytes: features.fmmu_byte_oriented, dc: features.dc, dc_64: features.dc_64bit },
        bootstrap: info.bootstrap.as_ref().map(layout),
        mailbox: info.mailbox.as_ref().map(layout),
        protocols: info.protocols.0,
        has_general: has_numbers || texts.iter().any(|text| !text.is_empty()),
        group: info.group.clone(),
        image: info.image.clone(),
        coe: info.coe.0,
        flags: info.flags.0,
        current_ma: info.ebus_current_ma,
        sync_managers: sync_managers.collect(),
    }
}

fn identity(info: &SubDeviceInfo) -> [u32; 4] {
    let identity = &info.identity;
    [identity.vendor_id, identity.product_code, identity.revision, identity.serial]
}

/// The MainDevice writes a SyncManager: by its type, and by its control byte where the type is not enough.
fn is_output(kind: SyncManagerKind, control: u8) -> bool {
    match kind {
        SyncManagerKind::Outputs | SyncManagerKind::MailboxOut => true,
        SyncManagerKind::Inputs | SyncManagerKind::MailboxIn => false,
        _ => control & DIRECTION == WRITTEN,
    }
}

/// A PDO of the SII in the words of the tool.
pub(super) fn pdo(pdo: &PdoInfo) -> PdoLine {
    let entries = pdo.entries.iter().map(|entry| PdoEntryLine {
        index: entry.index,
        sub_index: entry.sub_index,
        bits: entry.bit_length,
        name: entry.name.clone(),
    });
    PdoLine { index: pdo.index, name: pdo.name.clone(), entries: entries.collect() }
}

/// Ports of SubDevices from a position on.
pub(super) fn ports(supervisor: &SupervisorThread, from: u16, most: u16) -> Result<Piece<PortsLine>, Error> {
    let all = supervisor.port_report()?;
    let most = usize::from(most).min(MOST_SUBDEVICES);
    let these = all.iter().skip(from.into()).take(most).map(ports_of);
    Ok(Piece { total: all.len() as u32, these: these.collect() })
}

fn ports_of(report: &SubDevicePorts) -> PortsLine {
    PortsLine {
        position: report.position.0,
        delay_ns: report.delay_ns.unwrap_or(0),
        ports: report.ports.each_ref().map(port),
    }
}

fn port_kind(kind: PortKind) -> u8 {
    match kind {
        PortKind::NotImplemented => 0,
        PortKind::NotConfigured => 1,
        PortKind::Ebus => 2,
        PortKind::Mii => 3,
    }
}

fn port(port: &PortReport) -> PortLine {
    let registers = port.registers.unwrap_or_default();
    let is_open = registers.link && !registers.loop_closed;
    // The ends of a broken cable may have lost another SubDevice between them.
    let neighbour = match port.neighbour {
        Some(Neighbour::SubDevice(end)) if is_open => Some((end.position().0, end.port())),
        _ => None,
    };
    PortLine {
        kind: port_kind(port.kind),
        link: [registers.link, registers.loop_closed, registers.signal],
        neighbour: neighbour.map(|(position, _)| position),
        neighbour_port: neighbour.map_or(0, |(_, port)| port),
        is_host: matches!(port.neighbour, Some(Neighbour::Interface(_))),
        received_ns: registers.receive_time_ns.unwrap_or(0),
        delay_ns: port.delay_ns.unwrap_or(0),
        errors: [registers.invalid_frames, registers.symbol_errors, registers.forwarded_errors, registers.lost_links],
    }
}
