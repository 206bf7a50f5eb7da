//! The host's monotonic clock: reading it and sleeping until an absolute time.
//!
//! Times are nanoseconds of `CLOCK_MONOTONIC`, which has an arbitrary origin, never jumps and stops in suspend.

/// The current time.
pub fn now_ns() -> u64 {
    read(libc::CLOCK_MONOTONIC)
}

/// Time on the monotonic clock for this Unix time, provided it is past and the Unix clock was not set since.
pub fn of_unix_ns(unix_ns: u64) -> u64 {
    let age = read(libc::CLOCK_REALTIME).saturating_sub(unix_ns);
    now_ns().saturating_sub(age)
}

fn read(clock: libc::clockid_t) -> u64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: the pointer refers to a live timespec; the call writes nothing else.
    unsafe { libc::clock_gettime(clock, &mut time) };
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

/// Sleeps until the clock shows `ns`; returns at once if that time has passed. Signals do not end the sleep early.
pub fn sleep_until_ns(ns: u64) {
    let until = timespec(ns);
    // SAFETY: the request is a live timespec; a null remainder is allowed and unused with an absolute time.
    while unsafe { libc::clock_nanosleep(libc::CLOCK_MONOTONIC, libc::TIMER_ABSTIME, &until, std::ptr::null_mut()) }
        == libc::EINTR
    {}
}

/// A time or duration in the kernel's type. The types of the fields differ between targets.
pub(crate) fn timespec(ns: u64) -> libc::timespec {
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
        let found = of_unix_ns(unix_ns);
        // The two clocks are not read at the same instant.
        assert!((before.saturating_sub(100_000)..=after + 1_000_000).contains(&found), "{before} {found} {after}");
        assert!(of_unix_ns(u64::MAX) >= found, "a future time counts as now");
    }

    #[test]
    fn a_sleep_ends_at_its_time_or_later_and_at_once_if_the_time_is_past() {
        let until = now_ns() + 2_000_000;
        sleep_until_ns(until);
        assert!(now_ns() >= until);
        sleep_until_ns(0);
    }
}
