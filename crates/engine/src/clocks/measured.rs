//! The result of a measurement of the segment, for this set-up of the clocks and for later ones.
//!
//! A later set-up, also in another process, needs no measurement if the segment is the same: the same SubDevices and
//! connections, and one latched frame that has taken as long as before from port to port.

use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;

use super::delay::Passage;
use super::delays::Delays;
use super::known_cable::KnownCable;
use super::measurement::Latched;
use super::wiring::Wiring;

/// Times between two ports of a SubDevice that one frame each has latched differ by no more than this on the same
/// cables: each of the four latched times is exact to some tens of nanoseconds. A cable that was replaced by another
/// one is noticed from 20 m of difference on.
const SAME_NS: u32 = 200;

/// The result of a measurement of the segment.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Measured {
    /// Station addresses by position.
    pub stations: Vec<StationAddress>,
    /// Delays by position.
    pub delays: Delays,
    /// Drift of each clock against the reference (positive: faster), by position.
    pub drift_ppb: Vec<Option<i64>>,
    /// The times of frames through the SubDevices that the delays contain, by position.
    pub passages: Vec<Passage>,
    /// The connections.
    pub wiring: Wiring,
    /// Times of the ports after that of the processing unit as one frame latched them, by position.
    pub port_times: Vec<Option<[u32; 4]>>,
}

/// What is known of the clocks of a segment, for their next set-up.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct KnownClocks {
    /// The last measurement.
    pub measured: Measured,
    /// Cable times.
    pub cables: Vec<KnownCable>,
    /// SubDevices that are set to latch frames that enter from behind.
    pub backwards: Vec<StationAddress>,
}

/// Times of the ports after that of the processing unit.
pub fn port_times(latched: &Latched) -> [u32; 4] {
    latched.ports.map(|time| time.wrapping_sub(latched.unit as u32))
}

/// Whether two frames have taken as long from port to port of a SubDevice, at the ports at which frames come in.
fn are_same(before: Option<[u32; 4]>, now: Option<Latched>, arrives: [bool; 4]) -> bool {
    match (before, now) {
        (Some(before), Some(now)) => {
            let mut ports = before.into_iter().zip(port_times(&now)).zip(arrives).filter(|(_, arrives)| *arrives);
            ports.all(|((before, now), _)| now.wrapping_sub(before).wrapping_add(SAME_NS) <= 2 * SAME_NS)
        }
        (before, now) => before.is_none() && now.is_none(),
    }
}

impl Measured {
    /// Whether the segment is the one that was measured: `latched` has the times of one frame, by position.
    pub fn is_of(
        &self,
        stations: &[StationAddress],
        wiring: &Wiring,
        passages: &[Passage],
        latched: &[Option<Latched>],
    ) -> bool {
        if (stations, wiring, passages) != (&self.stations[..], &self.wiring, &self.passages[..]) {
            return false;
        }
        let (arrivals, _) = wiring.arrival_ports();
        let count = self.port_times.len();
        let is_same = |at: usize| are_same(self.port_times[at], latched[at], arrivals[at]);
        latched.len() == count && arrivals.len() == count && (0..count).all(is_same)
    }

    /// The same, with drifts against another reference.
    #[must_use]
    pub fn referred_to(mut self, reference: Option<StationAddress>) -> Measured {
        let position = self.stations.iter().position(|station| Some(*station) == reference);
        let own = position.and_then(|at| self.drift_ppb.get(at).copied().flatten()).unwrap_or(0);
        self.drift_ppb.iter_mut().flatten().for_each(|drift| *drift = drift.saturating_sub(own));
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology::PortOf;

    fn line_of_two() -> (Measured, Vec<Option<Latched>>) {
        let mut wiring = Wiring::default();
        let (near, far) = (PortOf { node: 0, port: 1 }, PortOf { node: 1, port: 0 });
        wiring.far = alloc::vec![[None, Some(far), None, None], [Some(near), None, None, None]];
        wiring.entries = [Some(PortOf { node: 0, port: 0 }), None];
        let latched = [Latched { ports: [1_000, 2_200, 7, 9], unit: 1_040 }, Latched { ports: [500; 4], unit: 540 }];
        let measured = Measured {
            stations: alloc::vec![StationAddress(1), StationAddress(2)],
            passages: alloc::vec![Passage::default(); 2],
            drift_ppb: alloc::vec![Some(0), Some(4_000)],
            wiring,
            port_times: latched.iter().map(|latched| Some(port_times(latched))).collect(),
            ..Measured::default()
        };
        (measured, latched.into_iter().map(Some).collect())
    }

    // covers: dc-delays
    #[test]
    fn a_measurement_is_of_a_segment_with_the_same_times_from_port_to_port() {
        let (measured, latched) = line_of_two();
        let is_of = |latched: &[Option<Latched>]| {
            measured.is_of(&measured.stations, &measured.wiring, &measured.passages, latched)
        };
        assert!(is_of(&latched));
        for (added, is_same) in [(150, true), (0_u32.wrapping_sub(150), true), (400, false), (50_000, false)] {
            // All clocks go on; the way from port 1 to the next SubDevice and back has another length.
            let mut now = latched.clone();
            for latched in now.iter_mut().flatten() {
                latched.unit += 0xFFFF_FF00;
                latched.ports = latched.ports.map(|time| time.wrapping_add(0xFFFF_FF00));
            }
            let first = now[0].as_mut().expect("it has a clock");
            first.ports[1] = first.ports[1].wrapping_add(added);
            // No frame comes in at port 2.
            first.ports[2] = first.ports[2].wrapping_add(77_777);
            assert_eq!(is_of(&now), is_same, "{added} ns");
        }
        assert!(!is_of(&[latched[0], None]) && !is_of(&latched[..1]));
    }

    // covers: dc-delays
    #[test]
    fn drifts_are_referred_to_another_clock() {
        let (measured, _) = line_of_two();
        assert_eq!(measured.clone().referred_to(Some(StationAddress(2))).drift_ppb, [Some(-4_000), Some(0)]);
        assert_eq!(measured.clone().referred_to(None), measured);
    }
}
