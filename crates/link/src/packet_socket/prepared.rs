//! A packet socket before it has an interface.
//!
//! The kernel waits for all processors when it makes a receive ring: 10 to 20 ms. A socket that was prepared is bound
//! in less than one.

use std::cell::Cell;
use std::os::fd::{AsRawFd, OwnedFd};

use super::{LinkCounters, PacketOptions, PacketSocket, Passing, attach, bind, ethernet, join};
use crate::error::LinkError;
use crate::filter;
use crate::kernel;
use crate::monotonic;
use crate::rx_ring::{self, RxRing};

/// A step of preparation that failed, and the error number.
type Failed = (&'static str, i32);

/// A packet socket with its ring and its filter, which receives nothing until it is bound to an interface.
#[derive(Debug)]
pub struct Prepared {
    // Declared before the descriptor, so that it is unmapped first.
    ring: RxRing,
    fd: OwnedFd,
    options: PacketOptions,
    passing: Passing,
}

impl Prepared {
    /// Prepares a socket.
    ///
    /// # Errors
    /// This user may not open packet sockets, or there is no memory for the ring.
    pub fn new(options: &PacketOptions) -> Result<Prepared, LinkError> {
        let prepared = Prepared::with(options, Passing { outgoing: false, all: false });
        prepared.map_err(|(what, errno)| LinkError::from_errno("a prepared socket", what, errno))
    }

    fn with(options: &PacketOptions, passing: Passing) -> Result<Prepared, Failed> {
        let failed = |what| move |errno| (what, errno);
        // Protocol 0 receives nothing until the filter and the interface are set.
        let fd = kernel::socket(libc::AF_PACKET, libc::SOCK_RAW, 0).map_err(failed("opening a packet socket"))?;
        let raw = fd.as_raw_fd();
        let set = |option, value: libc::c_int| kernel::set_option(raw, libc::SOL_PACKET, option, &value);
        set(kernel::PACKET_VERSION, kernel::TPACKET_V2).map_err(failed("choosing the ring's version"))?;
        // Before Linux 4.20 the ring code discards outgoing frames, at a higher cost.
        let _ = set(kernel::PACKET_IGNORE_OUTGOING, libc::c_int::from(!passing.outgoing));
        if !passing.all {
            attach(raw, &mut filter::program(options.filter)).map_err(failed("attaching the filter"))?;
        }
        let layout = rx_ring::layout(options.ring_frames);
        kernel::set_option(raw, libc::SOL_PACKET, kernel::PACKET_RX_RING, &layout)
            .map_err(failed("making the receive ring"))?;
        let ring = RxRing::map(raw, &layout).map_err(failed("mapping the receive ring"))?;
        Ok(Prepared { ring, fd, options: *options, passing })
    }

    /// The descriptor alone, for another process, which maps the ring
    /// ([`PacketSocket::adopt`](crate::PacketSocket::adopt)).
    pub fn into_descriptor(self) -> OwnedFd {
        self.fd
    }

    /// Binds it to an interface, which may be down and come up later.
    ///
    /// # Errors
    /// There is no such Ethernet interface, or the kernel refuses.
    pub fn bind(self, interface: &str) -> Result<PacketSocket, LinkError> {
        let index_and_mac = ethernet(interface)?;
        self.bind_to(interface, index_and_mac)
    }

    fn bind_to(self, interface: &str, found: (libc::c_int, [u8; 6])) -> Result<PacketSocket, LinkError> {
        let Prepared { ring, fd, options, passing } = self;
        let (index, mac) = found;
        let failed = |what| move |errno| LinkError::from_errno(interface, what, errno);
        let protocol = if options.keep_vlan_tags || passing.outgoing || passing.all {
            libc::ETH_P_ALL as u16
        } else {
            filter::ETHERCAT
        };
        bind(fd.as_raw_fd(), index, protocol).map_err(failed("binding to the interface"))?;
        join(fd.as_raw_fd(), index, options.promiscuous).map_err(failed("joining the EtherCAT group"))?;
        // An interface that is down leaves a pending error, which the first send would return.
        kernel::clear_error(&fd);
        Ok(PacketSocket {
            ring,
            fd,
            interface: interface.to_owned(),
            mac,
            mode: options.receive,
            counters: LinkCounters::default(),
            overrun: Cell::new(0),
            unix_offset_ns: monotonic::unix_offset_ns(),
            is_searching: false,
        })
    }
}

impl PacketSocket {
    /// Opens a socket on an interface, which may be down and come up later.
    ///
    /// # Errors
    /// There is no such Ethernet interface, or the kernel refuses.
    pub fn open(interface: &str, options: &PacketOptions) -> Result<PacketSocket, LinkError> {
        PacketSocket::open_with(interface, options, Passing { outgoing: false, all: false })
    }

    pub(crate) fn open_with(
        interface: &str,
        options: &PacketOptions,
        passing: Passing,
    ) -> Result<PacketSocket, LinkError> {
        let index_and_mac = ethernet(interface)?;
        Prepared::with(options, passing)
            .map_err(|(what, errno)| LinkError::from_errno(interface, what, errno))?
            .bind_to(interface, index_and_mac)
    }
}
