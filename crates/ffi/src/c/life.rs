//! Life of a master: request, open, reserve, activate, deactivate, release.

use std::ffi::{c_int, c_uint};
use std::ptr::null_mut;
use std::sync::{Arc, Mutex};

use super::handle::{alive, bury, call, ending, give};
use super::objects::{DomainObject, MasterObject, Owner, ec_domain_t, ec_master_t, ec_slave_config_t};
use crate::code::{Outcome, report};
use crate::host::at_exit;
use crate::locks::locked;
use crate::master::Master;
use crate::settings::Name;

/// Version of the interface: 1.6.
const VERSION_MAGIC: c_uint = 1 << 8 | 6;

/// Masters that were not released.
static OPENED: Mutex<Vec<usize>> = Mutex::new(Vec::new());

/// At `exit` everything is released, as the kernel does for a program that ends.
extern "C" fn release_all() {
    // In a child made by `fork` another thread may have had the list.
    let opened = OPENED.try_lock().map(|mut opened| std::mem::take(&mut *opened)).unwrap_or_default();
    for address in opened {
        // SAFETY: handles of the library that were not released; those of a parent process are found out.
        unsafe { ecrt_release_master(address as *mut ec_master_t) };
    }
}

#[unsafe(no_mangle)]
extern "C" fn ecrt_version_magic() -> c_uint {
    VERSION_MAGIC
}

#[unsafe(no_mangle)]
extern "C" fn ecrt_open_master(master_index: c_uint) -> *mut ec_master_t {
    match Master::open(master_index) {
        Ok(master) => {
            let master = give(MasterObject(Arc::new(Owner::new(master))));
            at_exit(release_all);
            locked(&OPENED).push(master as usize);
            master
        }
        Err(message) => {
            report(format_args!("Failed to open master {master_index}: {message}"));
            null_mut()
        }
    }
}

#[unsafe(no_mangle)]
extern "C" fn ecrt_request_master(master_index: c_uint) -> *mut ec_master_t {
    let master = ecrt_open_master(master_index);
    // SAFETY: NULL, or the handle that was just made.
    unsafe {
        if !master.is_null() && ecrt_master_reserve(master) != 0 {
            ecrt_release_master(master);
            return null_mut();
        }
    }
    master
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_reserve(master: *mut ec_master_t) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(master, |master| master.0.master.reserve()) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_release_master(master: *mut ec_master_t) {
    // SAFETY: a handle of the library (ecrt.h).
    if let Ok(MasterObject(owner)) = unsafe { alive(master) } {
        let owner = owner.clone();
        locked(&OPENED).retain(|opened| *opened != master as usize);
        // The handle ends first: a second release at the same time does nothing.
        bury(ending(master));
        owner.end_children();
        owner.master.release();
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_activate(master: *mut ec_master_t) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(master, |master| master.0.master.activate()) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_deactivate(master: *mut ec_master_t) -> c_int {
    let deactivate = |MasterObject(owner): &MasterObject| {
        owner.master.deactivate()?;
        owner.end_children();
        Ok(())
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(master, deactivate) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_create_domain(master: *mut ec_master_t) -> *mut ec_domain_t {
    let create = |MasterObject(owner): &MasterObject| -> Outcome<*mut ec_domain_t> {
        let (id, words) = owner.master.change(|draft| Ok(draft.add_domain()))?;
        Ok(owner.give_child(DomainObject { owner: owner.clone(), id, words }))
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { alive(master) }.and_then(create).unwrap_or(null_mut())
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_slave_config(
    master: *mut ec_master_t,
    alias: u16,
    position: u16,
    vendor_id: u32,
    product_code: u32,
) -> *mut ec_slave_config_t {
    let name = Name { alias, position, vendor: vendor_id, product: product_code };
    let declare = |MasterObject(owner): &MasterObject| Ok(owner.slave(owner.declare(name)?));
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { alive(master) }.and_then(declare).unwrap_or(null_mut())
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_select_reference_clock(master: *mut ec_master_t, sc: *mut ec_slave_config_t) -> c_int {
    let select = |MasterObject(owner): &MasterObject| {
        let index = match sc.is_null() {
            true => None,
            // SAFETY: a handle of the library (ecrt.h).
            false => Some(unsafe { alive(sc) }?.index),
        };
        owner.master.select_reference(index)
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(master, select) }
}
