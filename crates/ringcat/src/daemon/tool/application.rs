//! What an application has declared, and the process data that it exchanges.

use std::time::Duration;

use ringcat_control::message::Answer;
use ringcat_control::refusal::Refusal;
use ringcat_control::tool::{
    AreaLine, DeclaredLine, DeclaredSyncManager, DomainLine, IdnLine, IpParameters, MOST_DECLARED, MOST_STARTUP,
    PdoEntryLine, PdoLine, Piece, SdoLine, SyncLine, ToolAnswer,
};
use ringcat_engine::config::{
    ConfigAddress, IpSettings, PdoMapping, StartupAction, SubDeviceConfig, SyncManagerOverride, Watchdog,
};
use ringcat_engine::domain::DomainId;
use ringcat_engine::info::{Direction, SubDeviceInfo};
use ringcat_engine::main_device::{DeclaredSubDevice, MainDevice as Engine, SubDeviceId};

use super::super::refusing::refusal;
use super::service::Answered;
use super::subdevices::pdo;
use crate::error::Error;
use crate::observer::{DomainFmmu, DomainSnapshot, Observer};
use crate::supervisor_thread::SupervisorThread;

/// An application whose cycles run answers within this time.
const CYCLE: Duration = Duration::from_secs(1);
/// SyncManagers of a controller at most.
const MOST_SYNC_MANAGERS: u8 = 16;

/// Declared SubDevices from an index on.
pub(super) fn declared(supervisor: &SupervisorThread, from: u16) -> Result<Piece<DeclaredLine>, Error> {
    supervisor.act(move |engine| {
        let (total, from) = (engine.declared_count(), usize::from(from));
        let indices = (from..total).take(MOST_DECLARED).map(SubDeviceId);
        let these = indices.filter_map(|index| engine.declared(index)).map(|declared| line(&declared));
        Piece { total: total as u32, these: these.collect() }
    })
}

/// A vendor or a product that is not compared.
const ANY: u32 = 0xFFFF_FFFF;

/// Alias and position as `ecrt.h` counts them.
fn place(address: ConfigAddress) -> (u16, u16) {
    match address {
        ConfigAddress::Position(position) => (0, position),
        ConfigAddress::Alias { alias, offset } => (alias, offset),
        // It has no alias: its position is reported where it is found.
        ConfigAddress::Identification { offset, .. } | ConfigAddress::DataWord { offset, .. } => (0, offset),
        _ => (0, 0),
    }
}

fn line(declared: &DeclaredSubDevice) -> DeclaredLine {
    let config = &declared.config;
    let (alias, position) = place(config.address);
    let mut line = DeclaredLine {
        alias,
        position,
        identity: [config.expected.vendor_id, config.expected.product_code].map(|it| it.unwrap_or(ANY)),
        found: declared.position.filter(|_| !declared.is_absent).map(|position| position.0),
        watchdog: [config.watchdog_divider, config.watchdog_intervals],
        sync_managers: sync_managers(config, declared.info.as_ref()),
        sii_to_pdi: config.sii_to_pdi,
        wait_before_safeop_ms: config.wait_before_safeop.as_millis() as u64,
        clock: config.sync.map(|sync| SyncLine {
            assign_activate: sync.assign_activate,
            cycles_ns: [sync.sync0_cycle_ns, sync.sync1_cycle_ns],
            shifts_ns: [sync.sync0_shift_ns, sync.sync1_shift_ns],
        }),
        ..DeclaredLine::default()
    };
    for command in &config.startup {
        match &command.action {
            StartupAction::Sdo(sdo) => line.sdos.push(SdoLine {
                index: sdo.index,
                sub_index: (!sdo.complete_access).then_some(sdo.sub_index),
                length: sdo.data.len() as u32,
                data: beginning(&sdo.data),
            }),
            StartupAction::Idn(idn) => line.idns.push(IdnLine {
                drive: idn.drive,
                idn: idn.idn.0,
                length: idn.data.len() as u32,
                data: beginning(&idn.data),
            }),
            StartupAction::Ip(ip) => line.ip = Some(parameters(ip)),
            _ => {}
        }
    }
    line
}

fn beginning(data: &[u8]) -> Vec<u8> {
    data[..data.len().min(MOST_STARTUP)].to_vec()
}

fn parameters(ip: &IpSettings) -> IpParameters {
    let IpSettings { mac, address, mask, gateway, dns, ref name, .. } = *ip;
    IpParameters { mac, address, mask, gateway, dns, name: name.clone() }
}

/// SyncManagers with PDOs, or with settings of their own.
fn sync_managers(config: &SubDeviceConfig, info: Option<&SubDeviceInfo>) -> Vec<DeclaredSyncManager> {
    let numbers = 0..MOST_SYNC_MANAGERS;
    numbers.filter_map(|index| sync_manager(index, config, info)).collect()
}

fn sync_manager(index: u8, config: &SubDeviceConfig, info: Option<&SubDeviceInfo>) -> Option<DeclaredSyncManager> {
    let set: Option<&SyncManagerOverride> = config.sync_managers.iter().find(|own| own.index == index);
    let declared = config.pdos.iter().flatten().find(|assignment| assignment.sync_manager == index);
    let assigned = |info: &SubDeviceInfo| info.assigned_pdos(index).map(pdo).collect::<Vec<_>>();
    let pdos: Vec<PdoLine> = match declared {
        Some(assignment) => assignment.pdos.iter().map(|mapping| mapped(mapping, info)).collect(),
        None => info.map(assigned).unwrap_or_default(),
    };
    if set.is_none() && pdos.is_empty() {
        return None;
    }
    let of_info = || info?.assigned_pdos(index).next().map(|pdo| pdo.direction);
    let direction = set.map(|own| own.direction).or(declared.map(|own| own.direction)).or_else(of_info)?;
    let watchdog = match set.map(|own| own.watchdog) {
        Some(Watchdog::On) => Some(true),
        Some(Watchdog::Off) => Some(false),
        _ => None,
    };
    Some(DeclaredSyncManager { index, is_output: direction == Direction::Outputs, watchdog, pdos })
}

/// A PDO with declared entries, or with those of the SII.
fn mapped(mapping: &PdoMapping, info: Option<&SubDeviceInfo>) -> PdoLine {
    let known = info.and_then(|info| info.pdo(mapping.index)).map(pdo);
    let Some(entries) = &mapping.entries else {
        return known.unwrap_or(PdoLine { index: mapping.index, ..PdoLine::default() });
    };
    let entry = |it: &ringcat_engine::config::PdoEntry| PdoEntryLine {
        index: it.index,
        sub_index: it.sub_index,
        bits: it.bit_length,
        name: String::new(),
    };
    PdoLine { index: mapping.index, name: String::new(), entries: entries.iter().map(entry).collect() }
}

/// The domains, and their images one behind the other; none without an active application.
pub(super) fn domains(supervisor: &SupervisorThread) -> Answered {
    let Some(observer) = supervisor.observer() else {
        return Ok((Answer::Tool(ToolAnswer::Domains(Vec::new())), Vec::new()));
    };
    let names = supervisor.act(places).map_err(|error| refusal(&error))?;
    let snapshot = observer.snapshot(CYCLE).map_err(|error| Refusal::Failed(error.to_string()))?;
    let is_ring = supervisor.act(|engine| engine.interfaces()[1].is_some()).unwrap_or(false);
    let lines = (0..).map(DomainId).zip(&snapshot.domains);
    let lines = lines.map(|(id, domain)| domain_line(id, domain, &observer, &names, is_ring)).collect();
    let images = snapshot.domains.iter().flat_map(|domain| domain.image.iter().copied()).collect();
    Ok((Answer::Tool(ToolAnswer::Domains(lines)), images))
}

/// Alias and position of each declared SubDevice.
fn places(engine: &mut Engine) -> Vec<(u16, u16)> {
    let all = (0..engine.declared_count()).map(SubDeviceId);
    all.map(|index| engine.declared(index).map_or((0, 0), |it| place(it.config.address))).collect()
}

fn domain_line(
    id: DomainId,
    domain: &DomainSnapshot,
    observer: &Observer,
    names: &[(u16, u16)],
    is_ring: bool,
) -> DomainLine {
    let mut areas: Vec<&DomainFmmu> = observer.fmmus().iter().filter(|fmmu| fmmu.domain == id).collect();
    areas.sort_by_key(|fmmu| (fmmu.image_offset, fmmu.subdevice));
    let area = |fmmu: &&DomainFmmu| AreaLine {
        subdevice: names.get(fmmu.subdevice.0).copied().unwrap_or_default(),
        sync_manager: fmmu.sync_manager,
        is_output: fmmu.direction == Direction::Outputs,
        logical: fmmu.logical.0,
        offset: fmmu.image_offset,
        length: fmmu.length,
    };
    DomainLine {
        logical: areas.iter().map(|fmmu| fmmu.logical.0).min().unwrap_or(0),
        bytes: domain.image.len() as u32,
        wkc: domain.status.wkc,
        expected: domain.status.expected,
        by_link: domain.wkc_by_link.filter(|_| is_ring),
        areas: areas.iter().map(area).collect(),
    }
}
