//! Life of a master: request, open, reserve, activate, deactivate, release.

use std::ffi::{c_int, c_uint};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::ptr::null_mut;
use std::sync::Arc;

use super::handle::{Ending, alive, alive_or_failed, bury, ending, give};
use super::objects::{DomainObject, MasterObject, Owner, ec_domain_t, ec_master_t, ec_slave_config_t};
use super::opened::{self, Opened};
use super::waiting::{ask, call, caught};
use crate::code::{Code, Outcome, report};
use crate::host::at_exit;
use crate::master::Master;
use crate::settings::Name;

/// Version of the interface: 1.6.
const VERSION_MAGIC: c_uint = 1 << 8 | 6;

/// A master that was not released.
struct OpenedMaster {
    handle: Ending,
    address: usize,
    owner: Arc<Owner>,
}

impl Opened for OpenedMaster {
    fn address(&self) -> usize {
        self.address
    }

    fn has(&self, address: usize) -> bool {
        self.address == address || self.owner.has_child(address)
    }

    fn fail(&self) {
        self.handle.fail();
        self.owner.fail_children();
    }
}

/// At `exit` everything is released, as the kernel does for a program that ends.
extern "C" fn release_all() {
    let release = || {
        for address in opened::addresses() {
            // SAFETY: a handle of the library that was not released.
            unsafe { ecrt_release_master(address as *mut ec_master_t) };
        }
    };
    caught(0, (), release)
}

#[unsafe(no_mangle)]
extern "C" fn ecrt_version_magic() -> c_uint {
    caught(0, 0, || VERSION_MAGIC)
}

#[unsafe(no_mangle)]
extern "C" fn ecrt_open_master(master_index: c_uint) -> *mut ec_master_t {
    caught(0, null_mut(), || open(master_index))
}

fn open(master_index: c_uint) -> *mut ec_master_t {
    match Master::open(master_index) {
        Ok(master) => {
            let owner = Arc::new(Owner::new(master));
            let master = give(MasterObject(owner.clone()));
            at_exit(release_all);
            opened::add(OpenedMaster { handle: ending(master), address: master as usize, owner });
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
    let request = || {
        let master = open(master_index);
        // SAFETY: NULL, or the handle that was just made.
        unsafe {
            if !master.is_null() && ecrt_master_reserve(master) != 0 {
                ecrt_release_master(master);
                return null_mut();
            }
        }
        master
    };
    caught(0, null_mut(), request)
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_reserve(master: *mut ec_master_t) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(master, |master| master.0.master.reserve()) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_release_master(master: *mut ec_master_t) {
    let release = || {
        // SAFETY: a handle of the library (ecrt.h).
        if let Ok((MasterObject(owner), has_failed)) = unsafe { alive_or_failed(master) } {
            let owner = owner.clone();
            let ended = catch_unwind(AssertUnwindSafe(|| {
                opened::remove(master as usize);
                // The handle ends first: a second release at the same time does nothing.
                bury(ending(master));
                owner.end_children();
                if has_failed { Err(Code::IO) } else { owner.master.release() }
            }));
            // A cyclic call may have panicked meanwhile, and the release itself: the master can be opened again.
            if !matches!(ended, Ok(Ok(()))) {
                owner.master.abandon();
            }
            if let Err(panic) = ended {
                resume_unwind(panic);
            }
        }
    };
    caught(master as usize, (), release)
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
    unsafe { ask(master, null_mut(), |master| create(master).unwrap_or(null_mut())) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_slave_config(
    master: *mut ec_master_t,
    alias: u16,
    position: u16,
    vendor_id: u32,
    product_code: u32,
) -> *mut ec_slave_config_t {
    let declare = |MasterObject(owner): &MasterObject| -> Outcome<*mut ec_slave_config_t> {
        let name = Name { alias, position, vendor: vendor_id, product: product_code };
        Ok(owner.slave(owner.declare(name)?))
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { ask(master, null_mut(), |master| declare(master).unwrap_or(null_mut())) }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::active::Active;

    fn simulate(index: c_uint) {
        let segment = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/c/services.toml");
        // SAFETY: the tests of this crate read variables by the standard library alone, which has a lock for them.
        unsafe { std::env::set_var(format!("RINGCAT_SIM_{index}"), segment) };
    }

    /// A requested master with an active application.
    fn active(index: c_uint) -> (*mut ec_master_t, *mut ec_domain_t) {
        let master = ecrt_request_master(index);
        assert!(!master.is_null(), "it can be requested");
        // SAFETY: handles of the library.
        let domain = unsafe { ecrt_master_create_domain(master) };
        // SAFETY: handles of the library.
        assert_eq!(unsafe { ecrt_master_activate(master) }, 0);
        (master, domain)
    }

    fn cycle(domain: *mut ec_domain_t, work: fn(&mut Active)) -> c_int {
        // SAFETY: a handle of the library.
        unsafe { call(domain, |domain| domain.owner.master.cycle(work)) }
    }

    fn owner(master: *mut ec_master_t) -> Arc<Owner> {
        // SAFETY: a handle of the library.
        unsafe { alive_or_failed(master) }.expect("it is not released").0.0.clone()
    }

    /// A panic in the cycle leaves the application half changed: it is dropped at the release, not used.
    // covers: c-interface
    #[test]
    fn a_panic_in_a_cyclic_call_ends_the_use_of_the_application_until_a_release() {
        simulate(71);
        for _ in 0..2 {
            let (master, domain) = active(71);
            assert_eq!(cycle(domain, Active::send), 0);
            assert_eq!(cycle(domain, |_| panic!("half changed")), Code::IO.0);
            assert_eq!(cycle(domain, Active::send), Code::IO.0);
            assert_eq!(owner(master).master.cycle(Active::send), Err(Code::IO));
            // SAFETY: handles of the library.
            unsafe {
                assert_eq!((ecrt_master_activate(master), ecrt_master_deactivate(master)), (Code::IO.0, Code::IO.0));
                ecrt_release_master(master);
                assert_eq!(ecrt_master_activate(master), Code::INVALID.0);
            }
        }
    }

    // covers: c-interface
    #[test]
    fn after_a_panic_within_a_release_the_master_can_be_requested_again() {
        simulate(72);
        for _ in 0..2 {
            let (master, domain) = active(72);
            assert_eq!(cycle(domain, Active::send), 0);
            owner(master).master.panic_at_the_end();
            // SAFETY: handles of the library.
            unsafe {
                ecrt_release_master(master);
                assert_eq!(ecrt_master_activate(master), Code::INVALID.0);
            }
        }
    }

    /// As a cyclic call of another thread does after the release has looked at the handle.
    // covers: c-interface
    #[test]
    fn a_cyclic_call_that_panics_during_a_release_leaves_the_master_usable() {
        simulate(73);
        for _ in 0..2 {
            let (master, domain) = active(73);
            let owner = owner(master);
            let panics = || owner.master.cycle::<()>(|_| panic!("half changed"));
            assert!(catch_unwind(AssertUnwindSafe(panics)).is_err());
            assert_eq!(cycle(domain, Active::send), Code::IO.0);
            // SAFETY: a handle of the library.
            unsafe { ecrt_release_master(master) };
        }
    }

    // covers: c-interface
    #[test]
    fn after_a_failure_no_second_bus_opens_the_links_that_another_handle_has() {
        simulate(74);
        let beside = ecrt_open_master(74);
        let (master, domain) = active(74);
        assert_eq!(cycle(domain, |_| panic!("half changed")), Code::IO.0);
        // SAFETY: handles of the library.
        unsafe {
            ecrt_release_master(master);
            assert!(ecrt_open_master(74).is_null() && ecrt_request_master(74).is_null());
            assert_eq!(ecrt_master_reserve(beside), Code::BUSY.0);
            assert!(owner(beside).master.overview().is_ok(), "it can ask still");
            ecrt_release_master(beside);
            let (master, domain) = active(74);
            assert_eq!(cycle(domain, Active::send), 0);
            ecrt_release_master(master);
        }
    }

    // covers: c-interface
    #[test]
    fn a_failed_handle_that_has_reserved_nothing_leaves_the_bus_to_the_others() {
        simulate(75);
        let (master, domain) = active(75);
        let beside = ecrt_open_master(75);
        // SAFETY: handles of the library.
        unsafe {
            assert_eq!(call(beside, |_| panic!("half changed")), Code::IO.0);
            ecrt_release_master(beside);
            assert_eq!(cycle(domain, Active::send), 0);
            let beside = ecrt_open_master(75);
            assert!(!beside.is_null());
            ecrt_release_master(beside);
            ecrt_release_master(master);
        }
    }
}
