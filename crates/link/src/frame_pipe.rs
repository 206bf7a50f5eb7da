//! Frames over a pair of Unix sockets: one frame per message (`SOCK_SEQPACKET`), never blocking.
//!
//! Between a process with a simulated segment and the process that drives it: the descriptor of one end can be passed
//! on ([`crate::descriptors`]) and gone on with, as that of a packet socket. No privilege is needed. A frame that finds
//! the socket full is lost, as in a full ring. When the other end is closed, frames are lost and none comes.

use std::cell::Cell;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, FromRawFd, OwnedFd};

use crate::error::LinkError;
use crate::kernel::{self, Polled};
use crate::monotonic::{now_ns, timespec};
use crate::wake_up::WakeUp;

/// Longest frame without FCS, with a VLAN tag.
const LONGEST: usize = 1518;
/// Bytes that may wait in a socket. The kernel takes its own limit if that is lower.
const BUFFER: libc::c_int = 1 << 20;
/// Most pipes in a wait: two classes on two links.
pub const MAX_PIPES: usize = 4;
/// In errors, in place of an interface.
const NAME: &str = "simulated segment";

/// One end of a pipe for frames.
#[derive(Debug)]
pub struct FramePipe {
    fd: OwnedFd,
    buffer: Box<[u8; LONGEST]>,
    /// The other end is closed.
    is_ended: Cell<bool>,
}

impl FramePipe {
    /// Both ends of a new pipe.
    ///
    /// # Errors
    /// The process has no more descriptors.
    pub fn pair() -> Result<(FramePipe, FramePipe), LinkError> {
        let mut ends = [-1; 2];
        // SAFETY: the pointer refers to two live integers.
        let made = unsafe { libc::socketpair(libc::AF_UNIX, KIND | libc::SOCK_CLOEXEC, 0, ends.as_mut_ptr()) };
        if made < 0 {
            return Err(LinkError::from_errno(NAME, "making a pair of sockets", kernel::errno()));
        }
        // SAFETY: both descriptors were just made and have no other owner.
        let [near, far] = ends.map(|fd| FramePipe::new(unsafe { OwnedFd::from_raw_fd(fd) }));
        Ok((near, far))
    }

    /// Goes on with an end that another process had.
    ///
    /// # Errors
    /// The descriptor is no such socket.
    pub fn adopt(fd: OwnedFd) -> Result<FramePipe, LinkError> {
        let option = |option| kernel::option::<libc::c_int>(fd.as_raw_fd(), libc::SOL_SOCKET, option, -1);
        if (option(libc::SO_DOMAIN), option(libc::SO_TYPE)) != (libc::AF_UNIX, KIND) {
            return Err(LinkError::from_errno(NAME, "going on with the socket of another process", libc::ENOTSOCK));
        }
        Ok(FramePipe::new(fd))
    }

    fn new(fd: OwnedFd) -> FramePipe {
        // With less room frames are lost earlier.
        let _ = kernel::set_option(fd.as_raw_fd(), libc::SOL_SOCKET, libc::SO_SNDBUF, &BUFFER);
        FramePipe { fd, buffer: Box::new([0; LONGEST]), is_ended: Cell::new(false) }
    }

    /// Sends a frame; false if it is lost.
    pub fn send(&mut self, frame: &[u8]) -> bool {
        kernel::send(self.fd.as_raw_fd(), frame).is_ok()
    }

    /// Passes the oldest frame to `take`; false if there is none.
    pub fn receive(&mut self, take: &mut dyn FnMut(&[u8])) -> bool {
        if self.is_ended.get() {
            return false;
        }
        match kernel::receive(self.fd.as_raw_fd(), &mut self.buffer[..]) {
            Ok(0) | Err(libc::ECONNRESET) => self.is_ended.set(true),
            Ok(length) => {
                take(&self.buffer[..length]);
                return true;
            }
            Err(_) => {}
        }
        false
    }

    /// Whether a read or a wait has found that the other end is closed. Frames that were sent before come first.
    pub fn is_ended(&self) -> bool {
        self.is_ended.get()
    }

    /// A duplicate of the descriptor, for another process.
    ///
    /// # Errors
    /// The process has no more descriptors.
    pub fn duplicate(&self) -> Result<OwnedFd, LinkError> {
        let failed = |error: std::io::Error| {
            LinkError::from_errno(NAME, "duplicating a socket", error.raw_os_error().unwrap_or_default())
        };
        self.fd.try_clone().map_err(failed)
    }

    /// The descriptor alone.
    pub fn into_descriptor(self) -> OwnedFd {
        self.fd
    }
}

impl AsFd for FramePipe {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.fd.as_fd()
    }
}

const KIND: libc::c_int = libc::SOCK_SEQPACKET;

/// Waits until a frame is in one of the pipes (true), the monotonic time has come, or another thread ends the wait
/// (false). Pipes whose other end is closed end no wait.
///
/// # Panics
/// With more than [`MAX_PIPES`] pipes.
pub fn wait_pipes(pipes: &[&FramePipe], wake_up: Option<&WakeUp>, until_ns: u64) -> bool {
    assert!(pipes.len() <= MAX_PIPES, "at most {MAX_PIPES} pipes are waited for at once");
    loop {
        let mut polled = [libc::pollfd { fd: -1, events: libc::POLLIN, revents: 0 }; MAX_PIPES + 1];
        for (place, pipe) in polled.iter_mut().zip(pipes).filter(|(_, pipe)| !pipe.is_ended()) {
            place.fd = pipe.fd.as_raw_fd();
        }
        polled[MAX_PIPES].fd = wake_up.map_or(-1, WakeUp::fd);
        let now = now_ns();
        if kernel::poll(&mut polled, timespec(until_ns.saturating_sub(now))) != Polled::Ready {
            if now_ns() >= until_ns {
                return false;
            }
            continue;
        }
        for (place, pipe) in polled.iter().zip(pipes) {
            if place.revents & libc::POLLIN == 0 && place.revents & (libc::POLLHUP | libc::POLLERR) != 0 {
                pipe.is_ended.set(true);
            }
        }
        // An end that was closed is readable, too: its reader finds that.
        if polled[..MAX_PIPES].iter().any(|place| place.revents & libc::POLLIN != 0) {
            return true;
        }
        if let Some(wake_up) = wake_up.filter(|_| polled[MAX_PIPES].revents & libc::POLLIN != 0) {
            wake_up.clear();
            return false;
        }
        if now >= until_ns {
            return false;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;

    fn frames(pipe: &mut FramePipe) -> Vec<Vec<u8>> {
        let mut frames = Vec::new();
        while pipe.receive(&mut |frame| frames.push(frame.to_vec())) {}
        frames
    }

    // covers: links
    #[test]
    fn frames_keep_their_bounds_and_a_full_pipe_loses_them_without_waiting() {
        let (mut near, mut far) = FramePipe::pair().expect("there are descriptors");
        assert!(near.send(&[1; 60]) && near.send(&[2; 1514]));
        assert_eq!(frames(&mut far), [vec![1; 60], vec![2; 1514]]);
        assert_eq!(frames(&mut far).len(), 0);
        let sent = (0..100_000).take_while(|_| near.send(&[3; 1514])).count();
        assert!((16..100_000).contains(&sent), "{sent}");
        assert_eq!(frames(&mut far).len(), sent);
        assert!(near.send(&[4; 60]), "there is room again");
    }

    // covers: links
    #[test]
    fn a_closed_end_ends_no_wait_and_is_reported_after_the_last_frame() {
        let (mut near, mut far) = FramePipe::pair().expect("there are descriptors");
        assert!(near.send(&[1; 60]));
        drop(near);
        let begin = now_ns();
        assert!(wait_pipes(&[&far], None, begin + 10_000_000_000), "the last frame");
        assert_eq!(frames(&mut far).len(), 1);
        assert!(far.is_ended() && !far.send(&[1; 60]));
        let until = now_ns() + 3_000_000;
        assert!(!wait_pipes(&[&far], None, until));
        assert!(now_ns() >= until && until < begin + 5_000_000_000);
    }

    // covers: links
    #[test]
    fn a_wake_up_ends_a_wait_for_frames() {
        let (near, far) = FramePipe::pair().expect("there are descriptors");
        let wake_up = WakeUp::new().expect("there are descriptors");
        wake_up.waker().wake();
        let begin = now_ns();
        assert!(!wait_pipes(&[&near, &far], Some(&wake_up), begin + 10_000_000_000));
        assert!(now_ns() < begin + 5_000_000_000 && wake_up.take_call());
    }

    // covers: links
    #[test]
    fn another_process_goes_on_with_a_pipe_and_with_nothing_else() {
        let (near, mut far) = FramePipe::pair().expect("there are descriptors");
        let mut again = FramePipe::adopt(near.duplicate().expect("a descriptor")).expect("it is a pipe");
        drop(near);
        assert!(again.send(&[7; 64]));
        assert_eq!(frames(&mut far), [vec![7; 64]]);
        let (mut stream, _other) = std::os::unix::net::UnixStream::pair().expect("a pair");
        stream.set_nonblocking(true).expect("it is a socket");
        assert!(stream.read(&mut [0]).is_err());
        assert!(FramePipe::adopt(stream.into()).is_err());
        assert!(FramePipe::adopt(std::fs::File::open("/dev/null").expect("it is there").into()).is_err());
    }
}
