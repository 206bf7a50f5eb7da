//! The mean of several measurements of receive times, corrected for the drift of each clock (facts 7.1).
//!
//! Receive times of a SubDevice are differences on its own clock. In a line of 200 SubDevices the first one waits for
//! 200 us until the frame is back, in which clocks that differ by 100 ppm come apart by 20 ns. How much they differ shows
//! in how far each got from the first measurement to the last.

use alloc::vec;
use alloc::vec::Vec;

use super::{FRACTION, PortTimes};

/// What one SubDevice has latched of one frame, on its local clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Latched {
    /// Registers DC_RECEIVE_TIME of port 0..3.
    pub ports: [u32; 4],
    /// Register DC_RECEIVE_TIME_EPU; its low half where the clock has 32 bits.
    pub unit: u64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    /// Times after that of the port of entry.
    ports: [i64; 4],
    first: u32,
    last: u32,
}

/// Several measurements of all SubDevices.
#[derive(Clone, Debug)]
pub struct Measurements {
    entries: Vec<u8>,
    sums: Vec<Option<Sum>>,
    count: u32,
}

impl Measurements {
    /// Of SubDevices with these ports of entry.
    pub fn new(entries: Vec<u8>) -> Measurements {
        Measurements { sums: vec![None; entries.len()], entries, count: 0 }
    }

    /// Adds a measurement: what each SubDevice has latched of the same frame. One that is missing here, or was before,
    /// counts as one without a clock. All must be taken within two seconds.
    pub fn add(&mut self, latched: &[Option<Latched>]) {
        for (number, (sum, entry)) in self.sums.iter_mut().zip(&self.entries).enumerate() {
            let Some(latched) = latched.get(number).copied().flatten() else {
                *sum = None;
                continue;
            };
            let unit = latched.unit as u32;
            if self.count == 0 {
                *sum = Some(Sum { ports: [0; 4], first: unit, last: unit });
            }
            let Some(sum) = sum else { continue };
            let from = latched.ports[usize::from(*entry & 3)];
            for (total, port) in sum.ports.iter_mut().zip(latched.ports) {
                *total += i64::from(port.wrapping_sub(from) as i32);
            }
            sum.last = unit;
        }
        self.count += 1;
    }

    /// How many measurements there are.
    pub const fn count(&self) -> u32 {
        self.count
    }

    /// How much faster than the reference's each clock runs, in parts per billion.
    pub fn drift_ppb(&self, reference: usize) -> Vec<Option<i64>> {
        let passed = self.passed(reference);
        let of = |sum: &Sum| {
            let own = i64::from(sum.last.wrapping_sub(sum.first));
            passed.map(|passed| ((i128::from(own - passed) * 1_000_000_000) / i128::from(passed)) as i64)
        };
        self.sums.iter().map(|sum| sum.as_ref().and_then(of)).collect()
    }

    fn passed(&self, node: usize) -> Option<i64> {
        let sum = self.sums.get(node)?.as_ref()?;
        Some(i64::from(sum.last.wrapping_sub(sum.first))).filter(|passed| *passed > 0)
    }

    /// Mean times on the clock of the reference, with [`FRACTION`].
    pub fn mean(&self, reference: usize) -> Vec<Option<PortTimes>> {
        let passed = self.passed(reference);
        let count = i128::from(self.count.max(1));
        let of = |sum: &Sum| {
            let own = i64::from(sum.last.wrapping_sub(sum.first));
            let (up, down) = match passed {
                Some(passed) if own > 0 => (i128::from(passed), i128::from(own)),
                _ => (1, 1),
            };
            PortTimes(sum.ports.map(|total| ((i128::from(total) << FRACTION) * up / (count * down)) as i64))
        };
        self.sums.iter().map(|sum| sum.as_ref().map(of)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn latched(unit: u64, back: u32) -> Option<Latched> {
        Some(Latched { ports: [unit as u32, (unit as u32).wrapping_add(back), 0, 0], unit })
    }

    #[test]
    fn the_mean_is_on_the_clock_of_the_reference_and_survives_wraps_facts_7_1() {
        let mut measurements = Measurements::new(vec![0, 0]);
        // The second clock runs 100 ppm fast and wraps between the measurements.
        measurements.add(&[latched(1_000, 200_000), latched(0xFFFF_FF00, 100_010)]);
        measurements.add(&[latched(10_001_000, 200_001), latched(0x1_0000_0000 + 10_001_000 - 256, 100_010)]);
        assert_eq!(measurements.drift_ppb(0), [Some(0), Some(100_000)]);
        let mean = measurements.mean(0);
        assert_eq!(mean[0].unwrap().0[1], 200_000 * 256 + 128);
        assert_eq!(mean[1].unwrap().0[1] >> FRACTION, 100_000);
    }

    #[test]
    fn who_misses_one_measurement_counts_as_without_a_clock() {
        let mut measurements = Measurements::new(vec![0, 0, 0]);
        measurements.add(&[latched(1_000, 5), None, latched(7, 5)]);
        measurements.add(&[latched(2_000, 5), latched(2_000, 5), None]);
        assert_eq!(measurements.mean(0).iter().map(Option::is_some).collect::<Vec<_>>(), [true, false, false]);
        assert_eq!(Measurements::new(vec![0]).mean(3), [None]);
    }
}
