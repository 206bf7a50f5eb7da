//! Sending and receiving frames on a network interface: `AF_PACKET` with a memory-mapped receive ring.
//!
//! Input: the name of an interface and [`PacketOptions`]. Sending takes one system call per frame, receiving from the
//! ring none. One socket serves one thread; a MainDevice opens two per interface, one for each class of frames
//! ([`ClassFilter`]). The socket receives only EtherType 0x88A4 and no frames sent by this host.

pub mod binding;
pub mod handed;
pub mod prepared;

use std::cell::Cell;
use std::mem::{size_of, zeroed};
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd, RawFd};

use crate::error::LinkError;
use crate::filter::ClassFilter;
use crate::interface;
use crate::kernel::{self, Membership, Statistics};
use crate::monotonic;
use crate::receive_mode::ReceiveMode;
use crate::rx_ring::{RxRing, Seen, Taken};

/// The group address to which EtherCAT frames may be sent instead of broadcast.
pub const GROUP_ADDRESS: [u8; 6] = [0x01, 0x01, 0x05, 0x01, 0x00, 0x00];

/// Frames after which the offset of the Unix clock is read again.
const OFFSET_FRAMES: u64 = 1024;

/// How a socket is opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PacketOptions {
    /// Frames that the socket receives.
    pub filter: ClassFilter,
    /// How the owner waits; see [`PacketSocket::mode`].
    pub receive: ReceiveMode,
    /// Slots of the receive ring: at least 2, at most 16,384, with 2 KiB each. Frames that arrive while the ring is
    /// full are lost.
    pub ring_frames: u32,
    /// Whether the interface accepts all frames. If not, it accepts broadcast, its own address and [`GROUP_ADDRESS`].
    pub promiscuous: bool,
    /// Whether frames keep their VLAN tag. If false, the tag is missing: the kernel removes it before it looks for
    /// sockets of one EtherType. If true, the socket sees all frames before that step, and each EtherCAT frame counts
    /// as dropped in the statistics of the interface.
    pub keep_vlan_tags: bool,
}

impl PacketOptions {
    /// Sets [`PacketOptions::filter`].
    #[must_use]
    pub const fn with_filter(mut self, filter: ClassFilter) -> PacketOptions {
        self.filter = filter;
        self
    }

    /// Sets [`PacketOptions::receive`].
    #[must_use]
    pub const fn with_receive(mut self, receive: ReceiveMode) -> PacketOptions {
        self.receive = receive;
        self
    }

    /// Sets [`PacketOptions::ring_frames`].
    #[must_use]
    pub const fn with_ring_frames(mut self, ring_frames: u32) -> PacketOptions {
        self.ring_frames = ring_frames;
        self
    }

    /// Sets [`PacketOptions::promiscuous`].
    #[must_use]
    pub const fn with_promiscuous(mut self, promiscuous: bool) -> PacketOptions {
        self.promiscuous = promiscuous;
        self
    }

    /// Sets [`PacketOptions::keep_vlan_tags`].
    #[must_use]
    pub const fn with_keep_vlan_tags(mut self, keep_vlan_tags: bool) -> PacketOptions {
        self.keep_vlan_tags = keep_vlan_tags;
        self
    }
}

impl Default for PacketOptions {
    /// All EtherCAT frames, blocking receive, 256 slots, promiscuous, without VLAN tags.
    fn default() -> Self {
        PacketOptions {
            filter: ClassFilter::All,
            receive: ReceiveMode::default(),
            ring_frames: 256,
            promiscuous: true,
            keep_vlan_tags: false,
        }
    }
}

/// Counters of a socket.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct LinkCounters {
    /// Frames that the kernel accepted for sending.
    pub sent: u64,
    /// Frames returned by [`PacketSocket::receive`].
    pub received: u64,
    /// Frames not sent because the interface was down or gone.
    pub down: u64,
    /// Frames not sent because the kernel's queue was full.
    pub busy: u64,
    /// Frames not sent for another reason, such as a length beyond the MTU.
    pub refused: u64,
    /// Frames received and lost because the ring was full.
    pub overrun: u64,
    /// Frames received that are longer than a slot of the ring.
    pub truncated: u64,
}

/// Frames that a socket receives in addition to incoming EtherCAT frames.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Passing {
    /// Frames that this host sends.
    pub outgoing: bool,
    /// Frames of all EtherTypes.
    pub all: bool,
}

/// A packet socket with its ring.
#[derive(Debug)]
pub struct PacketSocket {
    // Declared before the descriptor, so that it is unmapped first.
    ring: RxRing,
    fd: OwnedFd,
    interface: String,
    mac: [u8; 6],
    mode: ReceiveMode,
    counters: LinkCounters,
    overrun: Cell<u64>,
    /// From the monotonic clock to the Unix clock, in which the kernel stamps frames.
    unix_offset_ns: u64,
    /// The place in the ring is in doubt until the first frame.
    is_searching: bool,
}

impl PacketSocket {
    /// Address of the interface.
    pub fn mac(&self) -> [u8; 6] {
        self.mac
    }

    /// Name of the interface.
    pub fn interface(&self) -> &str {
        &self.interface
    }

    /// How the owner waits, to be passed to [`crate::wait`].
    pub fn mode(&self) -> ReceiveMode {
        self.mode
    }

    /// Sends a frame, without FCS: one system call. False if the interface is down or gone or the queue is full. The
    /// next call tries again, so an interface that comes back is used at once.
    #[inline(always)]
    pub fn send(&mut self, frame: &[u8]) -> bool {
        let result = kernel::send(self.fd(), frame);
        if result.is_ok() {
            self.counters.sent += 1;
        }
        result.is_ok() || self.send_again(frame, result)
    }

    #[cold]
    fn send_again(&mut self, frame: &[u8], mut result: Result<(), i32>) -> bool {
        if result == Err(libc::ENETDOWN) {
            // The error may be pending since the interface went down, although the interface is up again.
            kernel::clear_error(&self.fd);
            result = kernel::send(self.fd(), frame);
        }
        match result {
            Ok(()) => self.counters.sent += 1,
            Err(libc::ENETDOWN | libc::ENXIO | libc::ENODEV) => self.counters.down += 1,
            Err(libc::ENOBUFS | libc::EAGAIN | libc::ENOMEM) => self.counters.busy += 1,
            Err(_) => self.counters.refused += 1,
        }
        result.is_ok()
    }

    /// Passes the oldest received frame to `take`; false if there is none. No system call.
    #[inline(always)]
    pub fn receive(&mut self, take: &mut dyn FnMut(&[u8])) -> bool {
        loop {
            match self.ring.take(take) {
                Taken::Frame => {
                    self.counters.received += 1;
                    return true;
                }
                Taken::Nothing => return false,
                Taken::Truncated => self.counters.truncated += 1,
                Taken::Outgoing => {}
            }
        }
    }

    /// Time at which the kernel received the last returned frame, on the monotonic clock: between these two times. A
    /// stamp outside shows that the Unix clock was set; its offset is read again then. A shorter step is noticed after
    /// 1,024 frames. No system call.
    #[inline(always)]
    pub fn received_at_ns(&mut self, after_ns: u64, before_ns: u64) -> u64 {
        let stamp = self.ring.stamp_unix_ns();
        let at = stamp.wrapping_sub(self.unix_offset_ns);
        if (after_ns..=before_ns).contains(&at) && !self.counters.received.is_multiple_of(OFFSET_FRAMES) {
            return at;
        }
        self.received_at_by_new_offset(stamp)
    }

    #[cold]
    fn received_at_by_new_offset(&mut self, stamp: u64) -> u64 {
        self.unix_offset_ns = monotonic::unix_offset_ns();
        stamp.saturating_sub(self.unix_offset_ns).min(monotonic::now_ns())
    }

    /// Passes the oldest frame in either direction to `take`; false if there is none. No system call.
    pub(crate) fn look(&mut self, take: &mut dyn FnMut(Seen<'_>)) -> bool {
        let seen = self.ring.take_seen(take);
        self.counters.received += u64::from(seen);
        seen
    }

    /// Whether a frame waits in the ring. No system call.
    #[inline(always)]
    pub fn has_frame(&self) -> bool {
        self.ring.has_frame()
    }

    /// The counters. One system call.
    pub fn counters(&self) -> LinkCounters {
        let since = kernel::option(self.fd(), libc::SOL_PACKET, kernel::PACKET_STATISTICS, Statistics::default()).drops;
        self.overrun.set(self.overrun.get() + u64::from(since));
        LinkCounters { overrun: self.overrun.get(), ..self.counters }
    }

    /// The descriptor, readable while frames wait.
    #[inline]
    pub fn fd(&self) -> RawFd {
        self.fd.as_raw_fd()
    }
}

impl AsFd for PacketSocket {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.fd.as_fd()
    }
}

/// Index and address of an Ethernet interface.
fn ethernet(name: &str) -> Result<(libc::c_int, [u8; 6]), LinkError> {
    let missing = || LinkError::NoInterface { name: name.to_owned(), present: interface::names() };
    let index = kernel::index_of(name).ok_or_else(missing)?;
    let socket =
        kernel::request_socket().map_err(|errno| LinkError::from_errno(name, "reading its properties", errno))?;
    let answer =
        kernel::interface_request(socket.as_raw_fd(), name, libc::SIOCGIFHWADDR as _).map_err(|_| missing())?;
    // SAFETY: the kernel has filled in a hardware address.
    let address = unsafe { answer.ifr_ifru.ifru_hwaddr };
    if address.sa_family != libc::ARPHRD_ETHER {
        return Err(LinkError::NotEthernet { name: name.to_owned() });
    }
    Ok((index as libc::c_int, kernel::hardware_address(&address)))
}

pub(crate) fn attach(fd: RawFd, program: &mut [libc::sock_filter]) -> Result<(), i32> {
    let attached = libc::sock_fprog { len: program.len() as libc::c_ushort, filter: program.as_mut_ptr() };
    kernel::set_option(fd, libc::SOL_SOCKET, libc::SO_ATTACH_FILTER, &attached)
}

pub(crate) fn bind(fd: RawFd, index: libc::c_int, protocol: u16) -> Result<(), i32> {
    // SAFETY: all bytes zero is a valid sockaddr_ll.
    let mut address: libc::sockaddr_ll = unsafe { zeroed() };
    address.sll_family = libc::AF_PACKET as libc::c_ushort;
    address.sll_protocol = protocol.to_be();
    address.sll_ifindex = index;
    let length = size_of::<libc::sockaddr_ll>() as libc::socklen_t;
    // SAFETY: pointer and length describe a live address.
    if unsafe { libc::bind(fd, std::ptr::from_ref(&address).cast(), length) } < 0 {
        return Err(kernel::errno());
    }
    Ok(())
}

pub(crate) fn join(fd: RawFd, interface: libc::c_int, promiscuous: bool) -> Result<(), i32> {
    let mut address = [0; 8];
    address[..6].copy_from_slice(&GROUP_ADDRESS);
    let kind = if promiscuous { kernel::PACKET_MR_PROMISC } else { kernel::PACKET_MR_MULTICAST };
    let membership = Membership { interface, kind, address_length: 6, address };
    kernel::set_option(fd, libc::SOL_PACKET, kernel::PACKET_ADD_MEMBERSHIP, &membership)
}
