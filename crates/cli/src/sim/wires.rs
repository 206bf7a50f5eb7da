//! Between network interfaces and a segment in virtual time.
//!
//! Virtual time follows `CLOCK_MONOTONIC`: each turn first processes everything in the segment that is due by now. A
//! frame that has arrived on an interface then enters the segment at its host interface, and a frame that has come back
//! there leaves on the network interface.
//!
//! The segment's host interface takes a frame's wire time at 100 Mbit/s once, when the frame enters; the way out adds
//! nothing, because what comes out is due when its last bit is. On a veth pair, which takes no time itself, a round
//! trip is thus as long as on a real segment. On a real cable the wire time of both its directions comes on top.
//!
//! As fast as possible ([`Pace::AsFastAsPossible`]), virtual time leaps to the end of each frame's way, and keeps the
//! lead that it gains so over the monotonic clock: nothing in the segment runs backwards or waits for the clock to
//! catch up.

use std::time::Duration;

use clap::ValueEnum;
use ringcat::sim::cable::HostLink;
use ringcat::sim::network::Network;
use ringcat::sim::time::SimTime;
use ringcat_link::{LinkCounters, LinkError, PacketOptions, PacketSocket, ReceiveMode, monotonic};

use super::lateness::Lateness;
use super::residence::Residence;
use crate::json::sim::Interface;

/// Longest time between two checks for orders while the simulator spins.
const SPIN: Duration = Duration::from_micros(50);
/// The same while it sleeps: a stall of this machine that is not longer goes unnoticed.
const NAP: Duration = Duration::from_micros(500);

/// A receive stamp is nearer to the present, unless the Unix clock was set meanwhile.
const STAMPED_WITHIN_NS: u64 = 1_000_000_000;

/// Time that frames under way may take at most in one leap.
const LONGEST_LEAP: Duration = Duration::from_millis(100);

/// How long frames take.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Pace {
    /// As long as at 100 Mbit/s through real SubDevices
    RealTime,
    /// As long as this machine needs to compute the answer; timers of SubDevices then run a little ahead of the clock
    AsFastAsPossible,
}

/// Time in the segment.
#[derive(Clone, Copy, Debug)]
struct Clock {
    /// The monotonic time at which virtual time began.
    begin_ns: u64,
    /// How far leaps have brought virtual time ahead since.
    lead_ns: u64,
}

impl Clock {
    /// Virtual time has gone on by this time while no real time passed.
    fn leap(&mut self, by: Duration) {
        let by_ns = u64::try_from(by.as_nanos()).unwrap_or(u64::MAX);
        self.lead_ns = self.lead_ns.saturating_add(by_ns);
    }

    /// Virtual time at a monotonic time.
    fn virtual_time(self, now_ns: u64) -> SimTime {
        SimTime(now_ns.saturating_sub(self.begin_ns).saturating_add(self.lead_ns))
    }

    /// The monotonic time of a moment in the segment.
    fn monotonic_time(self, at: SimTime) -> u64 {
        at.0.saturating_sub(self.lead_ns).saturating_add(self.begin_ns)
    }
}

/// The network interfaces of a simulated segment.
#[derive(Debug)]
pub struct Wires {
    sockets: Vec<(HostLink, PacketSocket)>,
    mode: ReceiveMode,
    pace: Pace,
    clock: Clock,
    /// When the next turn is due.
    asked_ns: u64,
    /// How late turns came.
    pub lateness: Lateness,
    /// How long frames were here, at the pace that answers each at once.
    residence: Residence,
    /// When the frames of this turn arrived.
    arrivals_ns: Vec<u64>,
}

impl Wires {
    /// Opens the interfaces; virtual time, which is at zero, goes on from now.
    ///
    /// # Errors
    /// An interface that is not there or carries no Ethernet, or a missing permission.
    pub fn open(main: &str, redundant: Option<&str>, mode: ReceiveMode, pace: Pace) -> Result<Wires, LinkError> {
        let options = PacketOptions::default().with_receive(mode).with_ring_frames(1024);
        let names = [(HostLink::Main, Some(main)), (HostLink::Redundant, redundant)];
        let named = names.into_iter().filter_map(|(link, name)| Some((link, name?)));
        let open = |(link, name)| Ok((link, PacketSocket::open(name, &options)?));
        let now = monotonic::now_ns();
        Ok(Wires {
            sockets: named.map(open).collect::<Result<_, LinkError>>()?,
            mode,
            pace,
            clock: Clock { begin_ns: now, lead_ns: 0 },
            asked_ns: u64::MAX,
            lateness: Lateness::default(),
            residence: Residence::default(),
            arrivals_ns: Vec::new(),
        })
    }

    /// One turn: what is due happens, frames go in and out. Returns the monotonic time of the turn.
    pub fn turn(&mut self, network: &mut Network) -> u64 {
        let now = monotonic::now_ns();
        self.lateness.note(self.asked_ns, now);
        network.advance(self.clock.virtual_time(now));
        self.arrivals_ns.clear();
        for (link, socket) in &mut self.sockets {
            while socket.receive(&mut |frame| network.send(*link, frame)) {
                if self.pace == Pace::AsFastAsPossible {
                    let bounds = (now.saturating_sub(STAMPED_WITHIN_NS), now + STAMPED_WITHIN_NS);
                    self.arrivals_ns.push(socket.received_at_ns(bounds.0, bounds.1));
                }
            }
        }
        if self.pace == Pace::AsFastAsPossible {
            let before = network.now();
            network.advance_until_quiet(before + LONGEST_LEAP);
            self.clock.leap(network.now() - before);
        }
        let mut arrivals = self.arrivals_ns.iter();
        for (link, socket) in &mut self.sockets {
            while let Some(received) = network.receive(*link) {
                if let Some(arrived) = arrivals.next() {
                    self.residence.note(monotonic::now_ns().saturating_sub(*arrived));
                }
                // An interface that is down loses the frame, as a cable does.
                socket.send(&received.bytes);
                network.give_back(received.bytes);
            }
        }
        network.settle_all();
        now
    }

    /// Waits until a frame arrives or something is due in the segment, but not for long.
    pub fn wait(&mut self, network: &Network, now: u64) {
        let pause = if self.mode == ReceiveMode::BusyPoll { SPIN } else { NAP };
        let longest = now + pause.as_nanos() as u64;
        let due = network.next_event().map_or(u64::MAX, |at| self.clock.monotonic_time(at));
        self.asked_ns = longest.min(due.max(now));
        let mut sockets = self.sockets.iter().map(|(_, socket)| socket);
        match (sockets.next(), sockets.next()) {
            (Some(main), Some(redundant)) => ringcat_link::wait(&[main, redundant], self.asked_ns, self.mode),
            (Some(main), None) => ringcat_link::wait(&[main], self.asked_ns, self.mode),
            (None, _) => false,
        };
    }

    /// Counters of the interfaces as keys of JSON.
    pub fn json(&self) -> Vec<Interface> {
        let interface = |(link, socket): &(HostLink, PacketSocket)| {
            let LinkCounters { sent, received, down, busy, refused, overrun, truncated, .. } = socket.counters();
            Interface {
                link: link.to_string(),
                received_frames: received,
                overrun_frames: overrun,
                truncated_frames: truncated,
                sent_frames: sent,
                unsent_frames: down + busy + refused,
            }
        };
        self.sockets.iter().map(interface).collect()
    }

    /// Counters of the interfaces, and how late this simulator was.
    pub fn summary(&self) -> String {
        let line = |(link, socket): &(HostLink, PacketSocket)| {
            let LinkCounters { sent, received, down, busy, refused, overrun, truncated, .. } = socket.counters();
            let unsent = down + busy + refused;
            format!(
                "{link} interface: {received} frames received, {overrun} lost in a full ring, {truncated} too long, \
                 {sent} sent, {unsent} not sent\n"
            )
        };
        let residence = self.residence.summary().map_or_else(String::new, |line| line + "\n");
        self.sockets.iter().map(line).collect::<String>() + &residence + &self.lateness.summary()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: sim-interfaces
    #[test]
    fn virtual_time_keeps_what_it_has_gained_and_never_goes_back() {
        let mut clock = Clock { begin_ns: 1_000, lead_ns: 0 };
        let mut before = clock.virtual_time(1_000);
        assert_eq!(before, SimTime(0));
        for host_ns in (1_000..5_000).step_by(100) {
            let arrives = clock.virtual_time(host_ns);
            assert!(arrives >= before, "at {host_ns}");
            clock.leap(Duration::from_nanos(60));
            before = arrives + Duration::from_nanos(60);
        }
        assert_eq!(clock.virtual_time(5_000), SimTime(4_000 + 40 * 60));
        assert_eq!(clock.monotonic_time(SimTime(4_000 + 40 * 60)), 5_000);
    }
}
