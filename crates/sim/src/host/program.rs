//! Programs that run on a host of a segment and react to received frames, such as a MainDevice that only forwards.
//!
//! A program is a part of the run: the network calls it in virtual time, so its reaction does not depend on what
//! advances the time. Other programs, such as a MainDevice with cycles, use the interfaces from outside.

use core::any::Any;
use core::fmt;
use core::time::Duration;

use crate::cable::HostLink;
use crate::host::Received;
use crate::network::Random;
use crate::time::SimTime;

/// The interfaces of a host, for its program.
pub trait HostPorts {
    /// The main and the redundant interface.
    fn links(&self) -> [HostLink; 2];

    /// The time.
    fn now(&self) -> SimTime;

    /// The next frame received on an interface.
    fn receive(&mut self, link: HostLink) -> Option<Received>;

    /// Sends a frame, without FCS.
    fn send(&mut self, link: HostLink, bytes: &[u8]);

    /// Returns the buffer of a received frame.
    fn give_back(&mut self, bytes: Vec<u8>);

    /// Whether an interface has detected a link.
    fn carrier(&self, link: HostLink) -> bool;
}

/// A program that reacts to received frames.
pub trait HostProgram: Any + fmt::Debug + Send {
    /// Frames have arrived, the first one a turn-around time ago.
    fn work(&mut self, ports: &mut dyn HostPorts);

    /// The host has got power: the program begins anew.
    fn restart(&mut self);
}

/// Time from the arrival of a frame to the reaction of a program. Frames that arrive meanwhile are handled with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TurnAround {
    /// Shortest time.
    pub least: Duration,
    /// Longest time; between both it is random, by the seed of the segment.
    pub most: Duration,
}

impl TurnAround {
    /// The same time for each frame.
    pub const fn fixed(time: Duration) -> TurnAround {
        TurnAround { least: time, most: time }
    }
}

impl Default for TurnAround {
    /// 6 us, as in the trace of protocol 9.8.
    fn default() -> TurnAround {
        TurnAround::fixed(Duration::from_micros(6))
    }
}

/// The turn-around times of a program, one after the other.
#[derive(Clone, Debug)]
pub struct TurnArounds {
    of: TurnAround,
    random: Random,
}

impl TurnArounds {
    /// Random ones of this seed.
    pub fn new(of: TurnAround, seed: u64) -> TurnArounds {
        TurnArounds { of, random: Random::new(seed) }
    }

    /// From now on others.
    pub fn set(&mut self, of: TurnAround) {
        self.of = of;
    }

    /// The next one.
    pub fn next_time(&mut self) -> Duration {
        let TurnAround { least, most } = self.of;
        let spread = usize::try_from(most.saturating_sub(least).as_nanos()).unwrap_or(usize::MAX);
        least + Duration::from_nanos(self.random.below(spread.saturating_add(1)) as u64)
    }
}

/// A program that forwards nothing: what the host receives is lost.
#[derive(Clone, Copy, Debug, Default)]
pub struct Deaf;

impl HostProgram for Deaf {
    fn work(&mut self, ports: &mut dyn HostPorts) {
        for link in ports.links() {
            while let Some(received) = ports.receive(link) {
                ports.give_back(received.bytes);
            }
        }
    }

    fn restart(&mut self) {}
}
