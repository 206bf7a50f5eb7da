//! State and emergencies of a SubDevice.

use std::ffi::{c_int, c_uint};

use ringcat::{Position, SubDeviceStatus};

use super::handle::{call, call_for};
use super::memory::put;
use super::objects::{SlaveObject, ec_slave_config_t};
use super::waiting::{self, uncancelled};
use crate::code::{Code, Outcome};
use crate::types::SlaveConfigState;

/// Bytes of an emergency.
const EMERGENCY_BYTES: usize = 8;

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_state(sc: *const ec_slave_config_t, state: *mut SlaveConfigState) -> c_int {
    // SAFETY: a handle of the library, memory for the result or NULL (ecrt.h).
    unsafe { call(sc, |slave| put(state, state_of(slave)?)) }
}

/// State of a SubDevice: words of the application, or before it is active an AL state that is read now.
fn state_of(slave: &SlaveObject) -> Outcome<SlaveConfigState> {
    let master = &slave.owner.master;
    let pack = |online: bool, operational: bool, al_state: u8| {
        SlaveConfigState(c_uint::from(online) | c_uint::from(operational) << 1 | c_uint::from(al_state & 0x0F) << 2)
    };
    if master.is_active() {
        let status = master
            .live(Some(SubDeviceStatus::default()), |live| live.status.subdevice(slave.id()))?
            .ok_or(Code::NOT_FOUND)?;
        return Ok(pack(status.online, status.operational, status.al_state.map_or(0, |state| state.code())));
    }
    let position = master.look(|draft| draft.info(slave.index).map(|info| info.position))?;
    let Some(Position(position)) = position else { return Ok(pack(false, false, 0)) };
    let read = uncancelled(|| Ok(master.bus()?.supervisor().subdevice(Position(position)).state()))?;
    let al_state = read.ok().and_then(|it| it.status.al_state());
    Ok(pack(al_state.is_some(), false, al_state.map_or(0, |state| state.code())))
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_emerg_size(sc: *mut ec_slave_config_t, elements: usize) -> c_int {
    let create = |slave: &SlaveObject| {
        slave.owner.master.change(|_| Ok(()))?;
        let bus = slave.owner.master.bus()?;
        let ring = bus.supervisor().subdevice(slave.id()).create_emergency_ring(elements).map_err(|_| Code::GONE)?;
        slave.emergencies.use_now(|own| *own = Some(ring))
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { waiting::call(sc, create) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_emerg_pop(sc: *mut ec_slave_config_t, target: *mut u8) -> c_int {
    let pop = |slave: &SlaveObject| {
        if target.is_null() {
            return Err(Code::FAULT);
        }
        let received = slave.emergencies(|ring| ring.pop())?.ok_or(Code::NOT_FOUND)?;
        // SAFETY: eight bytes of C (ecrt.h).
        unsafe { put(target.cast::<[u8; EMERGENCY_BYTES]>(), received.emergency.encode()) }
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(sc, pop) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_emerg_clear(sc: *mut ec_slave_config_t) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(sc, |slave| slave.emergencies(|ring| ring.clear())) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_emerg_overruns(sc: *const ec_slave_config_t) -> c_int {
    let count = |slave: &SlaveObject| {
        let overruns = slave.emergencies(|ring| ring.overruns())?;
        Ok(c_int::try_from(overruns).unwrap_or(c_int::MAX))
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call_for(sc, count) }
}
