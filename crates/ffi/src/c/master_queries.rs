//! Queries about the bus: states, links, SubDevices.

use std::ffi::{c_int, c_uint};
use std::time::Duration;

use ringcat::Link;

use super::memory::put;
use super::objects::{MasterObject, ec_master_t};
use super::waiting::call;
use crate::code::{Code, Outcome};
use crate::information::{entry, master, pdo, scan_progress, slave, sync_manager};
use crate::types::{MasterInfo, PdoEntryInfo, PdoInfo, ScanProgress, SegmentState, SlaveInfo, SyncInfo};

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master(handle: *mut ec_master_t, master_info: *mut MasterInfo) -> c_int {
    let ask = |MasterObject(owner): &MasterObject| {
        let info = master(&owner.master.overview()?, owner.master.application_time());
        // SAFETY: memory for the result, or NULL (ecrt.h).
        unsafe { put(master_info, info) }
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(handle, ask) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_scan_progress(handle: *mut ec_master_t, progress: *mut ScanProgress) -> c_int {
    // SAFETY: a handle of the library, memory for the result or NULL (ecrt.h).
    unsafe { call(handle, |master| put(progress, scan_progress(&master.0.master.overview()?))) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_state(handle: *const ec_master_t, state: *mut SegmentState) -> c_int {
    let read = |MasterObject(owner): &MasterObject| {
        let seen = owner.master.segment(None)?;
        // SAFETY: memory for the result, or NULL (ecrt.h).
        unsafe { put(state, seen) }
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(handle, read) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_link_state(
    handle: *const ec_master_t,
    dev_idx: c_uint,
    state: *mut SegmentState,
) -> c_int {
    let read = |MasterObject(owner): &MasterObject| -> Outcome {
        let link = match dev_idx {
            0 => Link::Main,
            1 => Link::Redundant,
            _ => return Err(Code::INVALID),
        };
        let seen = owner.master.segment(Some(link))?;
        // SAFETY: memory for the result, or NULL (ecrt.h).
        unsafe { put(state, seen) }
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(handle, read) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_get_slave(
    handle: *mut ec_master_t,
    slave_position: u16,
    slave_info: *mut SlaveInfo,
) -> c_int {
    // SAFETY: a handle of the library, memory for the result or NULL (ecrt.h).
    unsafe { call(handle, |master| put(slave_info, slave(&*master.0.master.responder()?, slave_position)?)) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_get_sync_manager(
    handle: *mut ec_master_t,
    slave_position: u16,
    sync_index: u8,
    sync: *mut SyncInfo,
) -> c_int {
    // SAFETY: a handle of the library, memory for the result or NULL (ecrt.h).
    unsafe {
        call(handle, |master| put(sync, sync_manager(&*master.0.master.responder()?, slave_position, sync_index)?))
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_get_pdo(
    handle: *mut ec_master_t,
    slave_position: u16,
    sync_index: u8,
    pos: u16,
    result: *mut PdoInfo,
) -> c_int {
    // SAFETY: a handle of the library, memory for the result or NULL (ecrt.h).
    unsafe { call(handle, |master| put(result, pdo(&*master.0.master.responder()?, slave_position, sync_index, pos)?)) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_get_pdo_entry(
    handle: *mut ec_master_t,
    slave_position: u16,
    sync_index: u8,
    pdo_pos: u16,
    entry_pos: u16,
    result: *mut PdoEntryInfo,
) -> c_int {
    let ask = |MasterObject(owner): &MasterObject| {
        let found = entry(&*owner.master.responder()?, slave_position, sync_index, pdo_pos, entry_pos)?;
        // SAFETY: memory for the result, or NULL (ecrt.h).
        unsafe { put(result, found) }
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(handle, ask) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_reset(handle: *mut ec_master_t) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(handle, |master| master.0.master.reset()) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_set_send_interval(handle: *mut ec_master_t, send_interval: usize) -> c_int {
    let set = |MasterObject(owner): &MasterObject| {
        let interval = Duration::from_micros(u64::try_from(send_interval).unwrap_or(u64::MAX));
        owner.master.change(|draft| {
            draft.set_send_interval(interval);
            Ok(())
        })
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(handle, set) }
}
