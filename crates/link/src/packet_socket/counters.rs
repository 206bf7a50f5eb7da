//! What a packet socket has sent, received and lost.

/// Counters of a socket.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct LinkCounters {
    /// Frames that the kernel accepted for sending.
    pub sent: u64,
    /// Frames returned by [`PacketSocket::receive`](super::PacketSocket::receive).
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
