//! Seeing what passes on a network interface, in both directions, without taking part.
//!
//! In goes the name of an interface, out come its frames with direction and the kernel's time stamp. A sniffer never
//! sends; programs that use the interface do not notice it.

use crate::error::LinkError;
use crate::packet_socket::{PacketOptions, PacketSocket, Passing};
use crate::pcapng::Direction;

/// Frames that find room while the reader is busy elsewhere: 16 MiB, and a second of frames that come every 100 us.
const RING_FRAMES: u32 = 8192;

/// A frame that passed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Passed<'a> {
    /// Received or sent by this host.
    pub direction: Direction,
    /// When the kernel saw it, in nanoseconds since 1970.
    pub unix_time_ns: u64,
    /// Its length without FCS. Of frames beyond 1,982 bytes only the beginning is in `frame`.
    pub length: usize,
    /// The frame, with its VLAN tag if it has one.
    pub frame: &'a [u8],
}

/// Sees one interface.
#[derive(Debug)]
pub struct Sniffer {
    socket: PacketSocket,
}

impl Sniffer {
    /// Begins to see an interface: EtherCAT frames (EtherType 0x88A4), or all. The interface may be down and come up
    /// later.
    ///
    /// # Errors
    /// As [`PacketSocket::open`].
    pub fn open(interface: &str, all: bool) -> Result<Sniffer, LinkError> {
        let options = PacketOptions { ring_frames: RING_FRAMES, keep_vlan_tags: true, ..PacketOptions::default() };
        let socket = PacketSocket::open_with(interface, &options, Passing { outgoing: true, all })?;
        Ok(Sniffer { socket })
    }

    /// Hands the oldest frame to `take`; false where there is none.
    pub fn next(&mut self, take: &mut dyn FnMut(Passed<'_>)) -> bool {
        self.socket.look(&mut |seen| {
            let direction = if seen.outgoing { Direction::Out } else { Direction::In };
            take(Passed { direction, unix_time_ns: seen.unix_time_ns, length: seen.length, frame: seen.bytes });
        })
    }

    /// Frames that the kernel had no room for. One system call.
    pub fn lost(&self) -> u64 {
        self.socket.counters().overrun
    }

    /// To wait for it with [`crate::wait`].
    pub fn socket(&self) -> &PacketSocket {
        &self.socket
    }
}
