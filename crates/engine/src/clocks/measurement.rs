//! The mean of several measurements of receive times, corrected for the drift of each clock (protocol 7.1).
//!
//! A SubDevice measures times between its ports on its own clock. In a line of 200 SubDevices the frame returns to the
//! first SubDevice after 200 us; two clocks that differ by 100 ppm differ by 20 ns after this time. The drift follows
//! from the progress of each clock from the first measurement to the last.

use alloc::vec::Vec;

use super::delay::MOST_NS;
use super::wiring::Wiring;
use super::{FRACTION, PortTimes};
use crate::order::InOrder;

/// Receive times that one SubDevice latched for one frame, on its local clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Latched {
    /// Registers DC_RECEIVE_TIME of port 0..3.
    pub ports: [u32; 4],
    /// Register DC_RECEIVE_TIME_EPU; the low half if the clock has 32 bits.
    pub unit: u64,
}

/// Times of one port that differ by more than this are not from the same path: receive times are exact to some tens of
/// nanoseconds, and frames are at least microseconds apart.
const SAME_NS: i64 = 500;
/// Clocks differ by at most this part of the elapsed time (1/1,000).
const MOST_DRIFT: i64 = 1_000;

/// A latched time that does not fit the other measurements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Disagreement {
    /// Position of the SubDevice.
    pub node: usize,
    /// The port; `None` for the progress of its clock between measurements.
    pub port: Option<u8>,
    /// Time by the other measurements, in nanoseconds.
    pub expected_ns: i64,
    /// Latched time, in nanoseconds.
    pub got_ns: i64,
}

impl Disagreement {
    /// Whether the expected time is possible for a frame.
    pub fn is_possible(&self) -> bool {
        (0..=MOST_NS).contains(&self.expected_ns) || self.port.is_none()
    }
}

/// Several measurements of all SubDevices.
#[derive(Clone, Debug)]
pub struct Measurements {
    entries: Vec<u8>,
    /// Ports at which the frame comes in.
    arrivals: Vec<[bool; 4]>,
    /// Copy of the frame that each SubDevice latches: 0 for the main link, 1 for the redundant link. The copies are
    /// sent one after the other.
    trees: Vec<usize>,
    samples: Vec<Vec<Option<Latched>>>,
}

/// The latched times of a SubDevice in all measurements, if no measurement lacks it.
struct Series<'a> {
    of: &'a Measurements,
    node: usize,
}

impl Series<'_> {
    fn all(&self) -> impl Iterator<Item = Latched> {
        self.of.samples.iter().filter_map(|sample| sample.get(self.node).copied().flatten())
    }

    /// Progress of its clock since the first measurement.
    fn advances(&self) -> impl Iterator<Item = i64> {
        let first = self.all().next().map_or(0, |latched| latched.unit as u32);
        self.all().map(move |latched| i64::from((latched.unit as u32).wrapping_sub(first)))
    }

    fn passed(&self) -> i64 {
        self.advances().last().unwrap_or(0)
    }

    /// Times of a port after that of the port of entry.
    fn after_entry(&self, port: usize) -> impl Iterator<Item = i64> {
        let entry = usize::from(self.of.entries.get(self.node).copied().unwrap_or(0) & 3);
        self.all().map(move |Latched { ports, .. }| i64::from(ports[port].wrapping_sub(ports[entry]) as i32))
    }
}

impl Measurements {
    /// No measurements yet, of the SubDevices of this wiring.
    pub fn new(wiring: &Wiring) -> Measurements {
        let (arrivals, trees) = wiring.arrival_ports();
        Measurements { entries: wiring.entry_ports(), arrivals, trees, samples: Vec::new() }
    }

    /// Adds a measurement: the times that each SubDevice latched for the same frame. A SubDevice that is missing in any
    /// measurement counts as without a clock. All measurements must be taken within two seconds (the 32-bit times
    /// wrap).
    pub fn add(&mut self, latched: Vec<Option<Latched>>) {
        self.samples.push(latched);
    }

    /// Number of measurements.
    pub fn count(&self) -> u32 {
        self.samples.len() as u32
    }

    fn series(&self, node: usize) -> Option<Series<'_>> {
        let is_there = |sample: &Vec<Option<Latched>>| sample.get(node).is_some_and(Option::is_some);
        (!self.samples.is_empty() && self.samples.iter().all(is_there)).then_some(Series { of: self, node })
    }

    /// A latched time that does not fit the other measurements: a port with another time than usual, or a clock with
    /// another progress than the reference clock, so that it has not latched the same frame.
    pub fn disagreement(&self, reference: usize) -> Option<Disagreement> {
        let nodes = || (0..self.entries.len()).filter_map(|node| self.series(node));
        nodes().find_map(|series| self.odd_port(&series)).or_else(|| {
            nodes().find_map(|series| {
                let reference = self.reference_for(series.node, reference)?;
                let mut both = series.advances().zip(reference.advances());
                let (got_ns, expected_ns) =
                    both.find(|(own, passed)| (own - passed).abs() > SAME_NS + passed / MOST_DRIFT)?;
                Some(Disagreement { node: series.node, port: None, expected_ns, got_ns })
            })
        })
    }

    /// The clock with which that of a SubDevice is compared: the reference clock, or the first clock that latches the
    /// same copy.
    fn reference_for(&self, node: usize, reference: usize) -> Option<Series<'_>> {
        let tree = self.trees.get(node);
        let first =
            || (0..self.trees.len()).find(|other| self.trees.get(*other) == tree && self.series(*other).is_some());
        let own =
            Some(reference).filter(|reference| self.trees.get(*reference) == tree && self.series(*reference).is_some());
        self.series(own.or_else(first)?)
    }

    fn odd_port(&self, series: &Series<'_>) -> Option<Disagreement> {
        let arrivals = self.arrivals.get(series.node)?;
        (0..4).filter(|port| arrivals[*port]).find_map(|port| {
            let mut sorted: Vec<i64> = series.after_entry(port).collect();
            sorted.put_in_order();
            let expected_ns = sorted[sorted.len() / 2];
            let got_ns = series.after_entry(port).find(|time| (time - expected_ns).abs() > SAME_NS)?;
            Some(Disagreement { node: series.node, port: Some(port as u8), expected_ns, got_ns })
        })
    }

    /// Drift of each clock relative to the reference clock, in parts per billion; positive: faster.
    pub fn drift_ppb(&self, reference: usize) -> Vec<Option<i64>> {
        let passed = self.passed(reference);
        let of = |series: Series<'_>| {
            passed.map(|passed| ((i128::from(series.passed() - passed) * 1_000_000_000) / i128::from(passed)) as i64)
        };
        (0..self.entries.len()).map(|node| self.series(node).and_then(of)).collect()
    }

    fn passed(&self, node: usize) -> Option<i64> {
        Some(self.series(node)?.passed()).filter(|passed| *passed > 0)
    }

    /// Mean times in units of the reference clock, or of the first clock that latches the same copy, with [`FRACTION`].
    pub fn mean(&self, reference: usize) -> Vec<Option<PortTimes>> {
        let count = i128::from(self.count().max(1));
        let of = |series: Series<'_>| {
            let own = series.passed();
            let passed = self.reference_for(series.node, reference).map(|reference| reference.passed());
            let (up, down) = match passed {
                Some(passed) if own > 0 && passed > 0 => (i128::from(passed), i128::from(own)),
                _ => (1, 1),
            };
            let total = |port: usize| i128::from(series.after_entry(port).sum::<i64>());
            PortTimes([0, 1, 2, 3].map(|port| ((total(port) << FRACTION) * up / (count * down)) as i64))
        };
        (0..self.entries.len()).map(|node| self.series(node).map(of)).collect()
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec;

    use super::*;

    fn latched(unit: u64, back: u32) -> Option<Latched> {
        Some(Latched { ports: [unit as u32, (unit as u32).wrapping_add(back), 0, 0], unit })
    }

    fn empty(count: usize) -> Measurements {
        let arrivals = vec![[true, true, false, false]; count];
        Measurements { entries: vec![0; count], arrivals, trees: vec![0; count], samples: Vec::new() }
    }

    fn of<const N: usize>(count: usize, samples: [[Option<Latched>; N]; 2]) -> Measurements {
        let mut measurements = empty(count);
        samples.into_iter().for_each(|sample| measurements.add(sample.to_vec()));
        measurements
    }

    // covers: 7.1, dc-delays
    #[test]
    fn the_mean_is_in_units_of_the_reference_clock_across_wraps() {
        // The second clock runs 100 ppm fast and wraps between the measurements.
        let first = [latched(1_000, 200_000), latched(0xFFFF_FF00, 100_010)];
        let second = [latched(10_001_000, 200_001), latched(0x1_0000_0000 + 10_001_000 - 256, 100_010)];
        let measurements = of(2, [first, second]);
        assert_eq!(measurements.drift_ppb(0), [Some(0), Some(100_000)]);
        let mean = measurements.mean(0);
        assert_eq!(mean[0].unwrap().0[1], 200_000 * 256 + 128);
        assert_eq!(mean[1].unwrap().0[1] >> FRACTION, 100_000);
        assert_eq!(measurements.disagreement(0), None);
    }

    #[test]
    fn a_subdevice_missing_in_one_measurement_counts_as_without_a_clock() {
        let measurements =
            of(3, [[latched(1_000, 5), None, latched(7, 5)], [latched(2_000, 5), latched(2_000, 5), None]]);
        assert_eq!(measurements.mean(0).iter().map(Option::is_some).collect::<Vec<_>>(), [true, false, false]);
        assert_eq!(measurements.disagreement(0), None);
        assert_eq!(empty(1).mean(3), [None]);
    }

    // covers: 7.1, dc-remeasure
    #[test]
    fn a_port_that_latched_another_frame_and_a_clock_that_latched_none_disagree() {
        let first = [latched(1_000, 700), latched(5_000, 300)];
        let mut measurements = of(2, [first, [latched(2_000_000, 690), latched(2_004_100, 320)]]);
        assert_eq!(measurements.disagreement(0), None);
        let mut spoiled = measurements.clone();
        spoiled.add(vec![latched(4_000_000, 700), latched(4_004_200, 7_020)]);
        let odd = Disagreement { node: 1, port: Some(1), expected_ns: 320, got_ns: 7_020 };
        assert_eq!(spoiled.disagreement(0), Some(odd));
        // The copies are sent one after the other: SubDevices on the other link are compared with a clock on that link.
        let mut apart = Measurements { trees: vec![0, 1], ..measurements.clone() };
        apart.add(vec![latched(4_000_000, 700), latched(4_054_100, 320)]);
        assert_eq!(apart.disagreement(0), None);
        measurements.add(vec![latched(4_000_000, 700), latched(2_004_100, 320)]);
        let odd = Disagreement { node: 1, port: None, expected_ns: 3_999_000, got_ns: 1_999_100 };
        assert_eq!(measurements.disagreement(0), Some(odd));
    }
}
