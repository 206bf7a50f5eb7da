//! Ways of a frame between a program and the kernel: the packet socket of this crate, and one without its ring.

use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};

use ringcat_link::monotonic::now_ns;
use ringcat_link::{PacketOptions, PacketSocket, ReceiveMode, wait};

use crate::Failed;

/// Sends frames, and waits for what comes back.
pub trait Path {
    /// Sends a frame.
    fn send(&mut self, frame: &[u8]);

    /// Passes the next frame to `take`; false if none came by this monotonic time.
    fn receive(&mut self, until_ns: u64, take: &mut dyn FnMut(&[u8])) -> bool;
}

/// `AF_PACKET` with a mapped receive ring: what RingCAT uses.
pub struct Ring {
    socket: PacketSocket,
    mode: ReceiveMode,
}

impl Ring {
    /// Opens it on an interface.
    pub fn open(interface: &str, mode: ReceiveMode) -> Result<Ring, Failed> {
        let options = PacketOptions::default().with_receive(mode);
        Ok(Ring { socket: PacketSocket::open(interface, &options)?, mode })
    }
}

impl Path for Ring {
    fn send(&mut self, frame: &[u8]) {
        self.socket.send(frame);
    }

    fn receive(&mut self, until_ns: u64, take: &mut dyn FnMut(&[u8])) -> bool {
        wait(&[&self.socket], until_ns, self.mode) && self.socket.receive(take)
    }
}

/// `AF_PACKET` with `recv`, blocking or not: what most other programs use.
pub struct Recv {
    fd: OwnedFd,
    flags: libc::c_int,
    buffer: [u8; 2048],
}

impl Recv {
    /// Opens it on an interface.
    pub fn open(index: u32, spins: bool) -> Result<Recv, Failed> {
        let protocol = 0x88a4u16.to_be();
        // SAFETY: no pointers are passed.
        let fd = unsafe { libc::socket(libc::AF_PACKET, libc::SOCK_RAW | libc::SOCK_CLOEXEC, i32::from(protocol)) };
        let fd = owned(fd)?;
        // SAFETY: all bytes zero is a valid sockaddr_ll.
        let mut address: libc::sockaddr_ll = unsafe { std::mem::zeroed() };
        address.sll_family = libc::AF_PACKET as libc::c_ushort;
        address.sll_protocol = protocol;
        address.sll_ifindex = index as libc::c_int;
        bind(&fd, &address)?;
        // A frame that does not come back ends the wait.
        set(&fd, libc::SOL_SOCKET, libc::SO_RCVTIMEO, &libc::timeval { tv_sec: 1, tv_usec: 0 })?;
        Ok(Recv { fd, flags: if spins { libc::MSG_DONTWAIT } else { 0 }, buffer: [0; 2048] })
    }
}

impl Path for Recv {
    fn send(&mut self, frame: &[u8]) {
        // SAFETY: pointer and length describe the live frame. A frame that is not sent is counted as lost.
        unsafe { libc::send(self.fd.as_raw_fd(), frame.as_ptr().cast(), frame.len(), libc::MSG_DONTWAIT) };
    }

    fn receive(&mut self, until_ns: u64, take: &mut dyn FnMut(&[u8])) -> bool {
        loop {
            let (start, room) = (self.buffer.as_mut_ptr().cast(), self.buffer.len());
            // SAFETY: pointer and length describe the live buffer.
            let length = unsafe { libc::recv(self.fd.as_raw_fd(), start, room, self.flags) };
            if let Ok(length) = usize::try_from(length) {
                take(&self.buffer[..length]);
                return true;
            }
            if now_ns() >= until_ns {
                return false;
            }
        }
    }
}

/// A descriptor that a system call has just returned.
pub fn owned(fd: libc::c_int) -> Result<OwnedFd, Failed> {
    if fd < 0 {
        return Err(std::io::Error::last_os_error().into());
    }
    // SAFETY: the caller has just got it from the kernel, and keeps no copy.
    Ok(unsafe { OwnedFd::from_raw_fd(fd) })
}

/// Binds a socket to an address of its family.
pub fn bind<T>(fd: &OwnedFd, address: &T) -> Result<(), Failed> {
    let (pointer, length) = (std::ptr::from_ref(address).cast(), size_of::<T>() as libc::socklen_t);
    // SAFETY: pointer and length describe a live value, which the kernel reads.
    checked(unsafe { libc::bind(fd.as_raw_fd(), pointer, length) })
}

/// Sets an option; `T` is its type.
pub fn set<T>(fd: &OwnedFd, level: libc::c_int, option: libc::c_int, value: &T) -> Result<(), Failed> {
    let (pointer, length) = (std::ptr::from_ref(value).cast(), size_of::<T>() as libc::socklen_t);
    // SAFETY: pointer and length describe a live value, which the kernel reads.
    checked(unsafe { libc::setsockopt(fd.as_raw_fd(), level, option, pointer, length) })
}

/// The result of a system call.
pub fn checked(result: libc::c_int) -> Result<(), Failed> {
    if result < 0 { Err(std::io::Error::last_os_error().into()) } else { Ok(()) }
}
