//! What makes a thread keep its times: scheduling, affinity, locked memory, awake processors.
//!
//! Everything is about the calling thread or process, and everything may be refused: a [`RealtimeWarning`] then says
//! what would permit it. Nothing here ever has to succeed.

use std::error::Error;
use std::fmt;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::mem::{size_of, zeroed};

use crate::kernel::errno;

/// Something that would have helped and was not permitted or not possible.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RealtimeWarning {
    what: String,
    errno: i32,
    advice: &'static str,
}

impl RealtimeWarning {
    fn new(what: impl Into<String>, errno: i32, advice: &'static str) -> RealtimeWarning {
        RealtimeWarning { what: what.into(), errno, advice }
    }

    /// The kernel's answer; 0 where it was not asked.
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

/// Keeps all memory of this process, present and future, from being swapped out.
pub fn lock_memory() -> Result<(), RealtimeWarning> {
    let failed = |errno| RealtimeWarning::new("memory is not locked", errno, PERMIT_MEMORY);
    // With a limit and without the capability the lock might succeed now and make a later allocation fail.
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

/// Lets the calling thread go before all that are not real-time (`SCHED_FIFO`, 1 to 99). Threads that it starts from
/// now on do not inherit that.
pub fn fifo(priority: i32) -> Result<(), RealtimeWarning> {
    if set_scheduler(libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK, priority) != 0 {
        let what = format!("the thread does not run with real-time priority {priority}");
        return Err(RealtimeWarning::new(what, errno(), PERMIT_FIFO));
    }
    Ok(())
}

/// The bare system call for the calling thread, as not every C library passes it on.
fn set_scheduler(policy: libc::c_int, priority: i32) -> libc::c_long {
    // `sched_param` of the kernel has this one member only.
    // SAFETY: the pointer is to a live parameter, which the kernel only reads; thread 0 is the calling one.
    unsafe { libc::syscall(libc::SYS_sched_setscheduler, 0, policy, std::ptr::from_ref(&priority)) }
}

/// Makes the calling thread an ordinary one on any processor, whatever it has inherited.
pub(crate) fn leave() {
    // Both only take away privileges or restore what the process has anyway: there is nothing to tell.
    set_scheduler(libc::SCHED_OTHER, 0);
    // SAFETY: any bytes are a set, the pointer is to a live one and thread 0 is the calling one.
    unsafe {
        let mut all: libc::cpu_set_t = zeroed();
        std::ptr::write_bytes(&mut all, 0xff, 1);
        libc::sched_setaffinity(0, size_of::<libc::cpu_set_t>(), &all);
    }
}

/// Keeps the calling thread on one processor.
pub fn affinity(cpu: usize) -> Result<(), RealtimeWarning> {
    let advice = "take a processor that exists and that this process may use (see `nproc` and `taskset -p $$`)";
    let failed = |errno| RealtimeWarning::new(format!("the thread is not tied to processor {cpu}"), errno, advice);
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

/// Lets timers of the calling thread end at their time rather than up to 50 us later; real-time threads have that
/// anyway. Needs no permission.
pub fn precise_timers() {
    // SAFETY: no pointers are passed.
    unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1 as libc::c_ulong) };
}

/// Whether the kernel stops real-time threads that never sleep for a part of each second, as a warning for those that
/// spin.
pub fn throttling() -> Option<RealtimeWarning> {
    let read = |name: &str| fs::read_to_string(format!("/proc/sys/kernel/{name}")).ok()?.trim().parse::<i64>().ok();
    let (runtime, period) = (read("sched_rt_runtime_us")?, read("sched_rt_period_us")?);
    (runtime >= 0 && runtime < period).then(|| {
        let what = format!("real-time threads that spin are stopped for {} of each {period} us", period - runtime);
        RealtimeWarning::new(what, 0, "sudo sysctl kernel.sched_rt_runtime_us=-1")
    })
}

/// Keeps all processors from sleeping so deeply that waking up takes longer than asked for, as long as it lives.
#[derive(Debug)]
pub struct CpuLatency {
    _file: File,
}

impl CpuLatency {
    /// Asks for at most `us` microseconds; 0 keeps processors awake.
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
    fn what_is_refused_is_told_with_what_would_permit_it() {
        let text = RealtimeWarning::new("memory is not locked", libc::EPERM, PERMIT_MEMORY).to_string();
        assert!(text.starts_with("memory is not locked: ") && text.contains("cap_ipc_lock"), "{text}");
        let wrong = fifo(1000).expect_err("priorities end at 99");
        assert!(wrong.to_string().contains("priority 1000"), "{wrong}");
        let nowhere = affinity(100_000).expect_err("there are not so many processors");
        assert!(nowhere.to_string().contains("processor 100000"), "{nowhere}");
        assert_eq!(nowhere.errno(), libc::EINVAL);
    }

    #[test]
    fn each_help_is_granted_or_told_and_never_stops_the_program() {
        // In threads of their own, so that the other tests keep their scheduling.
        let told = std::thread::spawn(|| {
            precise_timers();
            [fifo(1).err(), affinity(0).err(), CpuLatency::request(0).err(), throttling()]
        });
        for warning in told.join().expect("no panic").into_iter().flatten() {
            assert!(warning.to_string().contains("; "), "{warning}");
        }
    }

    #[test]
    fn a_thread_that_leaves_real_time_is_ordinary_again() {
        let policy = std::thread::spawn(|| {
            let _ = fifo(1);
            leave();
            // SAFETY: no pointers are passed.
            unsafe { libc::syscall(libc::SYS_sched_getscheduler, 0) as libc::c_int & !libc::SCHED_RESET_ON_FORK }
        });
        assert_eq!(policy.join().expect("no panic"), libc::SCHED_OTHER);
    }
}
