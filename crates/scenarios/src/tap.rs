//! The links between engine and segment, with a tap: all frames are hashed, frames can be injected, and virtual time
//! has a limit, so that an engine that hangs fails its test instead of blocking it.

use ringcat::simulated::SimulatedSegment;
use ringcat::standby::ForwardingCounters;
use ringcat::{Instant, Link, Links};
use ringcat_engine::{Class, class_of};
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::command::Command;
use ringcat_wire::frame::{Frame, MacAddress};

use crate::loss::Loss;
use crate::segments::{descriptions, line};

/// Limit of consecutive receives and waits without progress of time; far more than an engine needs between two events.
const IDLE_CALLS: u64 = 200_000;
const FNV_OFFSET: u64 = 0xCBF2_9CE4_8422_2325;
const FNV_PRIME: u64 = 0x0000_0100_0000_01B3;

/// A running hash (FNV-1a).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fingerprint(pub u64);

impl Default for Fingerprint {
    fn default() -> Self {
        Fingerprint(FNV_OFFSET)
    }
}

impl Fingerprint {
    /// Adds bytes.
    pub fn take(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(FNV_PRIME);
        }
    }
}

/// Offset of the frame id in the source address, and of the first datagram's Idx, which carries its upper bits.
const FRAME_ID_AT: usize = 7;
const INDEX_AT: usize = 17;
/// Bit of the first byte of the source address that marks the redundant copy.
const REDUNDANT_BIT: u8 = 0x08;

/// Number of a cyclic frame, and a bit for each link with a returned copy.
#[derive(Clone, Copy, Debug)]
struct Out {
    frame: (u8, u8),
    back: u8,
    /// A further try of its cycle has left.
    is_superseded: bool,
}

/// Links into a simulated segment, tapped.
#[derive(Debug)]
pub struct Tap {
    segment: SimulatedSegment,
    fingerprint: Fingerprint,
    injected: Vec<(Link, Vec<u8>)>,
    limit: Instant,
    idle: u64,
    /// Last time at which the exchange began to send.
    cyclic_sent: Instant,
    /// Cyclic frames of the last cycle, with all tries.
    out: Vec<Out>,
    /// Marks of sent cyclic frames with their times, until they are taken.
    departed: Vec<(Instant, (u8, u8))>,
    /// Copies that came back after frames of a newer cycle had been sent, or twice.
    outdated: u64,
    /// Other copies that came back after a further try of their cycle had been sent.
    superseded: u64,
    /// Whether the arrival of the frame that was taken last is known, as with packet sockets.
    has_arrival_times: bool,
    /// When the last frame was taken.
    taken_at: Instant,
    /// Whether links can be taken down.
    can_disconnect: bool,
    /// Injected losses.
    losses: Vec<Loss>,
    /// Random losses, per thousand frames.
    lost_per_mille: u64,
    /// Random losses, one in so many frames; none if 0.
    lost_one_in: u64,
    /// Maximum random delay of the end of a wait.
    oversleep_ns: u64,
    /// Maximum random sending delay of a frame.
    late_sending_ns: u64,
    random: u64,
    /// Longest round trip of a cyclic frame that came back before the next send, in nanoseconds.
    flight_ns: u64,
}

impl Tap {
    /// Taps the links of a network.
    pub fn new(network: Network) -> Tap {
        Tap {
            segment: SimulatedSegment::new(network),
            fingerprint: Fingerprint::default(),
            injected: Vec::new(),
            limit: Instant::NEVER,
            idle: 0,
            cyclic_sent: Instant::default(),
            out: Vec::new(),
            departed: Vec::new(),
            outdated: 0,
            superseded: 0,
            has_arrival_times: false,
            taken_at: Instant::default(),
            can_disconnect: true,
            losses: Vec::new(),
            lost_per_mille: 0,
            lost_one_in: 0,
            oversleep_ns: 0,
            late_sending_ns: 0,
            random: FNV_OFFSET,
            flight_ns: 0,
        }
    }

    /// The segment.
    pub fn network(&self) -> &Network {
        self.segment.network()
    }

    /// The segment, for fault injection.
    pub fn network_mut(&mut self) -> &mut Network {
        self.segment.network_mut()
    }

    /// Frames that the second MainDevice has forwarded, where the segment has one.
    pub fn forwarded(&self) -> ForwardingCounters {
        self.segment.forwarded()
    }

    /// The segment, which outlives the program on it.
    pub fn into_network(mut self) -> Network {
        let other = line(descriptions(&["coupler"]), NetworkOptions::default());
        std::mem::replace(self.network_mut(), other)
    }

    /// Injects a frame that the engine receives next on a link.
    pub fn inject(&mut self, link: Link, bytes: &[u8]) {
        self.injected.push((link, bytes.to_vec()));
    }

    /// Adds a loss of frames with a matching datagram.
    pub fn lose(&mut self, loss: Loss) {
        self.losses.push(loss);
    }

    /// Number of losses that have not occurred yet.
    pub fn losses_left(&self) -> u32 {
        self.losses.iter().map(|loss| loss.count).sum()
    }

    /// From now on the links record when frames arrive, as packet sockets do: cycles of one frame take their fast path.
    pub fn know_arrivals(&mut self) {
        self.has_arrival_times = true;
    }

    /// From now on links cannot be taken down.
    pub fn forbid_disconnecting(&mut self) {
        self.can_disconnect = false;
    }

    /// From now on this many of a thousand frames are lost, on their way out or back, at random from a seed.
    pub fn lose_per_mille(&mut self, lost: u64, seed: u64) {
        self.lost_per_mille = lost;
        self.reseed(seed);
    }

    /// As [`Tap::lose_per_mille`], one in so many frames: for rare losses.
    pub fn lose_one_in(&mut self, frames: u64, seed: u64) {
        self.lost_one_in = frames;
        self.reseed(seed);
    }

    fn is_lost(&mut self, outward: bool, bytes: &[u8]) -> bool {
        if self.lost_one_in > 0 && self.random(self.lost_one_in - 1) == 0 {
            return true;
        }
        if self.lost_per_mille > 0 && self.random(999) < self.lost_per_mille {
            return true;
        }
        self.losses.iter_mut().any(|loss| loss.hits(outward, bytes))
    }

    /// From now on reaching this time is a failure.
    pub fn set_limit(&mut self, limit: Instant) {
        self.limit = limit;
    }

    /// Hash of all frames with link, direction and time.
    pub fn fingerprint(&self) -> Fingerprint {
        self.fingerprint
    }

    /// Longest time from the beginning of a cycle to the return of one of its frames, since [`Tap::measure_flights`].
    pub fn flight_ns(&self) -> u64 {
        self.flight_ns
    }

    /// From now on waits end up to this much too late, at random, as on a host without real time.
    pub fn oversleep(&mut self, most: std::time::Duration) {
        self.oversleep_ns = most.as_nanos() as u64;
    }

    /// From now on each frame is sent with a random delay up to this time, each copy by itself.
    pub fn send_late(&mut self, most: std::time::Duration) {
        self.late_sending_ns = most.as_nanos() as u64;
    }

    /// Random delays and losses are those of this seed from now on.
    pub fn reseed(&mut self, seed: u64) {
        self.random = FNV_OFFSET ^ seed.wrapping_mul(FNV_PRIME);
    }

    /// A random number up to `most`.
    fn random(&mut self, most: u64) -> u64 {
        // xorshift64.
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        self.random % (most + 1)
    }

    /// Copies of cyclic frames that came back after frames of a newer cycle had been sent, or twice: they must not be
    /// treated as new.
    pub fn outdated(&self) -> u64 {
        self.outdated
    }

    /// Other copies that came back after a further try of their cycle had been sent: they are late if the cycle was
    /// complete by then.
    pub fn superseded(&self) -> u64 {
        self.superseded
    }

    /// Cyclic frames sent since the last call: time, byte 1 of the source address, and Idx.
    pub fn take_departed(&mut self) -> Vec<(Instant, (u8, u8))> {
        std::mem::take(&mut self.departed)
    }

    /// Restarts the measurement of round trips.
    pub fn measure_flights(&mut self) {
        self.flight_ns = 0;
    }

    /// The engine polled for frames or waited, and no time passed.
    fn count_idle(&mut self) {
        self.idle += 1;
        assert!(self.idle < IDLE_CALLS, "the engine lets no time pass, at {} ns", self.segment.now().0);
    }

    fn note(&mut self, outward: bool, link: Link, bytes: &[u8]) {
        let now = self.segment.now();
        self.fingerprint.take(&now.0.to_le_bytes());
        self.fingerprint.take(&[u8::from(outward), link.index() as u8]);
        self.fingerprint.take(bytes);
        if class_of(bytes) != Some(Class::Cyclic) {
            return;
        }
        let frame = (bytes[FRAME_ID_AT], bytes[INDEX_AT]);
        if outward {
            if now > self.cyclic_sent && !is_further_try(bytes) {
                self.out.clear();
                self.cyclic_sent = now;
            }
            if link == Link::Main {
                if now > self.cyclic_sent {
                    self.out.iter_mut().for_each(|out| out.is_superseded = true);
                }
                self.out.push(Out { frame, back: 0, is_superseded: false });
                self.departed.push((now, frame));
            }
        } else {
            self.flight_ns = self.flight_ns.max(now.since(self.cyclic_sent).as_nanos() as u64);
            let copy = if bytes[6] & REDUNDANT_BIT == 0 { 1 } else { 2 };
            match self.out.iter_mut().find(|out| out.frame == frame) {
                Some(out) if out.back & copy == 0 => {
                    out.back |= copy;
                    self.superseded += u64::from(out.is_superseded);
                }
                Some(_) | None => self.outdated += 1,
            }
        }
    }
}

/// Whether a cyclic frame is a further try of its cycle: it has process data only, neither supervision nor clocks.
fn is_further_try(bytes: &[u8]) -> bool {
    let logical = |command| matches!(command, Command::Lrd | Command::Lwr | Command::Lrw);
    Frame::parse(bytes).is_ok_and(|frame| frame.datagrams().all(|datagram| logical(datagram.header.command)))
}

impl Links for Tap {
    fn now(&self) -> Instant {
        self.segment.now()
    }

    fn addresses(&self) -> ringcat::PerLink<MacAddress> {
        self.segment.addresses()
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        if self.late_sending_ns > 0 {
            let late = self.random(self.late_sending_ns);
            self.segment.network_mut().advance_by(std::time::Duration::from_nanos(late));
        }
        self.note(true, link, frame);
        if !self.is_lost(true, frame) {
            self.segment.send(link, frame);
        }
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        if !self.injected.is_empty() {
            let (link, bytes) = self.injected.remove(0);
            self.note(false, link, &bytes);
            self.taken_at = self.segment.now();
            take(link, &bytes);
            return true;
        }
        let mut received = None;
        let any = self.segment.receive(&mut |link, frame| received = Some((link, frame.to_vec())));
        if let Some((link, frame)) = received.filter(|(_, frame)| !self.is_lost(false, frame)) {
            self.note(false, link, &frame);
            self.taken_at = self.segment.now();
            take(link, &frame);
        }
        if !any {
            self.count_idle();
        }
        any
    }

    fn has_arrival_times(&self) -> bool {
        self.has_arrival_times
    }

    fn received_at(&mut self, _sent_at: Instant, _now: Instant) -> Option<Instant> {
        self.has_arrival_times.then_some(self.taken_at)
    }

    fn carrier(&self, link: Link) -> Option<bool> {
        self.segment.carrier(link)
    }

    fn force_disconnect(&mut self, link: Link, disconnect: bool) -> bool {
        self.can_disconnect && self.segment.force_disconnect(link, disconnect)
    }

    fn wait(&mut self, until: Instant) {
        let before = self.segment.now();
        let mut until = until.min(self.limit);
        if self.oversleep_ns > 0 && until > before {
            until = Instant(until.0.saturating_add(self.random(self.oversleep_ns)));
        }
        self.segment.wait(until);
        let now = self.segment.now();
        assert!(now < self.limit, "virtual time reached its limit of {} ms", self.limit.0 / 1_000_000);
        if now > before {
            self.idle = 0;
        } else {
            self.count_idle();
        }
    }
}
