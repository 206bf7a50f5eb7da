//! Lost frames that are sent again within their cycle: functions of `ringcat.h`.

use std::ffi::c_int;
use std::time::Duration;

use super::handle::call;
use super::memory::put;
use super::objects::{DomainObject, MasterObject, ec_domain_t, ec_master_t};
use crate::active::Active;

#[unsafe(no_mangle)]
unsafe extern "C" fn ringcat_domain_send_again(domain: *mut ec_domain_t, on: c_int) -> c_int {
    let set = |domain: &DomainObject| domain.owner.master.change(|draft| draft.set_sends_again(domain.id, on != 0));
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(domain, set) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ringcat_master_receive_again_at(master: *mut ec_master_t, time_ns: *mut u64) -> c_int {
    let read = |MasterObject(owner): &MasterObject| {
        let rest = owner.master.cycle(|active: &mut Active| active.receive_again_in())?;
        let at = rest.map_or(u64::MAX, |rest| nanoseconds(monotonic_time().saturating_add(rest)));
        // SAFETY: memory for the result, or NULL (ringcat.h).
        unsafe { put(time_ns, at) }
    };
    // SAFETY: a handle of the library (ringcat.h).
    unsafe { call(master, read) }
}

fn nanoseconds(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}

/// CLOCK_MONOTONIC.
fn monotonic_time() -> Duration {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: memory of this type. It cannot fail: Linux has this clock.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &mut time) };
    Duration::new(time.tv_sec.try_into().unwrap_or(0), time.tv_nsec.try_into().unwrap_or(0))
}
