//! Sending and receiving frames on a network interface: `AF_PACKET` with a memory-mapped receive ring.
//!
//! Input: the name of an interface and [`PacketOptions`]. Sending takes one system call per frame, receiving from the
//! ring none. One socket serves one thread; a MainDevice opens two per interface, one for each class of frames
//! ([`ClassFilter`]). The socket receives only EtherType 0x88A4 and no frames sent by this host.

pub mod binding;
mod counters;
pub mod handed;
pub mod prepared;
mod sending;

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

pub use counters::LinkCounters;
pub use sending::SendingSide;

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
    /// sockets of one EtherType. If true, the socket receives all frames before that step, and each EtherCAT frame
    /// counts as dropped in the statistics of the interface.
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
        self.sender().send(frame)
    }

    /// The side that sends, to be used while a frame is held.
    #[inline(always)]
    pub fn sender(&mut self) -> SendingSide<'_> {
        SendingSide::new(&self.fd, &mut self.counters)
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

    /// Passes the oldest received frame to `take` in its slot of the ring, where it may be changed, with the time of
    /// its reception and the side that sends; false if there is none. The time is on the monotonic clock; one that is
    /// not between `after_ns` and `before_ns` is determined again. No system call.
    #[inline]
    pub fn receive_in_place(
        &mut self,
        (after_ns, before_ns): (u64, u64),
        take: &mut dyn FnMut(&mut [u8], u64, SendingSide<'_>),
    ) -> bool {
        loop {
            let PacketSocket { ring, fd, counters, unix_offset_ns, .. } = self;
            let taken = ring.take_in_place(|frame, stamp| {
                let mut at = stamp.wrapping_sub(*unix_offset_ns);
                if !(after_ns..=before_ns).contains(&at) || counters.received.is_multiple_of(OFFSET_FRAMES) {
                    at = by_new_offset(stamp, unix_offset_ns);
                }
                take(frame, at, SendingSide::new(fd, counters));
            });
            match taken {
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
        by_new_offset(stamp, &mut self.unix_offset_ns)
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

/// A time of the Unix clock on the monotonic clock, after the offset of both is read again.
#[cold]
fn by_new_offset(stamp: u64, unix_offset_ns: &mut u64) -> u64 {
    *unix_offset_ns = monotonic::unix_offset_ns();
    stamp.saturating_sub(*unix_offset_ns).min(monotonic::now_ns())
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
