//! What a program reads about the bus and its SubDevices.

use std::ffi::c_char;

use ringcat::daemon::known::{Description, PdoLine, PortLine, SyncManagerLine, ToolAnswer, ToolQuery};
use ringcat::daemon::{Answer, Query, SegmentOverview};

use crate::code::{Code, Outcome};
use crate::responder::{Responder, code_of};
use crate::types::{MasterInfo, PdoEntryInfo, PdoInfo, Port, ScanProgress, SlaveInfo, SyncInfo};

/// No SubDevice behind a port.
const NO_NEIGHBOUR: u16 = 0xFFFF;
/// Bit of a SyncManager's control byte: writes retrigger the watchdog.
const WATCHDOG: u8 = 0x40;
/// Bits of AL status: the state, and that there is an error.
const STATE: u16 = 0x0F;
const ERROR: u16 = 0x10;

/// `ecrt_master`.
pub fn master(seen: &SegmentOverview, app_time: u64) -> MasterInfo {
    MasterInfo {
        slave_count: seen.found,
        link_up: seen.is_up.contains(&true).into(),
        scan_busy: seen.scans.into(),
        app_time,
        ..MasterInfo::default()
    }
}

/// `ecrt_master_scan_progress`: while a scan runs, the index is 0.
pub fn scan_progress(seen: &SegmentOverview) -> ScanProgress {
    match seen.is_scanned {
        true => ScanProgress { slave_count: seen.found, scan_index: seen.found },
        false => ScanProgress { slave_count: seen.responding().into(), scan_index: 0 },
    }
}

fn ask(responder: &Responder, what: Query) -> Outcome<Answer> {
    responder.ask(what, Vec::new()).map(|(answer, _)| answer).map_err(|refusal| code_of(&refusal))
}

fn tool_answer(responder: &Responder, what: ToolQuery) -> Outcome<ToolAnswer> {
    match ask(responder, Query::Tool(what))? {
        Answer::Tool(answer) => Ok(answer),
        _ => Err(Code::IO),
    }
}

fn description(responder: &Responder, position: u16) -> Outcome<Description> {
    match tool_answer(responder, ToolQuery::Description { position })? {
        ToolAnswer::Description(description) => Ok(*description),
        _ => Err(Code::IO),
    }
}

/// What is behind its ports; nothing if there is no report of it.
fn ports(responder: &Responder, position: u16) -> [PortLine; 4] {
    match tool_answer(responder, ToolQuery::Ports { from: position, most: 1 }) {
        Ok(ToolAnswer::Ports(piece)) => {
            let own = piece.these.iter().find(|line| line.position == position);
            own.map(|line| line.ports).unwrap_or_default()
        }
        _ => Default::default(),
    }
}

/// `ecrt_master_get_slave`.
///
/// # Errors
/// No such SubDevice.
pub fn slave(responder: &Responder, position: u16) -> Outcome<SlaveInfo> {
    let description = description(responder, position)?;
    let ports = ports(responder, position);
    let status = match ask(responder, Query::AlStatus { position }) {
        Ok(Answer::AlStatus { status, .. }) => Some(status),
        _ => None,
    };
    let sdo_count = match tool_answer(responder, ToolQuery::Objects { position }) {
        Ok(ToolAnswer::Objects(indices)) => u16::try_from(indices.len()).unwrap_or(u16::MAX),
        _ => 0,
    };
    let mut name = [0; 64];
    for (to, from) in name.iter_mut().take(63).zip(description.name.bytes()) {
        *to = from as c_char;
    }
    let [vendor_id, product_code, revision_number, serial_number] = description.identity;
    Ok(SlaveInfo {
        position,
        vendor_id,
        product_code,
        revision_number,
        serial_number,
        alias: description.alias,
        current_on_ebus: description.current_ma,
        ports: std::array::from_fn(|number| port(description.port_kinds[number], &ports[number])),
        al_state: status.map_or(0, |status| (status & STATE) as u8),
        error_flag: status.is_none_or(|status| status & ERROR != 0).into(),
        sync_count: description.sync_managers.len().min(255) as u8,
        sdo_count,
        name,
    })
}

fn port(kind: u8, line: &PortLine) -> Port {
    Port {
        desc: kind.into(),
        link: line.link.map(u8::from),
        receive_time: line.received_ns,
        next_slave: line.neighbour.unwrap_or(NO_NEIGHBOUR),
        delay_to_next_dc: u32::try_from(line.delay_ns).unwrap_or(0),
    }
}

fn manager(description: &Description, index: u8) -> Outcome<&SyncManagerLine> {
    description.sync_managers.get(usize::from(index)).ok_or(Code::INVALID)
}

/// `ecrt_master_get_sync_manager`. PDOs are asked for one by one.
///
/// # Errors
/// No such SubDevice or SyncManager.
pub fn sync_manager(responder: &Responder, position: u16, index: u8) -> Outcome<SyncInfo> {
    let description = description(responder, position)?;
    let own = manager(&description, index)?;
    Ok(SyncInfo {
        index,
        dir: if own.is_output { 1 } else { 2 },
        n_pdos: own.pdos.len() as u32,
        pdos: std::ptr::null(),
        watchdog_mode: if own.control & WATCHDOG != 0 { 1 } else { 2 },
    })
}

fn assigned(description: &Description, index: u8, pdo: u16) -> Outcome<&PdoLine> {
    // Without this SyncManager there is no such PDO either.
    manager(description, index)?.pdos.get(usize::from(pdo)).ok_or(Code::INVALID)
}

/// `ecrt_master_get_pdo`. Entries are asked for one by one.
///
/// # Errors
/// No such SubDevice, SyncManager or PDO.
pub fn pdo(responder: &Responder, position: u16, index: u8, pdo: u16) -> Outcome<PdoInfo> {
    let description = description(responder, position)?;
    let found = assigned(&description, index, pdo)?;
    Ok(PdoInfo { index: found.index, n_entries: found.entries.len() as u32, entries: std::ptr::null() })
}

/// `ecrt_master_get_pdo_entry`.
///
/// # Errors
/// No such SubDevice, SyncManager, PDO or entry.
pub fn entry(responder: &Responder, position: u16, index: u8, pdo: u16, entry: u16) -> Outcome<PdoEntryInfo> {
    let description = description(responder, position)?;
    let found = assigned(&description, index, pdo)?.entries.get(usize::from(entry)).ok_or(Code::INVALID)?;
    Ok(PdoEntryInfo { index: found.index, subindex: found.sub_index, bit_length: found.bits })
}
