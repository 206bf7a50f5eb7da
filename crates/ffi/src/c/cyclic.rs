//! The cycle: receive, process, queue, send, clocks. No allocation, no lock, no waiting.

use std::ffi::{c_int, c_uint};

use ringcat::{DomainStatus, RingState};

use super::handle::{ask, call};
use super::memory::{list, put};
use super::objects::{DomainObject, MasterObject, ec_domain_t, ec_master_t};
use super::waiting;
use crate::active::Active;
use crate::code::{Code, Outcome};
use crate::master::Master;
use crate::settings::Name;
use crate::types::{DomainState, PdoEntryReg};

/// No difference of the clocks is known.
const UNKNOWN: u32 = u32::MAX;

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_receive(master: *mut ec_master_t) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(master, |master| master.0.master.receive()) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_send(master: *mut ec_master_t) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(master, |master| master.0.master.cycle(Active::send)) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_domain_process(domain: *mut ec_domain_t) -> c_int {
    let process = |domain: &DomainObject| {
        let done = domain.owner.master.cycle(|active| {
            let status = active.application.process(domain.id);
            let is_open_ring = domain.owner.master.is_ring() && active.application.ring() == RingState::Open;
            domain.words.post(&status, is_open_ring);
        });
        if done == Err(Code::GONE) {
            domain.words.post(&DomainStatus::default(), false);
        }
        done
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(domain, process) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_domain_queue(domain: *mut ec_domain_t) -> c_int {
    let queue = |domain: &DomainObject| {
        domain.owner.master.cycle(|active| {
            active.application.queue(domain.id);
        })
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(domain, queue) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_domain_state(domain: *const ec_domain_t, state: *mut DomainState) -> c_int {
    // SAFETY: a handle of the library, and memory for the result (ecrt.h).
    unsafe { call(domain, |domain| put(state, domain.words.state())) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_domain_size(domain: *const ec_domain_t) -> usize {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { ask(domain, 0, |domain| domain.words.bytes()) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_domain_data(domain: *const ec_domain_t) -> *mut u8 {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { ask(domain, std::ptr::null_mut(), |domain| domain.words.memory()) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_domain_reg_pdo_entry_list(
    domain: *mut ec_domain_t,
    pdo_entry_regs: *const PdoEntryReg,
) -> c_int {
    let register = |domain: &DomainObject| -> Outcome {
        let mut next = pdo_entry_regs;
        loop {
            // SAFETY: a list of C that ends with index 0 (ecrt.h); `list` refuses NULL.
            let [entry] = unsafe { list(next, 1) }? else { return Err(Code::FAULT) };
            if entry.index == 0 {
                return Ok(());
            }
            // SAFETY: memory for the results, of which that of the bit may be NULL (ecrt.h).
            unsafe { register_one(domain, entry) }?;
            next = next.wrapping_add(1);
        }
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { waiting::call(domain, register) }
}

/// # Safety
/// The pointers of the entry are NULL or can be written.
unsafe fn register_one(domain: &DomainObject, entry: &PdoEntryReg) -> Outcome {
    let PdoEntryReg { alias, position, vendor_id: vendor, product_code: product, index, subindex, .. } = *entry;
    if entry.offset.is_null() {
        return Err(Code::FAULT);
    }
    let slave = domain.owner.declare(Name { alias, position, vendor, product })?;
    let place = domain.owner.master.change(|draft| draft.register(slave, domain.id, (index, subindex)))?;
    // SAFETY: the caller's promise.
    unsafe {
        put_bit(entry.bit_position, place.bit_position())?;
        put(entry.offset, place.byte_offset() as c_uint)
    }
}

/// Gives C the bit of an entry. Without memory for it the entry must begin with a byte.
///
/// # Safety
/// The pointer is NULL or can be written.
pub unsafe fn put_bit(to: *mut c_uint, bit: u8) -> Outcome {
    match (to.is_null(), bit) {
        (true, 0) => Ok(()),
        (true, _) => Err(Code::FAULT),
        // SAFETY: the caller's promise.
        (false, _) => unsafe { put(to, bit.into()) },
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_application_time(master: *mut ec_master_t, app_time: u64) -> c_int {
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(master, |master| master.0.master.set_application_time(app_time)) }
}

/// Uses the clocks of an application.
fn with_clock<R: Default>(master: &Master, work: impl FnOnce(&mut Active) -> R) -> Outcome<R> {
    master.check_reserved()?;
    if master.has_clock() { master.cycle(work) } else { Err(Code::NO_CLOCK) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_sync_reference_clock(master: *mut ec_master_t) -> c_int {
    let sync = |MasterObject(owner): &MasterObject| {
        with_clock(&owner.master, |active| {
            let now = active.application.now();
            active.application.sync_reference(now);
        })
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(master, sync) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_sync_reference_clock_to(master: *mut ec_master_t, sync_time: u64) -> c_int {
    let sync = |MasterObject(owner): &MasterObject| {
        with_clock(&owner.master, |active| active.application.sync_reference_to(sync_time))
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(master, sync) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_sync_slave_clocks(master: *mut ec_master_t) -> c_int {
    let sync = |MasterObject(owner): &MasterObject| with_clock(&owner.master, |active| active.sync_clocks());
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(master, sync) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_reference_clock_time(master: *const ec_master_t, time: *mut u32) -> c_int {
    let read = |MasterObject(owner): &MasterObject| {
        let now = with_clock(&owner.master, |active| active.reference_time())?.ok_or(Code::IO)?;
        // SAFETY: memory for the result, or NULL (ecrt.h).
        unsafe { put(time, now as u32) }
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(master, read) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_sync_monitor_queue(master: *mut ec_master_t) -> c_int {
    let monitor =
        |MasterObject(owner): &MasterObject| with_clock(&owner.master, |active| active.application.monitor_clocks());
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(master, monitor) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_sync_monitor_process(master: *const ec_master_t) -> u32 {
    let read = |MasterObject(owner): &MasterObject| {
        let known = with_clock(&owner.master, |active| active.application.exchange().clock_spread_ns());
        known.ok().flatten().unwrap_or(UNKNOWN)
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { ask(master, UNKNOWN, read) }
}
