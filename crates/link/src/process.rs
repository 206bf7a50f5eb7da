//! Other processes: the peer of a Unix socket with its rights, and the end of a process.
//!
//! The rights of a peer are those at the time of its connection. Not for the cyclic path.

use std::io;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, FromRawFd, OwnedFd};
use std::os::unix::net::UnixStream;
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
    /// The system does not tell it.
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
        let told = unsafe { libc::getsockopt(fd, libc::SOL_SOCKET, libc::SO_PEERGROUPS, pointer, &mut length) };
        groups.truncate(if told < 0 { 0 } else { length as usize / size_of::<u32>() });
        groups.insert(0, own.gid);
        Ok(Peer { pid: u32::try_from(own.pid).unwrap_or(0), uid: own.uid, groups })
    }
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
}
