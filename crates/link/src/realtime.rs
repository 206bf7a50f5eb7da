//! Real-time settings of a thread: scheduling, affinity, locked memory, processor latency.
//!
//! All settings are those of the calling thread or process, and all may be refused. A [`RealtimeWarning`] then names
//! the missing permission. The program runs without them.

use std::error::Error;
use std::fmt;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::mem::{size_of, zeroed};

use crate::kernel::errno;

/// A setting that was not permitted or not possible.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct RealtimeWarning {
    what: String,
    errno: i32,
    advice: &'static str,
}

impl RealtimeWarning {
    fn new(what: impl Into<String>, errno: i32, advice: &'static str) -> RealtimeWarning {
        RealtimeWarning { what: what.into(), errno, advice }
    }

    /// The error number of the kernel; 0 if there was no system call.
    pub fn errno(&self) -> i32 {
        self.errno
    }
}

impl fmt::Display for RealtimeWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.what)?;
        if self.errno != 0 {
            write!(f, ": {}", io::Error::from_raw_os_error(self.errno))?;
        }
        write!(f, "; {}", self.advice)
    }
}

impl Error for RealtimeWarning {}

const PERMIT_MEMORY: &str = "permit it with cap_ipc_lock (setcap) or `ulimit -l unlimited`; until then pages may be \
                             swapped out and cycles may come late";
const PERMIT_FIFO: &str = "permit it with cap_sys_nice (setcap) or an rtprio limit; until then other programs may \
                           delay the cycle";
const PERMIT_LATENCY: &str = "permit writing to it (a udev rule, or root); until then a sleeping processor may take \
                              long to wake up";

/// Gives memory that the program has freed back to the system, where the C library keeps it (glibc; elsewhere nothing
/// is done). It waits for locks of the heap, for up to a millisecond: not for the cyclic thread, which may not allocate
/// meanwhile.
pub fn give_back_memory() {
    // SAFETY: no pointers are passed; the heap is locked while it is changed.
    #[cfg(target_env = "gnu")]
    unsafe {
        libc::malloc_trim(0);
    }
}

/// Keeps all memory of this process, present and future, from being swapped out.
pub fn lock_memory() -> Result<(), RealtimeWarning> {
    let failed = |errno| RealtimeWarning::new("memory is not locked", errno, PERMIT_MEMORY);
    // With a limit and without the capability the lock could succeed now and make a later allocation fail.
    if !may_lock_without_limit() {
        return Err(failed(libc::EPERM));
    }
    // SAFETY: no pointers are passed.
    if unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) } != 0 {
        return Err(failed(errno()));
    }
    Ok(())
}

fn may_lock_without_limit() -> bool {
    let mut limit = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
    // SAFETY: the pointer is to a live limit.
    let known = unsafe { libc::getrlimit(libc::RLIMIT_MEMLOCK, &mut limit) } == 0;
    (known && limit.rlim_cur == libc::RLIM_INFINITY) || has_capability(CAP_IPC_LOCK)
}

const CAP_IPC_LOCK: u32 = 14;

fn has_capability(number: u32) -> bool {
    let status = fs::read_to_string("/proc/thread-self/status").unwrap_or_default();
    let effective = status.lines().find_map(|line| line.strip_prefix("CapEff:"));
    effective.and_then(|hex| u64::from_str_radix(hex.trim(), 16).ok()).is_some_and(|set| set >> number & 1 != 0)
}

/// Gives the calling thread real-time priority (`SCHED_FIFO`, 1 to 99). Threads that it starts afterwards do not
/// inherit it.
pub fn fifo(priority: i32) -> Result<(), RealtimeWarning> {
    if set_scheduler(libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK, priority) != 0 {
        let what = format!("the thread does not run with real-time priority {priority}");
        return Err(RealtimeWarning::new(what, errno(), PERMIT_FIFO));
    }
    Ok(())
}

/// The bare system call for the calling thread: not every C library implements it.
fn set_scheduler(policy: libc::c_int, priority: i32) -> libc::c_long {
    // The kernel's `sched_param` has this one member only.
    // SAFETY: the pointer refers to a live parameter, which the kernel only reads; thread 0 is the calling thread.
    unsafe { libc::syscall(libc::SYS_sched_setscheduler, 0, policy, std::ptr::from_ref(&priority)) }
}

/// Gives the calling thread ordinary scheduling on any processor, in place of inherited settings.
pub fn leave() {
    // Both calls only drop privileges or restore the defaults of the process: there is nothing to report.
    set_scheduler(libc::SCHED_OTHER, 0);
    // SAFETY: all bytes are a valid set, the pointer refers to a live set and thread 0 is the calling thread.
    unsafe {
        let mut all: libc::cpu_set_t = zeroed();
        std::ptr::write_bytes(&mut all, 0xff, 1);
        libc::sched_setaffinity(0, size_of::<libc::cpu_set_t>(), &all);
    }
}

/// Pins the calling thread to one processor.
pub fn affinity(cpu: usize) -> Result<(), RealtimeWarning> {
    let advice = "take a processor that exists and that this process may use (see `nproc` and `taskset -p $$`)";
    let failed = |errno| RealtimeWarning::new(format!("the thread is not pinned to processor {cpu}"), errno, advice);
    if cpu >= libc::CPU_SETSIZE as usize {
        return Err(failed(libc::EINVAL));
    }
    // SAFETY: all bytes zero is an empty set, the processor is within it, the pointer is to a live set and thread 0 is
    // the calling one.
    let result = unsafe {
        let mut set: libc::cpu_set_t = zeroed();
        libc::CPU_SET(cpu, &mut set);
        libc::sched_setaffinity(0, size_of::<libc::cpu_set_t>(), &set)
    };
    if result == 0 { Ok(()) } else { Err(failed(errno())) }
}

/// Sets the timer slack of the calling thread to 1 ns instead of 50 us; real-time threads have no slack. Needs no
/// permission.
pub fn precise_timers() {
    // SAFETY: no pointers are passed.
    unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1 as libc::c_ulong) };
}

/// A warning if the kernel throttles real-time threads that never sleep (`sched_rt_runtime_us`). It applies to threads
/// that spin.
pub fn throttling() -> Option<RealtimeWarning> {
    let read = |name: &str| fs::read_to_string(format!("/proc/sys/kernel/{name}")).ok()?.trim().parse::<i64>().ok();
    let (runtime, period) = (read("sched_rt_runtime_us")?, read("sched_rt_period_us")?);
    let stopped = throttled_us(runtime, period)?;
    let what = format!("real-time threads that spin are stopped for {stopped} of each {period} us");
    Some(RealtimeWarning::new(what, 0, "sudo sysctl kernel.sched_rt_runtime_us=-1"))
}

/// For how long of each period real-time threads that spin are stopped, by `sched_rt_runtime_us` and
/// `sched_rt_period_us`; `None` if they never are.
pub fn throttled_us(runtime_us: i64, period_us: i64) -> Option<i64> {
    (runtime_us >= 0 && runtime_us < period_us).then(|| period_us - runtime_us)
}

/// Limits the wake-up latency of all processors during the lifetime of this value.
#[derive(Debug)]
pub struct CpuLatency {
    _file: File,
}

impl CpuLatency {
    /// Requests at most `us` microseconds; 0 keeps processors awake.
    pub fn request(us: u32) -> Result<CpuLatency, RealtimeWarning> {
        const PATH: &str = "/dev/cpu_dma_latency";
        let failed = |error: io::Error| {
            let what = format!("processors may sleep deeply: {PATH}");
            RealtimeWarning::new(what, error.raw_os_error().unwrap_or(0), PERMIT_LATENCY)
        };
        let mut file = OpenOptions::new().write(true).open(PATH).map_err(failed)?;
        let us = i32::try_from(us).unwrap_or(i32::MAX);
        file.write_all(&us.to_ne_bytes()).map_err(failed)?;
        Ok(CpuLatency { _file: file })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refused_setting_names_the_missing_permission() {
        let text = RealtimeWarning::new("memory is not locked", libc::EPERM, PERMIT_MEMORY).to_string();
        assert!(text.starts_with("memory is not locked: ") && text.contains("cap_ipc_lock"), "{text}");
        let wrong = fifo(1000).expect_err("priorities end at 99");
        assert!(wrong.to_string().contains("priority 1000"), "{wrong}");
        let nowhere = affinity(100_000).expect_err("there are not so many processors");
        assert!(nowhere.to_string().contains("processor 100000"), "{nowhere}");
        assert_eq!(nowhere.errno(), libc::EINVAL);
    }

    // covers: bench
    #[test]
    fn throttling_stops_threads_that_spin_for_the_rest_of_a_period() {
        assert_eq!(throttled_us(950_000, 1_000_000), Some(50_000));
        assert_eq!((throttled_us(-1, 1_000_000), throttled_us(1_000_000, 1_000_000)), (None, None));
        assert_eq!(throttled_us(0, i64::MAX), Some(i64::MAX));
    }

    #[test]
    fn each_setting_is_granted_or_refused_with_a_warning() {
        // In separate threads, so that the other tests keep their scheduling.
        let results = std::thread::spawn(|| {
            precise_timers();
            [fifo(1).err(), affinity(0).err(), CpuLatency::request(0).err(), throttling()]
        });
        for warning in results.join().expect("no panic").into_iter().flatten() {
            assert!(warning.to_string().contains("; "), "{warning}");
        }
    }

    #[test]
    fn a_thread_that_leaves_real_time_has_ordinary_scheduling() {
        let policy = std::thread::spawn(|| {
            let _ = fifo(1);
            leave();
            // SAFETY: no pointers are passed.
            unsafe { libc::syscall(libc::SYS_sched_getscheduler, 0) as libc::c_int & !libc::SCHED_RESET_ON_FORK }
        });
        assert_eq!(policy.join().expect("no panic"), libc::SCHED_OTHER);
    }
}
