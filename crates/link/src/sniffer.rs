//! Captures the frames of a network interface in both directions, passively.
//!
//! Input: the name of an interface. Output: its frames with direction and the kernel's time stamp. A sniffer never
//! sends and does not disturb programs that use the interface.

use crate::error::LinkError;
use crate::packet_socket::{PacketOptions, PacketSocket, Passing};
use crate::pcapng::Direction;

/// Slots of the receive ring: 16 MiB, about one second of frames at intervals of 100 us.
const RING_FRAMES: u32 = 8192;

/// A captured frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Passed<'a> {
    /// Direction, seen from this host.
    pub direction: Direction,
    /// Time of the kernel, in nanoseconds since 1970.
    pub unix_time_ns: u64,
    /// Its length without FCS. Of frames longer than 1,982 bytes, `frame` holds only the beginning.
    pub length: usize,
    /// The frame, with its VLAN tag if it has one.
    pub frame: &'a [u8],
}

/// A capture of one interface.
#[derive(Debug)]
pub struct Sniffer {
    socket: PacketSocket,
}

impl Sniffer {
    /// Begins to capture an interface: EtherCAT frames (EtherType 0x88A4), or all. The interface may be down and come
    /// up later.
    ///
    /// # Errors
    /// As [`PacketSocket::open`].
    pub fn open(interface: &str, all: bool) -> Result<Sniffer, LinkError> {
        let options = PacketOptions::default().with_ring_frames(RING_FRAMES).with_keep_vlan_tags(true);
        let socket = PacketSocket::open_with(interface, &options, Passing { outgoing: true, all })?;
        Ok(Sniffer { socket })
    }

    /// Passes the oldest frame to `take`; false if there is none.
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

    /// The socket, for [`crate::wait`].
    pub fn socket(&self) -> &PacketSocket {
        &self.socket
    }
}
