//! Networks from a network file or an ENI: the functions of `ringcat.h`.

use std::ffi::{c_char, c_int, c_uint, c_void};
use std::ptr::null_mut;
use std::sync::Arc;

use super::memory::{bytes, put, text};
use super::objects::{MasterObject, Owner, ec_domain_t, ec_master_t, ec_slave_config_t};
use super::waiting::{ask, call};
use crate::code::{Code, Outcome};
use crate::network::{Network, Source};

/// `ringcat_variable_t`.
#[repr(C)]
pub struct RingcatVariable {
    domain: *mut ec_domain_t,
    offset: c_uint,
    bit: c_uint,
    bits: c_uint,
    is_output: c_int,
}

/// Declares the network that `read` returns.
///
/// # Safety
/// A handle of the library.
unsafe fn load(master: *mut ec_master_t, read: impl FnOnce() -> Outcome<Network>) -> c_int {
    let load = |MasterObject(owner): &MasterObject| {
        owner.master.check_reserved()?;
        if owner.master.is_active() {
            return Err(Code::BUSY);
        }
        owner.load(&read()?)
    };
    // SAFETY: the caller's promise.
    unsafe { call(master, load) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ringcat_master_load_network(master: *mut ec_master_t, path: *const c_char) -> c_int {
    // SAFETY: a handle of the library, a text or NULL (ringcat.h).
    unsafe { load(master, || Network::of_file(Source::Path(&text(path)?))) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ringcat_master_load_network_data(
    master: *mut ec_master_t,
    data: *const c_void,
    size: usize,
) -> c_int {
    // SAFETY: a handle of the library, memory of this size or NULL (ringcat.h).
    unsafe { load(master, || Network::of_file(Source::Memory(contents(data, size)?))) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ringcat_master_load_eni(master: *mut ec_master_t, path: *const c_char) -> c_int {
    // SAFETY: a handle of the library, a text or NULL (ringcat.h).
    unsafe { load(master, || Network::of_eni(Source::Path(&text(path)?))) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ringcat_master_load_eni_data(master: *mut ec_master_t, data: *const c_void, size: usize) -> c_int {
    // SAFETY: a handle of the library, memory of this size or NULL (ringcat.h).
    unsafe { load(master, || Network::of_eni(Source::Memory(contents(data, size)?))) }
}

/// A file in memory. NULL is an error, also with a size of 0.
///
/// # Safety
/// Memory of this size, or NULL.
unsafe fn contents<'a>(data: *const c_void, size: usize) -> Outcome<&'a [u8]> {
    if data.is_null() {
        return Err(Code::FAULT);
    }
    // SAFETY: the caller's promise.
    unsafe { bytes(data.cast(), size) }
}

/// A handle by its name in the file; NULL if there is none.
///
/// # Safety
/// A handle of the library, a text or NULL.
unsafe fn named<T>(
    master: *mut ec_master_t,
    name: *const c_char,
    find: impl FnOnce(&Arc<Owner>, &str) -> Outcome<*mut T>,
) -> *mut T {
    let found = |MasterObject(owner): &MasterObject| {
        // SAFETY: the caller's promise.
        let name = unsafe { text(name) }?;
        find(owner, &name)
    };
    // SAFETY: the caller's promise.
    unsafe { ask(master, null_mut(), |master| found(master).unwrap_or(null_mut())) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ringcat_master_subdevice(master: *mut ec_master_t, name: *const c_char) -> *mut ec_slave_config_t {
    // SAFETY: a handle of the library, a text or NULL (ringcat.h).
    unsafe {
        named(master, name, |owner, name| {
            let index = owner.master.look(|draft| draft.names().subdevices.get(name).copied())?;
            Ok(owner.slave(index.ok_or(Code::NOT_FOUND)?))
        })
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ringcat_master_domain(master: *mut ec_master_t, name: *const c_char) -> *mut ec_domain_t {
    // SAFETY: a handle of the library, a text or NULL (ringcat.h).
    unsafe {
        named(master, name, |owner, name| {
            let domain = owner.master.look(|draft| draft.names().domains.get(name).copied())?;
            owner.domain(domain.ok_or(Code::NOT_FOUND)?)
        })
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ringcat_master_variable(
    master: *mut ec_master_t,
    name: *const c_char,
    variable: *mut RingcatVariable,
) -> c_int {
    let find = |MasterObject(owner): &MasterObject| -> Outcome {
        // SAFETY: a text or NULL (ringcat.h).
        let name = unsafe { text(name) }?;
        let place = owner.master.look(|draft| draft.names().variables.get(&name).copied())?.ok_or(Code::NOT_FOUND)?;
        let domain = owner.domain(place.domain)?;
        let (offset, bit) = (place.bit / 8, place.bit % 8);
        let found = RingcatVariable { domain, offset, bit, bits: place.bits, is_output: place.is_output.into() };
        // SAFETY: memory for a variable, or NULL (ringcat.h).
        unsafe { put(variable, found) }
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(master, find) }
}
