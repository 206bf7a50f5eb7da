//! Capabilities that a process gives up.
//!
//! A thread inherits those of the thread that starts it, so a program gives them up before it has further threads.

use std::io;

/// `_LINUX_CAPABILITY_VERSION_3` of `linux/capability.h`.
const VERSION: u32 = 0x2008_0522;

/// Capabilities of a process that works with network interfaces, as bits of `linux/capability.h`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Capabilities(u64);

impl Capabilities {
    /// None.
    pub const NONE: Capabilities = Capabilities(0);
    /// Raw frames (`CAP_NET_RAW`).
    pub const RAW: Capabilities = Capabilities(1 << 13);
    /// Interfaces up and down, made and configured (`CAP_NET_ADMIN`).
    pub const ADMIN: Capabilities = Capabilities(1 << 12);
}

#[repr(C)]
struct Header {
    version: u32,
    pid: i32,
}

#[repr(C)]
#[derive(Clone, Copy, Default)]
struct Half {
    effective: u32,
    permitted: u32,
    inheritable: u32,
}

/// Whether the calling thread has all of these.
pub fn has(wanted: Capabilities) -> bool {
    read().is_ok_and(|halves| {
        let all = u64::from(halves[0].effective) | u64::from(halves[1].effective) << 32;
        all & wanted.0 == wanted.0
    })
}

fn read() -> io::Result<[Half; 2]> {
    let mut header = Header { version: VERSION, pid: 0 };
    let mut halves = [Half::default(); 2];
    // SAFETY: both pointers describe live values in the layout of version 3: a header, and two halves of 32 bits.
    if unsafe { libc::syscall(libc::SYS_capget, &raw mut header, halves.as_mut_ptr()) } < 0 {
        return Err(io::Error::last_os_error());
    }
    Ok(halves)
}

/// Gives up all capabilities of the calling thread but these, for good: programs that it starts cannot gain any either,
/// also not as root. Those that it does not have are not gained.
///
/// # Errors
/// The system refuses; the thread has all that it had.
pub fn keep(kept: Capabilities) -> io::Result<()> {
    let header = Header { version: VERSION, pid: 0 };
    let mut halves = read()?;
    for (half, bits) in halves.iter_mut().zip([kept.0 as u32, (kept.0 >> 32) as u32]) {
        half.permitted &= bits;
        (half.effective, half.inheritable) = (half.permitted, 0);
    }
    // SAFETY: integers only.
    if unsafe { libc::prctl(libc::PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) } < 0 {
        return Err(io::Error::last_os_error());
    }
    // SAFETY: as for `capget`; the kernel reads both.
    if unsafe { libc::syscall(libc::SYS_capset, &raw const header, halves.as_ptr()) } < 0 {
        return Err(io::Error::last_os_error());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A line of the status of the calling thread.
    fn status(key: &str) -> String {
        let text = std::fs::read_to_string("/proc/thread-self/status").expect("it is there");
        let line = text.lines().find_map(|line| line.strip_prefix(key)).expect("it has the key");
        line.trim_start_matches(':').trim().to_owned()
    }

    // covers: links
    #[test]
    fn a_thread_keeps_what_it_names_and_never_gains_anything() {
        let before = u64::from_str_radix(&status("CapPrm"), 16).expect("a number");
        let body = move || {
            keep(Capabilities::ADMIN).expect("the kernel allows it");
            let kept = u64::from_str_radix(&status("CapPrm"), 16).expect("a number");
            assert_eq!(kept, before & Capabilities::ADMIN.0);
            assert_eq!((has(Capabilities::ADMIN), has(Capabilities::RAW)), (kept != 0, false));
            assert_eq!(status("CapEff"), status("CapPrm"));
            assert_eq!((status("CapInh").trim_matches('0'), status("NoNewPrivs").as_str()), ("", "1"));
            // A program that it starts has no more, also as root.
            let output = std::process::Command::new("cat").arg("/proc/self/status").output().expect("it starts");
            let text = String::from_utf8_lossy(&output.stdout).into_owned();
            let started = text.lines().find_map(|line| line.strip_prefix("CapPrm:")).expect("it has the key");
            assert_eq!(u64::from_str_radix(started.trim(), 16).expect("a number") & !kept, 0);
            keep(Capabilities::NONE).expect("the kernel allows it");
            assert_eq!(status("CapPrm").trim_matches('0'), "");
        };
        std::thread::spawn(body).join().expect("no panic");
        assert_eq!(u64::from_str_radix(&status("CapPrm"), 16), Ok(before), "other threads keep theirs");
    }
}
