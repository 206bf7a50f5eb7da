//! A heartbeat that one process gives and another one watches, in memory that both have mapped.
//!
//! In: a descriptor of the memory, made by the process that gives the heartbeat. Out: a number that changes with each
//! beat. To give a beat is a write into memory: no system call, no lock, so it is for the cyclic path too. The process
//! that watches can revoke what the other one has; the next beat shows that.

use std::fs::File;
use std::io::{self, ErrorKind};
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, FromRawFd, OwnedFd};
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU32, Ordering};

/// What both processes see. Memory that the kernel gives is zero: no beat yet, not revoked.
#[repr(C)]
#[derive(Debug)]
struct Page {
    beats: AtomicU32,
    revoked: AtomicU32,
}

/// A heartbeat.
#[derive(Debug)]
pub struct Heartbeat {
    memory: OwnedFd,
    page: NonNull<Page>,
}

// SAFETY: the mapping belongs to the process, not to a thread, and all accesses to it are atomic.
unsafe impl Send for Heartbeat {}
// SAFETY: as above.
unsafe impl Sync for Heartbeat {}

impl Heartbeat {
    /// One without a beat. Its memory keeps its length, so what another process does with it never ends this one.
    ///
    /// # Errors
    /// This process has no more descriptors or memory.
    pub fn new() -> io::Result<Heartbeat> {
        // SAFETY: the name is a constant that ends with a zero.
        let fd = unsafe { libc::memfd_create(c"heartbeat".as_ptr(), libc::MFD_CLOEXEC | libc::MFD_ALLOW_SEALING) };
        if fd < 0 {
            return Err(io::Error::last_os_error());
        }
        // SAFETY: the descriptor was just made and has no other owner.
        let memory = File::from(unsafe { OwnedFd::from_raw_fd(fd) });
        memory.set_len(size_of::<Page>() as u64)?;
        // SAFETY: integers only.
        if unsafe { libc::fcntl(memory.as_raw_fd(), libc::F_ADD_SEALS, SEALS) } < 0 {
            return Err(io::Error::last_os_error());
        }
        Heartbeat::adopt(memory.into())
    }

    /// The heartbeat of another process.
    ///
    /// # Errors
    /// This is no memory of a heartbeat, or this process has no more memory.
    pub fn adopt(memory: OwnedFd) -> io::Result<Heartbeat> {
        // SAFETY: integers only; the call fails for what is no such memory.
        let seals = unsafe { libc::fcntl(memory.as_raw_fd(), libc::F_GET_SEALS) };
        let memory = File::from(memory);
        if seals < 0 || seals & SEALS != SEALS || memory.metadata()?.len() < size_of::<Page>() as u64 {
            return Err(io::Error::new(ErrorKind::InvalidData, "no memory of a heartbeat"));
        }
        let access = libc::PROT_READ | libc::PROT_WRITE;
        let (fd, length) = (memory.as_raw_fd(), size_of::<Page>());
        // SAFETY: the kernel chooses the address; no existing mapping is replaced.
        let base = unsafe { libc::mmap(std::ptr::null_mut(), length, access, libc::MAP_SHARED, fd, 0) };
        match NonNull::new(base.cast::<Page>()).filter(|_| base != libc::MAP_FAILED) {
            Some(page) => Ok(Heartbeat { memory: memory.into(), page }),
            None => Err(io::Error::last_os_error()),
        }
    }

    fn page(&self) -> &Page {
        // SAFETY: the mapping lives as long as this and has at least this length, which seals keep; it begins at a
        // page, and any bits are valid.
        unsafe { self.page.as_ref() }
    }

    /// A beat; false if what this process has was revoked.
    #[inline]
    pub fn beat(&self) -> bool {
        let page = self.page();
        // Only one process beats, so nothing is lost between both.
        page.beats.store(page.beats.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
        page.revoked.load(Ordering::Acquire) == 0
    }

    /// A number that each beat changes.
    pub fn beats(&self) -> u32 {
        self.page().beats.load(Ordering::Relaxed)
    }

    /// Revokes what the process has that gives the heartbeat, for good.
    pub fn revoke(&self) {
        self.page().revoked.store(1, Ordering::Release);
    }
}

/// The memory neither shrinks nor grows, and this cannot be undone.
const SEALS: libc::c_int = libc::F_SEAL_SHRINK | libc::F_SEAL_GROW | libc::F_SEAL_SEAL;

impl AsFd for Heartbeat {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.memory.as_fd()
    }
}

impl Drop for Heartbeat {
    fn drop(&mut self) {
        // SAFETY: the mapping was made with this length, and nothing refers to it any more.
        unsafe { libc::munmap(self.page.as_ptr().cast(), size_of::<Page>()) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: links
    #[test]
    fn a_beat_and_a_revocation_are_seen_on_the_other_side() {
        let near = Heartbeat::new().expect("there is memory");
        let far = Heartbeat::adopt(near.as_fd().try_clone_to_owned().expect("a descriptor")).expect("it is one");
        assert_eq!(far.beats(), 0);
        assert!(near.beat() && near.beat());
        assert_eq!(far.beats(), 2);
        far.revoke();
        assert!(!near.beat() && !near.beat());
    }

    // covers: links
    #[test]
    fn other_files_and_memory_that_may_shrink_are_no_heartbeat() {
        let null = File::open("/dev/null").expect("it is there");
        assert!(Heartbeat::adopt(null.into()).is_err());
        // SAFETY: the name is a constant that ends with a zero; the descriptor was just made and has no other owner.
        let unsealed = unsafe { OwnedFd::from_raw_fd(libc::memfd_create(c"other".as_ptr(), libc::MFD_CLOEXEC)) };
        File::from(unsealed.try_clone().expect("a descriptor")).set_len(4096).expect("there is memory");
        assert!(Heartbeat::adopt(unsealed).is_err());
        let own = Heartbeat::new().expect("there is memory");
        let memory = File::from(own.as_fd().try_clone_to_owned().expect("a descriptor"));
        assert!(memory.set_len(0).is_err(), "it keeps its length");
    }
}
