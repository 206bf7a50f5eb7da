//! Memory that two processes map, for the image of a domain.
//!
//! In: a length, or the path of memory that another process has made. Out: the mapped bytes. The two processes of a
//! scenario take turns; nothing else orders their accesses.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::fd::{AsRawFd, FromRawFd};
use std::path::Path;

/// Makes memory without a name in the file system. Other processes open it by [`path_of`].
///
/// # Errors
/// Errors of the kernel.
pub fn make(length: usize) -> io::Result<File> {
    // SAFETY: the name is a constant that ends with a zero.
    let fd = unsafe { libc::memfd_create(c"image".as_ptr(), libc::MFD_CLOEXEC) };
    if fd < 0 {
        return Err(io::Error::last_os_error());
    }
    // SAFETY: the kernel has just made the descriptor, and nothing else owns it.
    let file = unsafe { File::from_raw_fd(fd) };
    file.set_len(length as u64)?;
    Ok(file)
}

/// Where another process of this user opens the memory.
pub fn path_of(memory: &File) -> String {
    format!("/proc/{}/fd/{}", std::process::id(), memory.as_raw_fd())
}

/// Opens memory of another process.
///
/// # Errors
/// Errors of the kernel.
pub fn open(path: impl AsRef<Path>) -> io::Result<File> {
    OpenOptions::new().read(true).write(true).open(path)
}

/// Maps all of it until the process ends. A scenario does this once in each process.
///
/// # Errors
/// Errors of the kernel.
pub fn map(memory: &File) -> io::Result<&'static mut [u8]> {
    let length = usize::try_from(memory.metadata()?.len()).map_err(io::Error::other)?;
    let access = libc::PROT_READ | libc::PROT_WRITE;
    // SAFETY: the kernel chooses the address; no existing mapping is replaced.
    let base = unsafe { libc::mmap(std::ptr::null_mut(), length, access, libc::MAP_SHARED, memory.as_raw_fd(), 0) };
    if base == libc::MAP_FAILED {
        return Err(io::Error::last_os_error());
    }
    // SAFETY: the mapping has this length and is never unmapped; nothing else in this process uses the memory.
    Ok(unsafe { std::slice::from_raw_parts_mut(base.cast::<u8>(), length) })
}
