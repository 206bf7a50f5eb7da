//! A bare forwarder, as a short program in C would be: two packet sockets without rings, `poll`, `recv`, `send`.

use std::ffi::CString;
use std::io::{Error, ErrorKind};
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};
use std::sync::atomic::{AtomicBool, Ordering};

use ringcat::packet::ReceiveMode;

/// EtherType of EtherCAT.
const ETHERTYPE: u16 = 0x88A4;
/// A wait ends after this time, to check whether the run is over.
const LOOK_MS: libc::c_int = 5;
/// Longest frame, without FCS.
const LONGEST: usize = 1_514;

/// Forwards between both interfaces until it is to end.
pub fn forward(mode: ReceiveMode, is_over: &AtomicBool) -> Result<(), String> {
    let open = |interface| open(interface).map_err(|error| format!("{interface}: {error}"));
    let sockets = [open("first1")?, open("second1")?];
    let mut buffer = [0; LONGEST];
    while !is_over.load(Ordering::Relaxed) {
        if mode == ReceiveMode::Blocking {
            wait(&sockets);
        }
        for (from, to) in [(0, 1), (1, 0)] {
            pass(&sockets[from], &sockets[to], &mut buffer).map_err(|error| error.to_string())?;
        }
    }
    Ok(())
}

fn open(interface: &str) -> Result<OwnedFd, Error> {
    let protocol = libc::c_int::from(ETHERTYPE.to_be());
    // SAFETY: integers only.
    let fd = unsafe { libc::socket(libc::AF_PACKET, libc::SOCK_RAW | libc::SOCK_CLOEXEC, protocol) };
    if fd < 0 {
        return Err(Error::last_os_error());
    }
    // SAFETY: the descriptor was just made and has no other owner.
    let socket = unsafe { OwnedFd::from_raw_fd(fd) };
    let name = CString::new(interface).map_err(Error::other)?;
    // SAFETY: the name ends with a zero.
    let index = unsafe { libc::if_nametoindex(name.as_ptr()) };
    // SAFETY: all bytes zero is a valid address.
    let mut address: libc::sockaddr_ll = unsafe { std::mem::zeroed() };
    address.sll_family = libc::AF_PACKET as libc::c_ushort;
    address.sll_protocol = ETHERTYPE.to_be();
    address.sll_ifindex = index as libc::c_int;
    let length = size_of::<libc::sockaddr_ll>() as libc::socklen_t;
    // SAFETY: pointer and length describe a live address.
    if index == 0 || unsafe { libc::bind(fd, (&raw const address).cast(), length) } < 0 {
        return Err(Error::last_os_error());
    }
    let on: libc::c_int = 1;
    let length = size_of::<libc::c_int>() as libc::socklen_t;
    // Without what this host sends itself, as the sockets of RingCAT.
    // SAFETY: pointer and length describe a live integer.
    let set = unsafe { libc::setsockopt(fd, libc::SOL_PACKET, PACKET_IGNORE_OUTGOING, (&raw const on).cast(), length) };
    if set < 0 { Err(Error::last_os_error()) } else { Ok(socket) }
}

/// Of `linux/if_packet.h`.
const PACKET_IGNORE_OUTGOING: libc::c_int = 23;

/// Waits for a frame on either.
fn wait(sockets: &[OwnedFd; 2]) {
    let mut polled =
        sockets.each_ref().map(|socket| libc::pollfd { fd: socket.as_raw_fd(), events: libc::POLLIN, revents: 0 });
    // SAFETY: pointer and number describe live values.
    unsafe { libc::poll(polled.as_mut_ptr(), polled.len() as libc::nfds_t, LOOK_MS) };
}

/// Passes one frame, if there is one.
fn pass(from: &OwnedFd, to: &OwnedFd, buffer: &mut [u8]) -> Result<(), Error> {
    // SAFETY: pointer and length describe a live buffer.
    let taken = unsafe { libc::recv(from.as_raw_fd(), buffer.as_mut_ptr().cast(), buffer.len(), libc::MSG_DONTWAIT) };
    let Ok(length) = usize::try_from(taken) else {
        let error = Error::last_os_error();
        return if error.kind() == ErrorKind::WouldBlock { Ok(()) } else { Err(error) };
    };
    // SAFETY: pointer and length describe the part of the buffer that was filled.
    if unsafe { libc::send(to.as_raw_fd(), buffer.as_ptr().cast(), length, 0) } < 0 {
        return Err(Error::last_os_error());
    }
    Ok(())
}
