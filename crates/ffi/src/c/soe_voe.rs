//! Requests of the cyclic thread: IDNs (SoE) and messages of vendors (VoE).

use std::ffi::c_int;
use std::ptr::null_mut;

use ringcat::{Idn, Services, SoeRequest, VoeHandler};

use super::memory::put;
use super::objects::{SlaveObject, ec_slave_config_t, ec_soe_request_t, ec_voe_handler_t};
use super::requests::{ERROR, create};
use super::waiting::{ask, call};
use crate::bus::Bus;
use crate::code::{Code, Outcome};
use crate::request::Requested;

/// Highest drive behind a SubDevice.
const MAX_DRIVE: u8 = 7;
/// Limit of an answer to a vendor message in milliseconds.
const VOE_LIMIT: u32 = 500;

fn check_drive(drive: u8) -> Outcome {
    if drive > MAX_DRIVE { Err(Code::INVALID) } else { Ok(()) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_create_soe_request(
    sc: *mut ec_slave_config_t,
    drive_no: u8,
    idn: u16,
    size: usize,
) -> *mut ec_soe_request_t {
    let make = |bus: &Bus, slave: &SlaveObject| {
        check_drive(drive_no)?;
        let mut request = bus.supervisor().create_soe_request(slave.id(), size).map_err(|_| Code::GONE)?;
        request.set_idn(drive_no, Idn(idn)).map_err(|_| Code::BUSY)?;
        Ok(Requested::new(request, size))
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { create(sc, size, make) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_soe_request_idn(req: *mut ec_soe_request_t, drive_no: u8, idn: u16) -> c_int {
    let change = |request: &Requested<_>| {
        check_drive(drive_no)?;
        request.change(|request: &mut SoeRequest| request.set_idn(drive_no, Idn(idn)))
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(req, change) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_soe_request_timeout(req: *mut ec_soe_request_t, timeout: u32) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(req, |request| request.set_timeout(timeout)) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_soe_request_data(req: *const ec_soe_request_t) -> *mut u8 {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { ask(req, null_mut(), Requested::memory) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_soe_request_data_size(req: *const ec_soe_request_t) -> usize {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { ask(req, 0, Requested::length) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_soe_request_state(req: *const ec_soe_request_t) -> u32 {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { ask(req, ERROR, Requested::state) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_soe_request_read(req: *mut ec_soe_request_t) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(req, |request| request.read(|request| request.read())) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_soe_request_write(req: *mut ec_soe_request_t) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(req, |request| request.write(request.length(), |request, data| request.write(data))) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_slave_config_create_voe_handler(
    sc: *mut ec_slave_config_t,
    size: usize,
) -> *mut ec_voe_handler_t {
    let make = |bus: &Bus, slave: &SlaveObject| {
        let handler = bus.supervisor().create_voe_handler(slave.id(), size).map_err(|_| Code::GONE)?;
        let handler = Requested::new(handler, size);
        handler.set_timeout(VOE_LIMIT)?;
        Ok(handler)
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { create(sc, size, make) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_voe_handler_send_header(
    voe: *mut ec_voe_handler_t,
    vendor_id: u32,
    vendor_type: u16,
) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(voe, |handler| handler.change(|handler| handler.set_send_header(vendor_id, vendor_type))) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_voe_handler_received_header(
    voe: *const ec_voe_handler_t,
    vendor_id: *mut u32,
    vendor_type: *mut u16,
) -> c_int {
    let read = |handler: &Requested<VoeHandler>| {
        let header = handler.look(VoeHandler::received_header)?.ok_or(Code::NOT_FOUND)?;
        // SAFETY: memory for the results, or NULL (ecrt.h).
        unsafe {
            put(vendor_id, header.vendor_id)?;
            put(vendor_type, header.vendor_type)
        }
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(voe, read) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_voe_handler_data(voe: *const ec_voe_handler_t) -> *mut u8 {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { ask(voe, null_mut(), Requested::memory) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_voe_handler_data_size(voe: *const ec_voe_handler_t) -> usize {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { ask(voe, 0, Requested::length) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_voe_handler_write(voe: *mut ec_voe_handler_t, size: usize) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(voe, |handler| handler.write(size, |handler, data| handler.write(data))) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_voe_handler_read(voe: *mut ec_voe_handler_t) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(voe, |handler| handler.read(|handler| handler.read())) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_voe_handler_read_nosync(voe: *mut ec_voe_handler_t) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(voe, |handler| handler.read(|handler| handler.read_directly())) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_voe_handler_execute(voe: *mut ec_voe_handler_t) -> u32 {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { ask(voe, ERROR, Requested::state) }
}
