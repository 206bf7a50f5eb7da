//! The host: threads of the library, children of the process, and whether it runs with the rights of another user.

use std::mem::MaybeUninit;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

static GENERATION: AtomicU64 = AtomicU64::new(0);

/// How many times the process is the child of another one that had opened a master. What was opened in an earlier
/// generation belongs to the parent.
#[inline(always)]
pub fn generation() -> u64 {
    GENERATION.load(Ordering::Relaxed)
}

extern "C" fn begin_generation() {
    GENERATION.fetch_add(1, Ordering::Relaxed);
}

/// From now on a child made by `fork` is a new generation.
pub fn watch_forks() {
    static IS_WATCHED: AtomicBool = AtomicBool::new(false);
    once(&IS_WATCHED, || {
        // SAFETY: the handler is a function of this library, which stays loaded (`-z nodelete`), and touches an atomic
        // only.
        unsafe { libc::pthread_atfork(None, None, Some(begin_generation)) };
    });
}

/// Registers something once, or twice where two threads do so at the same time. A `Once` that another thread has at a
/// `fork` would never end in the child.
fn once(is_done: &AtomicBool, register: impl FnOnce()) {
    if !is_done.load(Ordering::Acquire) {
        register();
        is_done.store(true, Ordering::Release);
    }
}

/// Signals of the calling thread are blocked until this is dropped. Threads that it starts inherit that.
pub struct HeldSignals(libc::sigset_t);

impl HeldSignals {
    /// Blocks all signals of the calling thread.
    pub fn hold() -> HeldSignals {
        let (mut all, mut before) = (MaybeUninit::uninit(), MaybeUninit::zeroed());
        // SAFETY: both sets are memory of this function; `sigfillset` initialises the first before it is read, and
        // zeros are an empty set, should the mask not be reported.
        unsafe {
            libc::sigfillset(all.as_mut_ptr());
            libc::pthread_sigmask(libc::SIG_SETMASK, all.as_ptr(), before.as_mut_ptr());
            HeldSignals(before.assume_init())
        }
    }
}

impl Drop for HeldSignals {
    fn drop(&mut self) {
        // SAFETY: the set was filled in by `hold`; no old mask is asked for.
        unsafe { libc::pthread_sigmask(libc::SIG_SETMASK, &raw const self.0, std::ptr::null_mut()) };
    }
}

/// The process calls this function when it ends by `exit` or by a return of `main`: at least once. Only the first
/// function counts.
pub fn at_exit(end: extern "C" fn()) {
    static IS_REGISTERED: AtomicBool = AtomicBool::new(false);
    once(&IS_REGISTERED, || {
        // SAFETY: a function of this library, which stays loaded.
        unsafe { libc::atexit(end) };
    });
}

/// What a program with locked memory has to do if there was not enough; empty without a limit.
pub fn memory_hint() -> String {
    let mut limit = MaybeUninit::<libc::rlimit>::zeroed();
    // SAFETY: memory of this function, in which zeros are a valid value.
    let limit = unsafe {
        libc::getrlimit(libc::RLIMIT_MEMLOCK, limit.as_mut_ptr());
        limit.assume_init()
    };
    if limit.rlim_cur == libc::RLIM_INFINITY {
        return String::new();
    }
    let kib = limit.rlim_cur / 1024;
    format!("; where memory is locked (mlockall), expected a limit of 16384 KiB at least, got {kib} (ulimit -l)")
}

/// Memory of the library with its threads and a simulated segment, in bytes.
const ROOM: usize = 5 << 20;

/// Checks that there is memory for the library where a program locks what it will have (`MCL_FUTURE`): otherwise the
/// first allocation that fails would end the program.
///
/// # Errors
/// There is not; the text names the limit to set.
pub fn check_memory() -> Result<(), String> {
    let flags = libc::MAP_PRIVATE | libc::MAP_ANONYMOUS | libc::MAP_NORESERVE;
    // SAFETY: a new mapping that nothing can access, and that only the next call has the address of. With locked memory
    // the kernel counts it against the limit.
    unsafe {
        let place = libc::mmap(std::ptr::null_mut(), ROOM, libc::PROT_NONE, flags, -1, 0);
        if place == libc::MAP_FAILED {
            return Err(format!("there is not enough memory for the library{}", memory_hint()));
        }
        libc::munmap(place, ROOM);
    }
    Ok(())
}

/// A variable of the environment. In a process with more rights than its user (set-uid) none is given.
pub fn variable(name: &str) -> Option<String> {
    // SAFETY: reads a word of the process; no pointer is involved.
    let is_secure = unsafe { libc::getauxval(libc::AT_SECURE) } != 0;
    if is_secure { None } else { std::env::var(name).ok() }
}
