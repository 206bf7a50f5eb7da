//! A socket with its ring that another process opened: this process goes on with it.

use std::cell::Cell;
use std::os::fd::{AsRawFd, OwnedFd, RawFd};

use super::{LinkCounters, PacketSocket, ethernet};
use crate::error::LinkError;
use crate::kernel;
use crate::monotonic;
use crate::receive_mode::ReceiveMode;
use crate::rx_ring::{self, RxRing};

/// What a process needs to continue with a socket, beside its descriptor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HandedSocket {
    /// Name of the interface to which it is bound.
    pub interface: String,
    /// The address that stands for the interface while it is absent: the socket gets it when it comes, from a process
    /// that has a duplicate ([`give`](super::binding::give)). `None`: it is there.
    pub absent_mac: Option<[u8; 6]>,
    /// Slots of its ring, as they were created.
    pub slots: u32,
    /// The slot that is read next; `None` if it is not known, because the former owner crashed. It is found then.
    pub next_slot: Option<u32>,
    /// How this process waits.
    pub receive: ReceiveMode,
}

impl PacketSocket {
    /// What another process needs to continue with this socket. This process must not receive from it any more.
    pub fn handed(&self) -> HandedSocket {
        HandedSocket {
            interface: self.interface.clone(),
            absent_mac: None,
            slots: self.ring.slots() as u32,
            next_slot: (!self.is_searching).then(|| self.ring.next_slot()),
            receive: self.mode,
        }
    }

    /// Goes on with a socket that another process has opened, whose descriptor this one has received. Frames that wait
    /// in the ring are received first. No privilege is needed.
    ///
    /// Without a place given it is that of the oldest frame that waits. If none waits, it follows from the times of
    /// earlier frames, and stays in doubt until the first frame: see [`PacketSocket::find_place`].
    ///
    /// # Errors
    /// The descriptor is no packet socket with such a ring, or it is bound to another interface.
    pub fn adopt(fd: OwnedFd, handed: &HandedSocket) -> Result<PacketSocket, LinkError> {
        let interface = &handed.interface;
        let failed = |what| move |errno| LinkError::from_errno(interface, what, errno);
        let (expected, mac) = match handed.absent_mac {
            Some(mac) => (Expected::Any, mac),
            None => ethernet(interface).map(|(index, mac)| (Expected::Interface(index), mac))?,
        };
        check(fd.as_raw_fd(), expected).map_err(failed("going on with the socket of another process"))?;
        let layout = rx_ring::layout(handed.slots);
        // The kernel refuses another length than that of the ring.
        let mut ring = RxRing::map(fd.as_raw_fd(), &layout).map_err(failed("mapping the ring of another process"))?;
        let place = ring.find();
        ring.go_to(handed.next_slot.unwrap_or(place.slot));
        kernel::clear_error(&fd);
        Ok(PacketSocket {
            ring,
            fd,
            interface: interface.clone(),
            mac,
            mode: handed.receive,
            counters: LinkCounters::default(),
            overrun: Cell::new(0),
            unix_offset_ns: monotonic::unix_offset_ns(),
            is_searching: handed.next_slot.is_none() && !place.is_certain,
        })
    }

    /// Looks at all slots for the first frame, as long as the place in the ring is in doubt; false while it is. To be
    /// called after [`PacketSocket::receive`] has returned nothing. Without doubt it costs nothing.
    #[inline]
    pub fn find_place(&mut self) -> bool {
        !self.is_searching || self.search()
    }

    #[cold]
    fn search(&mut self) -> bool {
        let place = self.ring.find();
        if place.is_certain || self.counters.received > 0 {
            if place.is_certain {
                self.ring.go_to(place.slot);
            }
            self.is_searching = false;
        }
        !self.is_searching
    }
}

/// What a socket is bound to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Expected {
    /// The interface with this number.
    Interface(libc::c_int),
    /// Any, or none yet.
    Any,
}

/// Whether it is a packet socket with a ring of our version, bound as expected.
fn check(fd: RawFd, expected: Expected) -> Result<(), i32> {
    let domain = kernel::option::<libc::c_int>(fd, libc::SOL_SOCKET, libc::SO_DOMAIN, 0);
    let kind = kernel::option::<libc::c_int>(fd, libc::SOL_SOCKET, libc::SO_TYPE, 0);
    let version = kernel::option::<libc::c_int>(fd, libc::SOL_PACKET, kernel::PACKET_VERSION, -1);
    if (domain, kind, version) != (libc::AF_PACKET, libc::SOCK_RAW, kernel::TPACKET_V2) {
        return Err(libc::ENOTSOCK);
    }
    match expected {
        Expected::Interface(index) if kernel::bound_interface(fd)? != index => Err(libc::ENODEV),
        _ => Ok(()),
    }
}
