//! What a program asks about the bus and its SubDevices.

use std::ffi::c_char;

use ringcat::wire::register::PortKind;
use ringcat::wire::sii::SyncManagerKind;
use ringcat::{Activity, Neighbour, PdoInfo as Pdo, Position, Services, SubDeviceInfo, SubDevicePorts};

use crate::bus::Bus;
use crate::code::{Code, Outcome};
use crate::types::{MasterInfo, PdoEntryInfo, PdoInfo, Port, ScanProgress, SlaveInfo, SyncInfo};

/// No SubDevice behind a port.
const NO_NEIGHBOUR: u16 = 0xFFFF;
/// Bit of a SyncManager's control byte: writes retrigger the watchdog.
const WATCHDOG: u8 = 0x40;
/// Bits of a SyncManager's control byte: the direction; zero is read by the MainDevice, 4 written by it.
const DIRECTION: u8 = 0x0C;
/// Direction "written by the MainDevice".
const WRITTEN: u8 = 0x04;

/// `ecrt_master`.
///
/// # Errors
/// The acyclic half has ended.
pub fn master(bus: &Bus, app_time: u64) -> Outcome<MasterInfo> {
    let asked = bus.supervisor().with(|engine| {
        let scans = engine.snapshot().activity == Activity::Scanning;
        (engine.subdevices().len(), scans)
    });
    let (count, scans) = asked.map_err(|_| Code::GONE)?;
    let is_up = bus.look()?.is_up.contains(&true);
    Ok(MasterInfo {
        slave_count: count as u32,
        link_up: is_up.into(),
        scan_busy: scans.into(),
        app_time,
        ..MasterInfo::default()
    })
}

/// `ecrt_master_scan_progress`: while a scan runs, the index is 0.
///
/// # Errors
/// The acyclic half has ended.
pub fn scan_progress(bus: &Bus) -> Outcome<ScanProgress> {
    let asked = bus.supervisor().with(|engine| (engine.subdevices().len(), engine.snapshot().activity));
    Ok(match asked.map_err(|_| Code::GONE)? {
        (_, Activity::Scanning | Activity::Unscanned) => {
            ScanProgress { slave_count: bus.look()?.responding().into(), scan_index: 0 }
        }
        (found, _) => ScanProgress { slave_count: found as u32, scan_index: found as u32 },
    })
}

fn at(bus: &Bus, position: u16) -> Outcome<SubDeviceInfo> {
    let mut found = bus.found()?;
    let place = found.iter().position(|info| info.position == Position(position)).ok_or(Code::INVALID)?;
    Ok(found.swap_remove(place))
}

/// `ecrt_master_get_slave`.
///
/// # Errors
/// No such SubDevice.
pub fn slave(bus: &Bus, position: u16) -> Outcome<SlaveInfo> {
    let info = at(bus, position)?;
    let reports = bus.supervisor().port_report().unwrap_or_default();
    let report = reports.iter().find(|report| report.position == Position(position));
    let status = bus.supervisor().subdevice(Position(position)).state().ok();
    let mut name = [0; 64];
    for (to, from) in name.iter_mut().take(63).zip(info.name.bytes()) {
        *to = from as c_char;
    }
    Ok(SlaveInfo {
        position,
        vendor_id: info.identity.vendor_id,
        product_code: info.identity.product_code,
        revision_number: info.identity.revision,
        serial_number: info.identity.serial,
        alias: info.alias,
        current_on_ebus: info.ebus_current_ma,
        ports: ports(&info, report),
        al_state: status.and_then(|(status, _)| status.al_state()).map_or(0, |state| state.code()),
        error_flag: status.is_none_or(|(status, _)| status.error).into(),
        sync_count: info.sync_managers.len().min(255) as u8,
        sdo_count: objects(bus, &info),
        name,
    })
}

/// Number of objects in the dictionary; 0 without SDO information.
fn objects(bus: &Bus, info: &SubDeviceInfo) -> u16 {
    if !info.coe.sdo_information() {
        return 0;
    }
    let listed = bus.supervisor().subdevice(info.position).sdo_info();
    listed.map_or(0, |listed| u16::try_from(listed.len()).unwrap_or(u16::MAX))
}

fn ports(info: &SubDeviceInfo, report: Option<&SubDevicePorts>) -> [Port; 4] {
    std::array::from_fn(|number| {
        let desc = match info.controller.ports[number] {
            PortKind::NotImplemented => 0,
            PortKind::NotConfigured => 1,
            PortKind::Ebus => 2,
            PortKind::Mii => 3,
        };
        let port = report.map(|report| report.ports[number]);
        let registers = port.and_then(|port| port.registers).unwrap_or_default();
        let neighbour = port.and_then(|port| match port.neighbour {
            Some(Neighbour::SubDevice(end)) => Some(end.position().0),
            _ => None,
        });
        let delay = port.and_then(|port| port.delay_ns).unwrap_or(0);
        Port {
            desc,
            link: [registers.link.into(), registers.loop_closed.into(), registers.signal.into()],
            receive_time: registers.receive_time_ns.unwrap_or(0),
            next_slave: neighbour.unwrap_or(NO_NEIGHBOUR),
            delay_to_next_dc: u32::try_from(delay).unwrap_or(0),
        }
    })
}

/// `ecrt_master_get_sync_manager`. PDOs are asked for one by one.
///
/// # Errors
/// No such SubDevice or SyncManager.
pub fn sync_manager(bus: &Bus, position: u16, index: u8) -> Outcome<SyncInfo> {
    let info = at(bus, position)?;
    let own = info.sync_managers.get(usize::from(index)).ok_or(Code::INVALID)?;
    let control = own.control;
    let dir = match own.kind {
        SyncManagerKind::Outputs | SyncManagerKind::MailboxOut => 1,
        SyncManagerKind::Inputs | SyncManagerKind::MailboxIn => 2,
        _ if control & DIRECTION == WRITTEN => 1,
        _ => 2,
    };
    Ok(SyncInfo {
        index,
        dir,
        n_pdos: info.assigned_pdos(index).count() as u32,
        pdos: std::ptr::null(),
        watchdog_mode: if control & WATCHDOG != 0 { 1 } else { 2 },
    })
}

fn assigned(info: &SubDeviceInfo, index: u8, pdo: u16) -> Outcome<&Pdo> {
    info.assigned_pdos(index).nth(pdo.into()).ok_or(Code::INVALID)
}

/// `ecrt_master_get_pdo`. Entries are asked for one by one.
///
/// # Errors
/// No such SubDevice, SyncManager or PDO.
pub fn pdo(bus: &Bus, position: u16, index: u8, pdo: u16) -> Outcome<PdoInfo> {
    let info = at(bus, position)?;
    let found = assigned(&info, index, pdo)?;
    Ok(PdoInfo { index: found.index, n_entries: found.entries.len() as u32, entries: std::ptr::null() })
}

/// `ecrt_master_get_pdo_entry`.
///
/// # Errors
/// No such SubDevice, SyncManager, PDO or entry.
pub fn entry(bus: &Bus, position: u16, index: u8, pdo: u16, entry: u16) -> Outcome<PdoEntryInfo> {
    let info = at(bus, position)?;
    let found = assigned(&info, index, pdo)?.entries.get(usize::from(entry)).ok_or(Code::INVALID)?;
    Ok(PdoEntryInfo { index: found.index, subindex: found.sub_index, bit_length: found.bit_length })
}
