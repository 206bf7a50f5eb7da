//! Other processes: the peer of a Unix socket with its rights, and the end of a process.
//!
//! The rights of a peer are those at the time of its connection. Not for the cyclic path.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, FromRawFd, OwnedFd};
use std::os::unix::fs::OpenOptionsExt;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

use crate::kernel;
use crate::monotonic::timespec;

/// Most groups of a process that are read; of a process with more, only its effective group is known.
const MOST_GROUPS: usize = 1024;
/// Most descriptors in a wait.
const MOST_WAITED: usize = 8;

/// The process at the other end of a Unix socket, as it was when it connected.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Peer {
    /// Its process id; 0 if it has none in the name space of this process.
    pub pid: u32,
    /// Its effective user.
    pub uid: u32,
    /// Its effective group, then its other groups, at most 1,024.
    pub groups: Vec<u32>,
}

impl Peer {
    /// The peer of a connection.
    ///
    /// # Errors
    /// The system does not report it.
    pub fn of(stream: &UnixStream) -> io::Result<Peer> {
        let fd = stream.as_raw_fd();
        let mut own = libc::ucred { pid: 0, uid: u32::MAX, gid: u32::MAX };
        let mut length = size_of::<libc::ucred>() as libc::socklen_t;
        let pointer = std::ptr::from_mut(&mut own).cast();
        // SAFETY: pointer and length describe a live value of integers.
        if unsafe { libc::getsockopt(fd, libc::SOL_SOCKET, libc::SO_PEERCRED, pointer, &mut length) } < 0 {
            return Err(io::Error::last_os_error());
        }
        let mut groups = vec![0_u32; MOST_GROUPS];
        let mut length = size_of_val(groups.as_slice()) as libc::socklen_t;
        let pointer = groups.as_mut_ptr().cast();
        // SAFETY: pointer and length describe live integers.
        let result = unsafe { libc::getsockopt(fd, libc::SOL_SOCKET, libc::SO_PEERGROUPS, pointer, &mut length) };
        groups.truncate(if result < 0 { 0 } else { length as usize / size_of::<u32>() });
        groups.insert(0, own.gid);
        Ok(Peer { pid: u32::try_from(own.pid).unwrap_or(0), uid: own.uid, groups })
    }
}

/// Opens a file to read it, and does not wait: not for the writer of a pipe either.
///
/// # Errors
/// It cannot be opened.
pub fn open_at_once(path: &Path) -> io::Result<File> {
    OpenOptions::new().read(true).custom_flags(libc::O_NONBLOCK).open(path)
}

/// The effective user of this process.
pub fn effective_user() -> u32 {
    // SAFETY: no pointers are passed; it cannot fail.
    unsafe { libc::geteuid() }
}

/// A descriptor that becomes readable when the process ends (`pidfd`).
///
/// # Errors
/// There is no such process, or the kernel is older than 5.3.
pub fn watch(pid: u32) -> io::Result<OwnedFd> {
    // SAFETY: no pointers are passed.
    let fd = unsafe { libc::syscall(libc::SYS_pidfd_open, pid as libc::pid_t, 0) };
    if fd < 0 {
        return Err(io::Error::last_os_error());
    }
    // SAFETY: the descriptor was just made and has no other owner.
    Ok(unsafe { OwnedFd::from_raw_fd(fd as i32) })
}

/// A descriptor that becomes readable when the process at the other end of a connection ends: the process that has
/// connected, also if its number belongs to another one meanwhile. `None` where the kernel has none for it: the process
/// is in another name space, or the kernel is older than 5.3.
///
/// # Errors
/// The process has ended (`ESRCH`), or this process has no more descriptors.
pub fn watch_peer(stream: &UnixStream, peer: &Peer) -> io::Result<Option<OwnedFd>> {
    let mut fd: libc::c_int = -1;
    let mut length = size_of::<libc::c_int>() as libc::socklen_t;
    let pointer = std::ptr::from_mut(&mut fd).cast();
    // SAFETY: pointer and length describe a live integer.
    let result =
        unsafe { libc::getsockopt(stream.as_raw_fd(), libc::SOL_SOCKET, kernel::SO_PEERPIDFD, pointer, &mut length) };
    if result == 0 && fd >= 0 {
        // SAFETY: the descriptor was just made and has no other owner.
        return Ok(Some(unsafe { OwnedFd::from_raw_fd(fd) }));
    }
    let error = io::Error::last_os_error();
    match error.raw_os_error() {
        Some(libc::ESRCH | libc::EMFILE | libc::ENFILE) => Err(error),
        // Before Linux 6.5.
        _ if peer.pid == 0 => Ok(None),
        _ => match watch(peer.pid) {
            Err(error) if error.raw_os_error() == Some(libc::ENOSYS) => Ok(None),
            watched => watched.map(Some),
        },
    }
}

/// Raises the limit of descriptors of this process as far as it may, at most to this number. Returns the limit.
pub fn raise_descriptors(wanted: u64) -> u64 {
    // Of 64 bits on each processor.
    let mut limit = libc::rlimit64 { rlim_cur: 0, rlim_max: 0 };
    // SAFETY: the pointer is to a live value.
    if unsafe { libc::getrlimit64(libc::RLIMIT_NOFILE, &mut limit) } < 0 {
        return 0;
    }
    let before = limit.rlim_cur;
    limit.rlim_cur = before.max(wanted.min(limit.rlim_max));
    // SAFETY: the pointer is to a live value.
    let raised = unsafe { libc::setrlimit64(libc::RLIMIT_NOFILE, &limit) } == 0;
    if raised { limit.rlim_cur } else { before }
}

/// Waits until one of the descriptors is readable or closed at its other end, at most for this time. Which are, by bits
/// in their order.
///
/// # Panics
/// With more than 8 descriptors.
pub fn wait_readable(descriptors: &[BorrowedFd<'_>], limit: Duration) -> u8 {
    assert!(descriptors.len() <= MOST_WAITED, "at most {MOST_WAITED} descriptors are waited for at once");
    let mut polled = [libc::pollfd { fd: -1, events: libc::POLLIN, revents: 0 }; MOST_WAITED];
    for (place, descriptor) in polled.iter_mut().zip(descriptors) {
        place.fd = descriptor.as_fd().as_raw_fd();
    }
    let limit_ns = u64::try_from(limit.as_nanos()).unwrap_or(u64::MAX);
    kernel::poll(&mut polled, timespec(limit_ns));
    let ready = |(bit, place): (usize, &libc::pollfd)| u8::from(place.revents != 0) << bit;
    polled.iter().enumerate().map(ready).sum()
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::process::Command;

    use super::*;

    // covers: links
    #[test]
    fn a_peer_is_known_with_its_user_and_groups() {
        let (near, _far) = UnixStream::pair().expect("a pair");
        let peer = Peer::of(&near).expect("it is a Unix socket");
        assert_eq!((peer.pid, peer.uid), (std::process::id(), effective_user()));
        assert!(!peer.groups.is_empty());
    }

    // covers: links
    #[test]
    fn the_end_of_a_process_and_new_bytes_end_a_wait() {
        let mut child = Command::new("sleep").arg("60").spawn().expect("sleep is there");
        let end = watch(child.id()).expect("the process is there");
        let (mut near, far) = UnixStream::pair().expect("a pair");
        let both = [far.as_fd(), end.as_fd()];
        assert_eq!(wait_readable(&both, Duration::from_millis(1)), 0);
        near.write_all(b"x").expect("there is room");
        assert_eq!(wait_readable(&both, Duration::from_secs(10)), 1);
        child.kill().expect("it runs");
        assert_eq!(wait_readable(&both[1..], Duration::from_secs(10)), 1);
        child.wait().expect("it has ended");
        assert!(watch(child.id()).is_err());
    }

    // covers: links
    #[test]
    fn the_end_of_the_process_that_has_connected_is_seen() {
        let (near, _far) = UnixStream::pair().expect("a pair");
        let peer = Peer::of(&near).expect("it is a Unix socket");
        let end = watch_peer(&near, &peer).expect("it lives").expect("the kernel has it");
        assert_eq!(wait_readable(&[end.as_fd()], Duration::from_millis(1)), 0);
        let path = std::env::temp_dir().join(format!("ringcat-link-peer-{}", std::process::id()));
        let listener = std::os::unix::net::UnixListener::bind(&path).expect("it is free");
        // The shell's child keeps the connection after the shell has ended.
        let script = format!(
            "import os, socket, time; s = socket.socket(socket.AF_UNIX); s.connect({path:?}); \
                              os.fork() or time.sleep(2)"
        );
        let Ok(mut child) = Command::new("python3").args(["-c", &script]).spawn() else {
            println!("skipped: python3 is not there");
            return;
        };
        let (near, _) = listener.accept().expect("it connects");
        let peer = Peer::of(&near).expect("it is a Unix socket");
        assert_eq!(peer.pid, child.id());
        child.wait().expect("it ends");
        std::fs::remove_file(path).expect("it is there");
        match watch_peer(&near, &peer) {
            // Since Linux 6.16 there is a descriptor for it, too, and it is readable.
            Ok(end) => assert_eq!(wait_readable(&[end.expect("pid").as_fd()], Duration::from_secs(1)), 1),
            Err(error) => assert_eq!(error.raw_os_error(), Some(libc::ESRCH)),
        }
        assert_eq!(wait_readable(&[near.as_fd()], Duration::from_millis(1)), 0, "the connection is open");
    }

    // covers: links
    #[test]
    fn the_limit_of_descriptors_only_rises() {
        let now = raise_descriptors(0);
        assert!(now > 0);
        assert!(raise_descriptors(now + 1) >= now);
    }
}
