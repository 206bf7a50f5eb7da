//! A thread of another process that hangs while the others go on: a tracer stops it.

use std::path::Path;

/// The thread, until it is dropped.
pub struct StoppedThread(libc::pid_t);

impl StoppedThread {
    /// Stops the thread of this name.
    pub fn stop(process: u32, name: &str) -> StoppedThread {
        let thread = find(process, name).unwrap_or_else(|| panic!("process {process} has no thread \"{name}\""));
        let nothing = std::ptr::null_mut::<libc::c_void>();
        // SAFETY: no memory is passed; the thread belongs to a child of this process.
        let seized = unsafe { libc::ptrace(libc::PTRACE_SEIZE, thread, nothing, nothing) };
        assert_eq!(seized, 0, "{}", std::io::Error::last_os_error());
        // SAFETY: as above.
        let stopped = unsafe { libc::ptrace(libc::PTRACE_INTERRUPT, thread, nothing, nothing) };
        assert_eq!(stopped, 0, "{}", std::io::Error::last_os_error());
        let mut status = 0;
        // SAFETY: the status is ours.
        let waited = unsafe { libc::waitpid(thread, &mut status, libc::__WALL) };
        assert_eq!(waited, thread, "{}", std::io::Error::last_os_error());
        StoppedThread(thread)
    }
}

impl Drop for StoppedThread {
    fn drop(&mut self) {
        let nothing = std::ptr::null_mut::<libc::c_void>();
        // SAFETY: no memory is passed. The process may have ended.
        unsafe { libc::ptrace(libc::PTRACE_DETACH, self.0, nothing, nothing) };
    }
}

fn find(process: u32, name: &str) -> Option<libc::pid_t> {
    let threads = std::fs::read_dir(Path::new("/proc").join(process.to_string()).join("task")).ok()?;
    threads.filter_map(Result::ok).find_map(|thread| {
        let called = std::fs::read_to_string(thread.path().join("comm")).ok()?;
        (called.trim() == name).then(|| thread.file_name().to_str()?.parse().ok())?
    })
}
