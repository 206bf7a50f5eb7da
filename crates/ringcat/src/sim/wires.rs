//! Between network interfaces and a segment in virtual time.
//!
//! Virtual time follows `CLOCK_MONOTONIC`: before anything else, each turn lets everything happen in the segment that is
//! due by now. A frame that has arrived on an interface then begins its way at the segment's host interface, and one
//! that has come back there leaves on the network interface.
//!
//! The segment's host interface takes a frame's wire time at 100 Mbit/s once, when the frame enters; the way out adds
//! nothing, because what comes out is due when its last bit is. On a veth pair, which takes no time itself, a round trip
//! is thus as long as on a real segment. On a real cable the wire time of both its directions comes on top.

use std::time::Duration;

use ringcat_link::{LinkCounters, LinkError, PacketOptions, PacketSocket, ReceiveMode, monotonic};
use ringcat_sim::cable::HostLink;
use ringcat_sim::network::Network;
use ringcat_sim::time::SimTime;

use super::lateness::Lateness;

/// Orders are looked for at least this often while the simulator spins.
const SPIN: Duration = Duration::from_micros(50);
/// And this often while it sleeps: a stall of this machine that is not longer goes unnoticed.
const NAP: Duration = Duration::from_micros(500);

/// The network interfaces of a simulated segment.
#[derive(Debug)]
pub struct Wires {
    sockets: Vec<(HostLink, PacketSocket)>,
    mode: ReceiveMode,
    /// The monotonic time at which virtual time began.
    begin_ns: u64,
    /// When the next turn is asked for.
    asked_ns: u64,
    /// How well that is kept.
    pub lateness: Lateness,
}

impl Wires {
    /// Opens the interfaces; virtual time, which is at zero, goes on from now.
    ///
    /// # Errors
    /// An interface that is not there or carries no Ethernet, or a missing permission.
    pub fn open(main: &str, redundant: Option<&str>, mode: ReceiveMode) -> Result<Wires, LinkError> {
        let options = PacketOptions { receive: mode, ring_frames: 1024, ..PacketOptions::default() };
        let names = [(HostLink::Main, Some(main)), (HostLink::Redundant, redundant)];
        let named = names.into_iter().filter_map(|(link, name)| Some((link, name?)));
        let open = |(link, name)| Ok((link, PacketSocket::open(name, &options)?));
        let now = monotonic::now_ns();
        Ok(Wires {
            sockets: named.map(open).collect::<Result<_, LinkError>>()?,
            mode,
            begin_ns: now,
            asked_ns: u64::MAX,
            lateness: Lateness::default(),
        })
    }

    /// One turn: what is due happens, frames go in and out. Returns the monotonic time of the turn.
    pub fn turn(&mut self, network: &mut Network) -> u64 {
        let now = monotonic::now_ns();
        self.lateness.note(self.asked_ns, now);
        network.advance(SimTime(now.saturating_sub(self.begin_ns)));
        for (link, socket) in &mut self.sockets {
            while socket.receive(&mut |frame| network.send(*link, frame)) {}
            while let Some(received) = network.receive(*link) {
                // An interface that is down loses the frame, as a cable does.
                socket.send(&received.bytes);
                network.give_back(received.bytes);
            }
        }
        now
    }

    /// Waits until a frame arrives or something is due in the segment, but not for long.
    pub fn wait(&mut self, network: &Network, now: u64) {
        let pause = if self.mode == ReceiveMode::BusyPoll { SPIN } else { NAP };
        let longest = now + pause.as_nanos() as u64;
        let due = network.next_event().map_or(u64::MAX, |at| at.0.saturating_add(self.begin_ns));
        self.asked_ns = longest.min(due.max(now));
        let mut sockets = self.sockets.iter().map(|(_, socket)| socket);
        match (sockets.next(), sockets.next()) {
            (Some(main), Some(redundant)) => ringcat_link::wait(&[main, redundant], self.asked_ns, self.mode),
            (Some(main), None) => ringcat_link::wait(&[main], self.asked_ns, self.mode),
            (None, _) => false,
        };
    }

    /// What the interfaces have carried, and how well this simulator has kept up.
    pub fn summary(&self) -> String {
        let line = |(link, socket): &(HostLink, PacketSocket)| {
            let LinkCounters { sent, received, down, busy, refused, overrun, truncated } = socket.counters();
            let unsent = down + busy + refused;
            format!(
                "{link} interface: {received} frames received, {overrun} lost in a full ring, {truncated} too long, {sent} \
                 sent, {unsent} not sent\n"
            )
        };
        self.sockets.iter().map(line).collect::<String>() + &self.lateness.summary()
    }
}
