//! Requests of the cyclic thread: objects and registers.

use std::ffi::c_int;
use std::ptr::null_mut;

use ringcat::{RegisterAddress, RegisterRequest, Services};

use super::handle::{Handle, Kind};
use super::objects::{SlaveObject, ec_reg_request_t, ec_sdo_request_t, ec_slave_config_t};
use super::waiting::{ask, call};
use crate::bus::Bus;
use crate::code::{Code, Outcome};
use crate::request::Requested;

/// `EC_REQUEST_ERROR`, also of a handle that is not alive.
pub const ERROR: u32 = 3;
/// Largest memory of a request.
const MAX_BYTES: usize = 1 << 24;

/// Creates a request of a SubDevice; NULL if the handle is not alive, the application is active, or it is too large.
///
/// # Safety
/// A handle of the library.
pub unsafe fn create<T>(
    sc: *mut ec_slave_config_t,
    size: usize,
    make: impl FnOnce(&Bus, &SlaveObject) -> Outcome<Requested<T>>,
) -> *mut Handle<Requested<T>>
where
    Requested<T>: Kind,
{
    let create = |slave: &SlaveObject| {
        slave.owner.master.change(|_| Ok(()))?;
        if size > MAX_BYTES {
            return Err(Code::NO_SPACE);
        }
        let bus = slave.owner.master.bus()?;
        Ok(slave.owner.give_child(make(&bus, slave)?))
    };
    // SAFETY: the caller's promise.
    unsafe { ask(sc, null_mut(), |slave| create(slave).unwrap_or(null_mut())) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_create_sdo_request(
    sc: *mut ec_slave_config_t,
    index: u16,
    subindex: u8,
    size: usize,
) -> *mut ec_sdo_request_t {
    let make = |bus: &Bus, slave: &SlaveObject| {
        let mut request = bus.supervisor().create_sdo_request(slave.id(), size).map_err(|_| Code::GONE)?;
        request.set_object(index, subindex, false).map_err(|_| Code::BUSY)?;
        Ok(Requested::new(request, size))
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { create(sc, size, make) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_sdo_request_index(req: *mut ec_sdo_request_t, index: u16, subindex: u8) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(req, |request| request.change(|request| request.set_object(index, subindex, false))) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_sdo_request_timeout(req: *mut ec_sdo_request_t, timeout: u32) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(req, |request| request.set_timeout(timeout)) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_sdo_request_data(req: *const ec_sdo_request_t) -> *mut u8 {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { ask(req, null_mut(), Requested::memory) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_sdo_request_data_size(req: *const ec_sdo_request_t) -> usize {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { ask(req, 0, Requested::length) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_sdo_request_state(req: *const ec_sdo_request_t) -> u32 {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { ask(req, ERROR, Requested::state) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_sdo_request_read(req: *mut ec_sdo_request_t) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(req, |request| request.read(|request| request.read())) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_sdo_request_write(req: *mut ec_sdo_request_t) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(req, |request| request.write(request.length(), |request, data| request.write(data))) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_create_reg_request(
    sc: *mut ec_slave_config_t,
    size: usize,
) -> *mut ec_reg_request_t {
    let make = |bus: &Bus, slave: &SlaveObject| {
        let request = bus.supervisor().create_register_request(slave.id(), size).map_err(|_| Code::GONE)?;
        Ok(Requested::new(request, size))
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { create(sc, size, make) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_reg_request_data(req: *const ec_reg_request_t) -> *mut u8 {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { ask(req, null_mut(), Requested::memory) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_reg_request_state(req: *const ec_reg_request_t) -> u32 {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { ask(req, ERROR, Requested::state) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_reg_request_write(req: *mut ec_reg_request_t, address: u16, size: usize) -> c_int {
    let write = |request: &Requested<RegisterRequest>| {
        request.write(size, |request, data| request.write(RegisterAddress(address), data))
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(req, write) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_reg_request_read(req: *mut ec_reg_request_t, address: u16, size: usize) -> c_int {
    let read = |request: &Requested<_>| match size {
        0 => Err(Code::INVALID),
        _ if size > request.capacity() => Err(Code::NO_SPACE),
        _ => request.read(|request: &mut RegisterRequest| request.read(RegisterAddress(address), size)),
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(req, read) }
}
