//! Cables and their effect on a frame (protocol 11.4).
//!
//! A cable has two legs, one for each direction. A leg has its far end, its propagation delay, the start of its signal,
//! and the faults for the next frames. This module determines the delivery of a frame at the time at which its last bit
//! is due at the far end; the network assigns senders and receivers.

use core::fmt;
use core::time::Duration;

use crate::frame::Port;
use crate::time::SimTime;

/// Number of a device: its position in the segment file, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct DeviceIndex(pub usize);

/// Number of a cable in the order of declaration, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CableId(pub usize);

/// A network interface of the MainDevice, or of a second MainDevice (MainDevice redundancy, protocol 9.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum HostLink {
    /// MAIN.
    Main = 0,
    /// RED, the other end of a ring.
    Redundant = 1,
    /// MAIN of the second MainDevice.
    SecondMain = 2,
    /// RED of the second MainDevice.
    SecondRedundant = 3,
}

impl HostLink {
    /// Both links of the MainDevice.
    pub const ALL: [HostLink; 2] = [HostLink::Main, HostLink::Redundant];
    /// Both links of the second MainDevice.
    pub const SECOND: [HostLink; 2] = [HostLink::SecondMain, HostLink::SecondRedundant];
    /// Number of all of them.
    pub(crate) const COUNT: usize = 4;

    /// The MainDevice that it belongs to.
    pub const fn host(self) -> Host {
        match self {
            HostLink::Main | HostLink::Redundant => Host::First,
            HostLink::SecondMain | HostLink::SecondRedundant => Host::Second,
        }
    }
}

/// One of two MainDevices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Host {
    /// The MainDevice with [`HostLink::Main`].
    First = 0,
    /// The MainDevice with [`HostLink::SecondMain`].
    Second = 1,
}

impl Host {
    /// Both.
    pub const ALL: [Host; 2] = [Host::First, Host::Second];
    /// Their number.
    pub(crate) const COUNT: usize = 2;

    /// Its main link and its redundant link.
    pub const fn links(self) -> [HostLink; 2] {
        [self.main(), self.redundant()]
    }

    /// Its main link.
    pub const fn main(self) -> HostLink {
        match self {
            Host::First => HostLink::Main,
            Host::Second => HostLink::SecondMain,
        }
    }

    /// Its redundant link.
    pub const fn redundant(self) -> HostLink {
        match self {
            Host::First => HostLink::Redundant,
            Host::Second => HostLink::SecondRedundant,
        }
    }

    /// The other one.
    #[must_use]
    pub const fn other(self) -> Host {
        match self {
            Host::First => Host::Second,
            Host::Second => Host::First,
        }
    }
}

impl fmt::Display for HostLink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            HostLink::Main => "main",
            HostLink::Redundant => "redundant",
            HostLink::SecondMain => "second main",
            HostLink::SecondRedundant => "second redundant",
        })
    }
}

/// Possible ends of a cable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Endpoint {
    /// A port of a device.
    Device(DeviceIndex, Port),
    /// An interface of a MainDevice.
    Host(HostLink),
}

/// A cable: both ends and its propagation delay (5 ns per metre, protocol 1.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CableSpec {
    /// One end.
    pub a: Endpoint,
    /// The other end.
    pub b: Endpoint,
    /// Propagation delay.
    pub delay: Duration,
}

/// One of the two directions of a cable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Direction {
    /// From end `a` to end `b`.
    AToB = 0,
    /// From end `b` to end `a`.
    BToA = 1,
}

impl Direction {
    /// Both directions.
    pub const ALL: [Direction; 2] = [Direction::AToB, Direction::BToA];
}

/// One direction of a cable, as a number: twice the cable's number, plus the direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LegId(pub(crate) u32);

impl LegId {
    pub(crate) fn new(cable: CableId, direction: Direction) -> LegId {
        LegId((cable.0 as u32) << 1 | direction as u32)
    }

    pub(crate) fn index(self) -> usize {
        self.0 as usize
    }

    pub(crate) fn cable(self) -> CableId {
        CableId(self.index() >> 1)
    }

    /// The same cable, the other direction.
    pub(crate) fn reverse(self) -> LegId {
        LegId(self.0 ^ 1)
    }
}

/// Delivery of a frame whose last bit is due at the end of a leg.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Delivery {
    /// Arrives completely.
    Arrives,
    /// The signal was lost while the frame was arriving: only its beginning arrives.
    Truncated {
        /// Time for which the receiver saw the frame.
        seen: Duration,
    },
    /// Does not arrive.
    Lost,
}

/// Faults for the next frames on a leg.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct LegFaults {
    /// Number of frames to drop.
    pub(crate) drop: u32,
    /// Number of frames to duplicate.
    pub(crate) duplicate: u32,
    /// Number of frames to corrupt.
    pub(crate) corrupt: u32,
    /// Number of frames to damage by an invalid symbol.
    pub(crate) symbol_errors: u32,
    /// Number of frames to delay.
    pub(crate) delay: u32,
    /// Their delay.
    pub(crate) delay_by: Duration,
    /// Whether every frame is lost although both ends have a link.
    pub(crate) blocked: bool,
}

impl LegFaults {
    /// Decrements a counter of frames; `false` if it is zero.
    pub(crate) fn take(counter: &mut u32) -> bool {
        let hit = *counter > 0;
        *counter -= u32::from(hit);
        hit
    }
}

/// One direction of a cable.
#[derive(Clone, Debug)]
pub(crate) struct Leg {
    /// Far end.
    pub(crate) to: Endpoint,
    /// Propagation delay.
    pub(crate) delay_ns: u64,
    /// Whether the receiving end detects a signal (detection takes time).
    pub(crate) detected: bool,
    /// Time at which it was detected.
    pub(crate) detected_at: SimTime,
    /// Whether any fault is set: avoids the check of each fault for frames on healthy cables.
    pub(crate) faulty: bool,
    /// The faults.
    pub(crate) faults: LegFaults,
    signal: bool,
    up_since: SimTime,
    last_up: Option<(SimTime, SimTime)>,
}

impl Leg {
    /// A leg with a signal that was detected long ago.
    pub(crate) fn new(to: Endpoint, delay_ns: u64) -> Leg {
        Leg {
            to,
            delay_ns,
            detected: true,
            detected_at: SimTime::ZERO,
            faulty: false,
            faults: LegFaults::default(),
            signal: true,
            up_since: SimTime::ZERO,
            last_up: None,
        }
    }

    /// Whether the leg carries a signal.
    pub(crate) fn signal(&self) -> bool {
        self.signal
    }

    /// Sets or removes the signal.
    pub(crate) fn set_signal(&mut self, up: bool, now: SimTime) {
        if up && !self.signal {
            self.up_since = now;
        } else if !up && self.signal {
            self.last_up = Some((self.up_since, now));
        }
        self.signal = up;
    }

    /// Sets the faults.
    pub(crate) fn set_faults(&mut self, change: impl FnOnce(&mut LegFaults)) {
        change(&mut self.faults);
        self.refresh_faulty();
    }

    /// Updates whether any fault is left.
    pub(crate) fn refresh_faulty(&mut self) {
        let LegFaults { drop, duplicate, corrupt, symbol_errors, delay, delay_by: _, blocked } = self.faults;
        self.faulty = blocked || [drop, duplicate, corrupt, symbol_errors, delay].iter().any(|left| *left > 0);
    }

    /// Frames with the first bit arriving at this time or later arrive completely, unless something changes. `None` if
    /// there is no signal or a fault is set.
    pub(crate) fn steady_since(&self) -> Option<SimTime> {
        let steady = self.signal && self.detected && !self.faulty;
        steady.then(|| SimTime(self.up_since.0.saturating_add(self.delay_ns)).max(self.detected_at))
    }

    /// Delivery of a frame whose first bit was due at the far end at `first_out` and whose last bit is due now: the leg
    /// must have carried a signal from the entry of the first bit to the exit of the last bit.
    pub(crate) fn delivery(&self, first_out: SimTime) -> Delivery {
        let first_in = first_out.back_ns(self.delay_ns);
        if self.signal && self.up_since <= first_in {
            return Delivery::Arrives;
        }
        match self.last_up {
            Some((up, down)) if up <= first_in && down > first_out => Delivery::Truncated { seen: down - first_out },
            _ => Delivery::Lost,
        }
    }
}

/// Default propagation delay of a cable: 10 m at 5 ns per metre (protocol 1.3).
pub const DEFAULT_CABLE_DELAY: Duration = Duration::from_nanos(50);

#[cfg(test)]
mod tests {
    use super::*;

    const WIRE: u64 = 5_760;

    fn leg() -> Leg {
        Leg::new(Endpoint::Host(HostLink::Main), 500)
    }

    #[test]
    fn a_frame_that_enters_before_the_cut_and_leaves_after_it_is_lost() {
        let mut leg = leg();
        leg.set_signal(false, SimTime(100_000));
        assert_eq!(leg.delivery(SimTime(100_000)), Delivery::Lost);
        assert_eq!(leg.delivery(SimTime(105759 - WIRE)), Delivery::Truncated { seen: Duration::from_nanos(1) });
        assert_eq!(leg.delivery(SimTime(100001 - WIRE)), Delivery::Truncated { seen: Duration::from_nanos(5_759) });
    }

    #[test]
    fn a_frame_into_a_cut_cable_is_lost_even_if_it_is_repaired_meanwhile() {
        let mut leg = leg();
        leg.set_signal(false, SimTime(100_000));
        leg.set_signal(true, SimTime(200_000));
        assert_eq!(leg.delivery(SimTime(206259 - WIRE)), Delivery::Lost);
        assert_eq!(leg.delivery(SimTime(206260 - WIRE)), Delivery::Arrives);
    }

    #[test]
    fn a_cut_and_a_repair_within_one_frame_still_truncate_it() {
        let mut leg = leg();
        leg.set_signal(false, SimTime(100_000));
        leg.set_signal(true, SimTime(100_010));
        assert_eq!(leg.delivery(SimTime(104000 - WIRE)), Delivery::Truncated { seen: Duration::from_nanos(1_760) });
    }
}
