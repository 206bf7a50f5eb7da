//! Configuration of a SubDevice, before activation, and its state and emergencies at any time.

use std::ffi::{c_char, c_int, c_uint};
use std::sync::Arc;
use std::time::Duration;

use libc::in_addr;
use ringcat::{DomainId, Entry, EntryPlace, IpSettings, PdoEntry, SdoDownload, SubDeviceInfo};

use super::cyclic::put_bit;
use super::handle::alive;
use super::memory::{bytes, list, text};
use super::objects::{SlaveObject, ec_domain_t, ec_slave_config_t};
use super::waiting::{call, call_for};
use crate::code::{Code, Outcome};
use crate::draft::Draft;
use crate::settings::{Settings, address};
use crate::types::SyncInfo;

/// Index that ends a list of SyncManagers.
const END: u8 = 0xFF;
/// Longest host name of EoE.
const MAX_NAME: usize = 32;

/// Changes the settings of a SubDevice.
fn change(slave: &SlaveObject, change: impl FnOnce(&mut Settings, Option<&SubDeviceInfo>) -> Outcome) -> Outcome {
    slave.owner.master.change(|draft| {
        let (settings, info) = draft.settings(slave.index)?;
        change(settings, info.as_ref())
    })
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_sync_manager(
    sc: *mut ec_slave_config_t,
    sync_index: u8,
    direction: c_int,
    watchdog_mode: c_int,
) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe {
        call(sc, |slave| change(slave, |settings, _| settings.set_sync_manager(sync_index, direction, watchdog_mode)))
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_watchdog(
    sc: *mut ec_slave_config_t,
    watchdog_divider: u16,
    watchdog_intervals: u16,
) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe {
        call(sc, |slave| {
            change(slave, |settings, _| {
                settings.set_watchdog(watchdog_divider, watchdog_intervals);
                Ok(())
            })
        })
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_pdo_assign_add(sc: *mut ec_slave_config_t, sync_index: u8, index: u16) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(sc, |slave| change(slave, |settings, info| settings.assign(sync_index, index, info))) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_pdo_assign_clear(sc: *mut ec_slave_config_t, sync_index: u8) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(sc, |slave| change(slave, |settings, _| settings.clear_assignment(sync_index))) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_pdo_mapping_add(
    sc: *mut ec_slave_config_t,
    pdo_index: u16,
    entry_index: u16,
    entry_subindex: u8,
    entry_bit_length: u8,
) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe {
        call(sc, |slave| {
            change(slave, |settings, info| {
                settings.map(pdo_index, PdoEntry::new(entry_index, entry_subindex, entry_bit_length), info)
            })
        })
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_pdo_mapping_clear(sc: *mut ec_slave_config_t, pdo_index: u16) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(sc, |slave| change(slave, |settings, info| settings.clear_mapping(pdo_index, info))) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_pdos(
    sc: *mut ec_slave_config_t,
    n_syncs: c_uint,
    syncs: *const SyncInfo,
) -> c_int {
    let configure = |slave: &SlaveObject| -> Outcome {
        slave.owner.master.change(|_| Ok(()))?;
        // No list is an empty one.
        let n_syncs = if syncs.is_null() { 0 } else { n_syncs };
        let mut next = syncs;
        for _ in 0..n_syncs {
            // SAFETY: a list of C that is this long, or ends with index 0xff (ecrt.h).
            let [sync] = (unsafe { list(next, 1) })? else { return Err(Code::FAULT) };
            if sync.index == END {
                break;
            }
            // SAFETY: lists of C of the lengths beside them (ecrt.h).
            change(slave, |settings, info| unsafe { configure_sync_manager(settings, info, sync) })?;
            next = next.wrapping_add(1);
        }
        Ok(())
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(sc, configure) }
}

/// # Safety
/// The lists have the lengths that are given beside them, or are NULL.
unsafe fn configure_sync_manager(settings: &mut Settings, info: Option<&SubDeviceInfo>, sync: &SyncInfo) -> Outcome {
    settings.set_sync_manager(sync.index, sync.dir, sync.watchdog_mode)?;
    // SAFETY: the caller's promise.
    let pdos = unsafe { list(sync.pdos, sync.n_pdos as usize) }?;
    if !pdos.is_empty() {
        settings.clear_assignment(sync.index)?;
    }
    for pdo in pdos {
        settings.assign(sync.index, pdo.index, info)?;
        // SAFETY: the caller's promise.
        let entries = unsafe { list(pdo.entries, pdo.n_entries as usize) }?;
        if !entries.is_empty() {
            settings.clear_mapping(pdo.index, info)?;
        }
        for entry in entries {
            settings.map(pdo.index, PdoEntry::new(entry.index, entry.subindex, entry.bit_length), info)?;
        }
    }
    Ok(())
}

/// Places an entry in a domain of the same master; the byte, and the bit for C.
///
/// # Safety
/// Handles of the library, memory for the bit or NULL.
unsafe fn register(
    sc: *mut ec_slave_config_t,
    domain: *mut ec_domain_t,
    bit_position: *mut c_uint,
    place: impl FnOnce(&mut Draft, usize, DomainId) -> Outcome<Entry>,
) -> c_int {
    let registered = |slave: &SlaveObject| -> Outcome<c_int> {
        // SAFETY: the caller's promise.
        let domain = unsafe { alive(domain) }?;
        if !Arc::ptr_eq(&slave.owner, &domain.owner) {
            return Err(Code::INVALID);
        }
        let entry = slave.owner.master.change(|draft| place(draft, slave.index, domain.id))?;
        // SAFETY: the caller's promise.
        unsafe { put_bit(bit_position, entry.bit_position()) }?;
        c_int::try_from(entry.byte_offset()).map_err(|_| Code::OVERFLOW)
    };
    // SAFETY: the caller's promise.
    unsafe { call_for(sc, registered) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_reg_pdo_entry(
    sc: *mut ec_slave_config_t,
    entry_index: u16,
    entry_subindex: u8,
    domain: *mut ec_domain_t,
    bit_position: *mut c_uint,
) -> c_int {
    let place = |draft: &mut Draft, slave, domain| draft.register(slave, domain, (entry_index, entry_subindex));
    // SAFETY: handles of the library, memory for the bit or NULL (ecrt.h).
    unsafe { register(sc, domain, bit_position, place) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_reg_pdo_entry_pos(
    sc: *mut ec_slave_config_t,
    sync_index: u8,
    pdo_pos: c_uint,
    entry_pos: c_uint,
    domain: *mut ec_domain_t,
    bit_position: *mut c_uint,
) -> c_int {
    let place = |draft: &mut Draft, slave, domain| {
        draft.register_at(slave, domain, EntryPlace::new(sync_index, pdo_pos as usize, entry_pos as usize))
    };
    // SAFETY: handles of the library, memory for the bit or NULL (ecrt.h).
    unsafe { register(sc, domain, bit_position, place) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_dc(
    sc: *mut ec_slave_config_t,
    assign_activate: u16,
    sync0_cycle: u32,
    sync0_shift: i32,
    sync1_cycle: u32,
    _sync1_shift: i32,
) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe {
        call(sc, |slave| {
            change(slave, |settings, _| {
                settings.set_sync(assign_activate, (sync0_cycle, sync0_shift), sync1_cycle);
                Ok(())
            })
        })
    }
}

/// Adds an SDO download.
///
/// # Safety
/// A handle of the library; `size` bytes can be read at `data`, or it is NULL.
unsafe fn add_sdo(
    sc: *mut ec_slave_config_t,
    sdo: impl FnOnce() -> SdoDownload,
    data: *const u8,
    size: usize,
) -> c_int {
    // SAFETY: the caller's promise.
    unsafe {
        call(sc, |slave| {
            let data = bytes(data, size)?.to_vec();
            change(slave, |settings, _| settings.add_sdo(with_data(sdo(), data)))
        })
    }
}

fn with_data(mut sdo: SdoDownload, data: Vec<u8>) -> SdoDownload {
    sdo.data = data;
    sdo
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_sdo(
    sc: *mut ec_slave_config_t,
    index: u16,
    subindex: u8,
    data: *const u8,
    size: usize,
) -> c_int {
    // SAFETY: a handle of the library, data of this size (ecrt.h).
    unsafe { add_sdo(sc, || SdoDownload::new(index, subindex, []), data, size) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_complete_sdo(
    sc: *mut ec_slave_config_t,
    index: u16,
    data: *const u8,
    size: usize,
) -> c_int {
    // SAFETY: a handle of the library, data of this size (ecrt.h).
    unsafe { add_sdo(sc, || SdoDownload::new(index, 0, []).with_complete_access(true), data, size) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_sdo8(
    sc: *mut ec_slave_config_t,
    sdo_index: u16,
    sdo_subindex: u8,
    value: u8,
) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe {
        call(sc, |slave| {
            change(slave, |settings, _| {
                settings.add_sdo(SdoDownload::new(sdo_index, sdo_subindex, value.to_le_bytes()))
            })
        })
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_sdo16(
    sc: *mut ec_slave_config_t,
    sdo_index: u16,
    sdo_subindex: u8,
    value: u16,
) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe {
        call(sc, |slave| {
            change(slave, |settings, _| {
                settings.add_sdo(SdoDownload::new(sdo_index, sdo_subindex, value.to_le_bytes()))
            })
        })
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_sdo32(
    sc: *mut ec_slave_config_t,
    sdo_index: u16,
    sdo_subindex: u8,
    value: u32,
) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe {
        call(sc, |slave| {
            change(slave, |settings, _| {
                settings.add_sdo(SdoDownload::new(sdo_index, sdo_subindex, value.to_le_bytes()))
            })
        })
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_idn(
    sc: *mut ec_slave_config_t,
    drive_no: u8,
    idn: u16,
    state: c_int,
    data: *const u8,
    size: usize,
) -> c_int {
    // SAFETY: a handle of the library, data of this size (ecrt.h).
    unsafe {
        call(sc, |slave| {
            let data = bytes(data, size)?.to_vec();
            change(slave, |settings, _| settings.add_idn(drive_no, idn, state, data))
        })
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_flag(sc: *mut ec_slave_config_t, key: *const c_char, value: i32) -> c_int {
    // SAFETY: a handle of the library, a text of C (ecrt.h).
    unsafe {
        call(sc, |slave| {
            let key = text(key)?;
            change(slave, |settings, _| settings.set_flag(&key, value))
        })
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_state_timeout(
    sc: *mut ec_slave_config_t,
    from_state: c_int,
    to_state: c_int,
    timeout_ms: c_uint,
) -> c_int {
    let set = |slave: &SlaveObject| {
        let limit = Duration::from_millis(timeout_ms.into());
        change(slave, |settings, _| settings.set_state_timeout(from_state, to_state, limit))
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(sc, set) }
}

/// Changes the IP parameters of a SubDevice.
fn change_ip(slave: &SlaveObject, new: impl FnOnce(IpSettings) -> IpSettings) -> Outcome {
    change(slave, |settings, _| {
        settings.change_ip(new);
        Ok(())
    })
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_eoe_mac_address(sc: *mut ec_slave_config_t, mac: *const u8) -> c_int {
    // SAFETY: a handle of the library, six bytes (ecrt.h).
    unsafe {
        call(sc, |slave| {
            let mac: [u8; 6] = bytes(mac, 6)?.try_into().map_err(|_| Code::FAULT)?;
            change_ip(slave, |ip| ip.with_mac(mac))
        })
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_eoe_ip_address(sc: *mut ec_slave_config_t, value: in_addr) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(sc, |slave| change_ip(slave, |ip| ip.with_address(address(value.s_addr)))) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_eoe_subnet_mask(sc: *mut ec_slave_config_t, value: in_addr) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(sc, |slave| change_ip(slave, |ip| ip.with_mask(address(value.s_addr)))) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_eoe_default_gateway(sc: *mut ec_slave_config_t, value: in_addr) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(sc, |slave| change_ip(slave, |ip| ip.with_gateway(address(value.s_addr)))) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_eoe_dns_address(sc: *mut ec_slave_config_t, value: in_addr) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(sc, |slave| change_ip(slave, |ip| ip.with_dns(address(value.s_addr)))) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_eoe_hostname(sc: *mut ec_slave_config_t, name: *const c_char) -> c_int {
    // SAFETY: a handle of the library, a text of C (ecrt.h).
    unsafe {
        call(sc, |slave| {
            let name = text(name)?.into_bytes();
            if name.len() > MAX_NAME {
                return Err(Code::INVALID);
            }
            change_ip(slave, |ip| ip.with_name(name))
        })
    }
}
