//! The host's monotonic clock: reading it and sleeping until an absolute time.
//!
//! Times are nanoseconds of `CLOCK_MONOTONIC`, which has an arbitrary origin, never jumps and stops in suspend.

use crate::kernel;

/// The current time.
#[inline]
pub fn now_ns() -> u64 {
    read(libc::CLOCK_MONOTONIC)
}

/// Processor time of this process so far: all threads, user and system.
pub fn process_cpu_ns() -> u64 {
    read(libc::CLOCK_PROCESS_CPUTIME_ID)
}

/// From the monotonic clock to the Unix clock. It changes only when the Unix clock is set: the rates of both
/// clocks are corrected alike.
pub(crate) fn unix_offset_ns() -> u64 {
    read(libc::CLOCK_REALTIME).wrapping_sub(now_ns())
}

#[inline]
fn read(clock: libc::clockid_t) -> u64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: the pointer refers to a live timespec; the call writes nothing else.
    unsafe { libc::clock_gettime(clock, &mut time) };
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

/// Sleeps until the clock shows `ns`; returns at once if that time has passed. Signals do not end the sleep early.
#[inline(always)]
pub fn sleep_until_ns(ns: u64) {
    let until = timespec(ns);
    while kernel::sleep_until(&until) == Err(libc::EINTR) {}
}

/// A time or duration in the kernel's type. The types of the fields differ between targets.
#[inline]
pub(crate) fn timespec(ns: u64) -> libc::timespec {
    if ns < 1_000_000_000 {
        // Most durations: no division.
        return libc::timespec { tv_sec: 0, tv_nsec: ns as _ };
    }
    libc::timespec { tv_sec: (ns / 1_000_000_000) as _, tv_nsec: (ns % 1_000_000_000) as _ }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: links
    #[test]
    fn a_recent_unix_time_is_converted_to_the_monotonic_clock() {
        let before = now_ns();
        let unix_ns = read(libc::CLOCK_REALTIME);
        let after = now_ns();
        sleep_until_ns(after + 2_000_000);
        let found = unix_ns.wrapping_sub(unix_offset_ns());
        // The two clocks are not read at the same instant.
        assert!((before.saturating_sub(100_000)..=after + 1_000_000).contains(&found), "{before} {found} {after}");
    }

    #[test]
    fn a_sleep_ends_at_its_time_or_later_and_at_once_if_the_time_is_past() {
        let until = now_ns() + 2_000_000;
        sleep_until_ns(until);
        assert!(now_ns() >= until);
        sleep_until_ns(0);
    }
}
