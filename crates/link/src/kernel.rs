//! Definitions of kernel headers that the `libc` crate lacks, and the plain system calls of the other modules.
//!
//! Constants and layouts are from `linux/if_packet.h` and `linux/ethtool.h`.

use std::ffi::CString;
use std::io;
use std::mem::{size_of, zeroed};
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd, RawFd};

use crate::system_call::system_call;

pub const PACKET_ADD_MEMBERSHIP: libc::c_int = 1;
pub const PACKET_RX_RING: libc::c_int = 5;
pub const PACKET_STATISTICS: libc::c_int = 6;
pub const PACKET_VERSION: libc::c_int = 10;
pub const PACKET_IGNORE_OUTGOING: libc::c_int = 23;
pub const TPACKET_V2: libc::c_int = 1;
pub const PACKET_MR_MULTICAST: libc::c_ushort = 0;
pub const PACKET_MR_PROMISC: libc::c_ushort = 1;
pub const PACKET_OUTGOING: u8 = 4;
/// `asm-generic/socket.h`; Linux 6.5.
pub const SO_PEERPIDFD: libc::c_int = 77;
pub const TP_STATUS_KERNEL: u32 = 0;
pub const TP_STATUS_USER: u32 = 1;
pub const TP_STATUS_VLAN_VALID: u32 = 1 << 4;
pub const TP_STATUS_VLAN_TPID_VALID: u32 = 1 << 6;
const ETHTOOL_GLINK: u32 = 0x0a;

/// Layout of a receive ring.
#[repr(C)]
pub struct RingRequest {
    pub block_size: libc::c_uint,
    pub block_count: libc::c_uint,
    pub frame_size: libc::c_uint,
    pub frame_count: libc::c_uint,
}

/// Header of each frame in the ring (`tpacket2_hdr`).
#[repr(C)]
pub struct FrameHeader {
    pub status: u32,
    pub length: u32,
    pub captured_length: u32,
    pub mac_offset: u16,
    pub network_offset: u16,
    pub seconds: u32,
    pub nanoseconds: u32,
    pub vlan_tci: u16,
    pub vlan_tpid: u16,
    pub padding: [u8; 4],
}

/// Frames that an interface accepts (`packet_mreq`).
#[repr(C)]
pub struct Membership {
    pub interface: libc::c_int,
    pub kind: libc::c_ushort,
    pub address_length: libc::c_ushort,
    pub address: [u8; 8],
}

/// Counters of a packet socket, cleared by reading (`tpacket_stats`).
#[repr(C)]
#[derive(Default)]
pub struct Statistics {
    pub packets: libc::c_uint,
    pub drops: libc::c_uint,
}

/// Error number of the last system call of this thread.
pub fn errno() -> i32 {
    io::Error::last_os_error().raw_os_error().unwrap_or(0)
}

/// A socket that is closed on exec.
pub fn socket(domain: libc::c_int, kind: libc::c_int, protocol: libc::c_int) -> Result<OwnedFd, i32> {
    // SAFETY: no pointers are passed.
    let fd = unsafe { libc::socket(domain, kind | libc::SOCK_CLOEXEC, protocol) };
    if fd < 0 {
        return Err(errno());
    }
    // SAFETY: the descriptor was just made and has no other owner.
    Ok(unsafe { OwnedFd::from_raw_fd(fd) })
}

/// Sets a socket option. `T` has to be the type of the option.
pub fn set_option<T>(fd: RawFd, level: libc::c_int, option: libc::c_int, value: &T) -> Result<(), i32> {
    let pointer = std::ptr::from_ref(value).cast();
    // SAFETY: pointer and length describe a live value that the kernel only reads.
    let result = unsafe { libc::setsockopt(fd, level, option, pointer, size_of::<T>() as libc::socklen_t) };
    if result == 0 { Ok(()) } else { Err(errno()) }
}

/// Reads a socket option into `value`, which keeps its value if the kernel refuses.
pub fn option<T: Copy + Plain>(fd: RawFd, level: libc::c_int, option: libc::c_int, mut value: T) -> T {
    let mut length = size_of::<T>() as libc::socklen_t;
    // SAFETY: pointer and length describe a live value for which any bytes are valid (`Plain`).
    unsafe { libc::getsockopt(fd, level, option, std::ptr::from_mut(&mut value).cast(), &mut length) };
    value
}

/// Index of the interface to which a packet socket is bound; 0 for none.
pub fn bound_interface(fd: RawFd) -> Result<libc::c_int, i32> {
    // SAFETY: all bytes zero is a valid sockaddr_ll.
    let mut address: libc::sockaddr_ll = unsafe { zeroed() };
    let mut length = size_of::<libc::sockaddr_ll>() as libc::socklen_t;
    // SAFETY: pointer and length describe a live address for which any bytes are valid.
    if unsafe { libc::getsockname(fd, std::ptr::from_mut(&mut address).cast(), &mut length) } < 0 {
        return Err(errno());
    }
    Ok(address.sll_ifindex)
}

/// Types for which all bytes are valid.
///
/// # Safety
/// Only for integers and structs of them.
pub unsafe trait Plain {}
// SAFETY: an integer.
unsafe impl Plain for libc::c_int {}
// SAFETY: two integers.
unsafe impl Plain for Statistics {}

impl Clone for Statistics {
    fn clone(&self) -> Self {
        *self
    }
}
impl Copy for Statistics {}

/// The Ethernet address in an answer; `c_char` is signed on x86 and unsigned on ARM.
pub fn hardware_address(address: &libc::sockaddr) -> [u8; 6] {
    std::array::from_fn(|i| address.sa_data[i].to_ne_bytes()[0])
}

/// Reads a property of an interface by name (`SIOCGIF...`); `ENODEV` for an invalid name.
pub fn interface_request(fd: RawFd, name: &str, request: libc::c_ulong) -> Result<libc::ifreq, i32> {
    let mut ifreq = named(name)?;
    // SAFETY: the pointer refers to a live ifreq, which all requests passed here read and fill.
    if unsafe { libc::ioctl(fd, request as _, &mut ifreq) } < 0 { Err(errno()) } else { Ok(ifreq) }
}

/// Switches an interface on or off (`SIOCSIFFLAGS`), as `ip link set NAME up` does; needs CAP_NET_ADMIN.
pub fn switch(fd: RawFd, name: &str, up: bool) -> Result<(), i32> {
    let mut ifreq = interface_request(fd, name, libc::SIOCGIFFLAGS as _)?;
    let bit = libc::IFF_UP as libc::c_short;
    // SAFETY: `SIOCGIFFLAGS` has filled this member.
    let flags = unsafe { ifreq.ifr_ifru.ifru_flags };
    ifreq.ifr_ifru.ifru_flags = if up { flags | bit } else { flags & !bit };
    // SAFETY: the pointer refers to a live ifreq, which the request reads.
    if unsafe { libc::ioctl(fd, libc::SIOCSIFFLAGS as _, &mut ifreq) } < 0 { Err(errno()) } else { Ok(()) }
}

/// Whether the interface has a carrier (`ETHTOOL_GLINK`); an interface that is down has none.
pub fn link_up(fd: RawFd, name: &str) -> Result<bool, i32> {
    ethtool(fd, name, ETHTOOL_GLINK).map(|answer| answer[1] != 0)
}

/// Words of an answer of a driver; more than each structure of a command has that is passed to [`ethtool`].
pub const ETHTOOL_WORDS: usize = 64;

/// What a driver answers to a command that reads (`ETHTOOL_G...`) a structure of a fixed size; the command is its first
/// word.
pub fn ethtool(fd: RawFd, name: &str, command: u32) -> Result<[u32; ETHTOOL_WORDS], i32> {
    let mut words = [0; ETHTOOL_WORDS];
    words[0] = command;
    let mut ifreq = named(name)?;
    ifreq.ifr_ifru.ifru_data = words.as_mut_ptr().cast();
    // SAFETY: the ifreq and the words it points to live across the call; the kernel writes one structure of integers
    // and characters, which is shorter.
    if unsafe { libc::ioctl(fd, libc::SIOCETHTOOL as _, &mut ifreq) } < 0 { Err(errno()) } else { Ok(words) }
}

/// A request for an interface with this name; `ENODEV` if the name is invalid.
pub fn named(name: &str) -> Result<libc::ifreq, i32> {
    // SAFETY: all bytes zero is a valid ifreq.
    let mut ifreq: libc::ifreq = unsafe { zeroed() };
    if name.is_empty() || name.len() >= ifreq.ifr_name.len() || name.contains('\0') {
        return Err(libc::ENODEV);
    }
    for (to, from) in ifreq.ifr_name.iter_mut().zip(name.bytes()) {
        *to = from as libc::c_char;
    }
    Ok(ifreq)
}

/// The index of an interface, if an interface has this name.
pub fn index_of(name: &str) -> Option<u32> {
    let name = CString::new(name).ok()?;
    // SAFETY: the pointer refers to a live null-terminated string.
    let index = unsafe { libc::if_nametoindex(name.as_ptr()) };
    (index != 0).then_some(index)
}

// The calls of a cycle do not use the C library ([`crate::system_call`]), where each is a cancellation point. On 32-bit
// targets the `timespec` of the kernel and of the library may differ, so waits use the library there.

/// Sends a frame.
#[inline(always)]
pub fn send(fd: RawFd, frame: &[u8]) -> Result<(), i32> {
    let (start, length, flags) = (frame.as_ptr(), frame.len(), libc::MSG_DONTWAIT | libc::MSG_NOSIGNAL);
    let arguments = [fd as usize, start as usize, length, flags as usize, 0, 0];
    // SAFETY: pointer and length describe the live frame, which the kernel only reads; no address is passed.
    let sent = unsafe { system_call(libc::SYS_sendto, arguments) };
    if sent < 0 { Err(-sent as i32) } else { Ok(()) }
}

/// Receives a message if there is one; its length, 0 if the other end is closed.
#[inline(always)]
pub fn receive(fd: RawFd, buffer: &mut [u8]) -> Result<usize, i32> {
    let (start, length, flags) = (buffer.as_mut_ptr(), buffer.len(), libc::MSG_DONTWAIT);
    let arguments = [fd as usize, start as usize, length, flags as usize, 0, 0];
    // SAFETY: pointer and length describe the live buffer, in which any bytes are valid; no address is asked for.
    let received = unsafe { system_call(libc::SYS_recvfrom, arguments) };
    usize::try_from(received).map_err(|_| -received as i32)
}

/// Why a wait has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Polled {
    /// `polled` has results.
    Ready,
    /// The time has passed.
    TimedOut,
    /// A signal, or an error.
    Interrupted,
}

/// Waits until one of the descriptors is ready, at most for `timeout`.
#[inline(always)]
pub fn poll(polled: &mut [libc::pollfd], mut timeout: libc::timespec) -> Polled {
    let (places, count) = (polled.as_mut_ptr(), polled.len());
    let timeout = std::ptr::from_mut(&mut timeout);
    #[cfg(target_pointer_width = "64")]
    // SAFETY: the pointer refers to `count` live entries; the kernel may write the remaining time to the live timeout;
    // the signal mask is not changed.
    let ready = unsafe { system_call(libc::SYS_ppoll, [places as usize, count, timeout as usize, 0, 8, 0]) };
    #[cfg(not(target_pointer_width = "64"))]
    // SAFETY: as above.
    let ready = unsafe { libc::ppoll(places, count as libc::nfds_t, timeout, std::ptr::null()) };
    match ready {
        1.. => Polled::Ready,
        0 => Polled::TimedOut,
        _ => Polled::Interrupted,
    }
}

/// Sleeps until a time of the monotonic clock.
#[inline(always)]
pub fn sleep_until(until: &libc::timespec) -> Result<(), i32> {
    let (clock, absolute) = (libc::CLOCK_MONOTONIC, libc::TIMER_ABSTIME);
    let until = std::ptr::from_ref(until);
    #[cfg(target_pointer_width = "64")]
    // SAFETY: the request is a live timespec; a null remainder is allowed and unused with an absolute time.
    let error = unsafe {
        let arguments = [clock as usize, absolute as usize, until as usize, 0, 0, 0];
        -system_call(libc::SYS_clock_nanosleep, arguments) as i32
    };
    #[cfg(not(target_pointer_width = "64"))]
    // SAFETY: as above.
    let error = unsafe { libc::clock_nanosleep(clock, absolute, until, std::ptr::null_mut()) };
    if error == 0 { Ok(()) } else { Err(error) }
}

/// A socket for requests about interfaces; it needs no privileges.
pub fn request_socket() -> Result<OwnedFd, i32> {
    socket(libc::AF_INET, libc::SOCK_DGRAM, 0)
}

/// A counter that makes its descriptor readable (`eventfd`).
pub fn event_counter() -> Result<OwnedFd, i32> {
    // SAFETY: no pointers are passed.
    let fd = unsafe { libc::eventfd(0, libc::EFD_CLOEXEC | libc::EFD_NONBLOCK) };
    if fd < 0 {
        return Err(errno());
    }
    // SAFETY: the descriptor was just made and has no other owner.
    Ok(unsafe { OwnedFd::from_raw_fd(fd) })
}

/// Adds one to such a counter. A full counter is readable already.
pub fn count(fd: RawFd) {
    let one = 1_u64.to_ne_bytes();
    // SAFETY: the pointer refers to eight live bytes that the kernel only reads.
    unsafe { system_call(libc::SYS_write, [fd as usize, one.as_ptr() as usize, one.len(), 0, 0, 0]) };
}

/// Sets such a counter to zero.
pub fn clear_counter(fd: RawFd) {
    let mut count = [0_u8; 8];
    // SAFETY: the pointer refers to eight live bytes for which all values are valid.
    unsafe { system_call(libc::SYS_read, [fd as usize, count.as_mut_ptr() as usize, count.len(), 0, 0, 0]) };
}

/// A set of descriptors that is readable while one of them has an event (`epoll`).
pub fn descriptor_set() -> Result<OwnedFd, i32> {
    // SAFETY: no pointers are passed.
    let fd = unsafe { libc::epoll_create1(libc::EPOLL_CLOEXEC) };
    if fd < 0 {
        return Err(errno());
    }
    // SAFETY: the descriptor was just made and has no other owner.
    Ok(unsafe { OwnedFd::from_raw_fd(fd) })
}

/// Adds a descriptor to such a set. New data is an event; data that stays is none.
pub fn add_descriptor(set: RawFd, fd: RawFd) -> Result<(), i32> {
    let mut event = libc::epoll_event { events: (libc::EPOLLIN | libc::EPOLLET) as u32, u64: 0 };
    // SAFETY: the pointer refers to a live event, which the kernel only reads.
    if unsafe { libc::epoll_ctl(set, libc::EPOLL_CTL_ADD, fd, &mut event) } < 0 { Err(errno()) } else { Ok(()) }
}

/// Takes all events of such a set.
pub fn take_events(set: RawFd) {
    let mut events = [libc::epoll_event { events: 0, u64: 0 }; 16];
    // SAFETY: the pointer refers to this many live events.
    while unsafe { libc::epoll_wait(set, events.as_mut_ptr(), events.len() as libc::c_int, 0) } > 0 {}
}

/// Clears the pending error of a socket.
pub fn clear_error(fd: &impl AsRawFd) {
    option::<libc::c_int>(fd.as_raw_fd(), libc::SOL_SOCKET, libc::SO_ERROR, 0);
}
