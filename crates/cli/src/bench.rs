//! `ringcat bench`: figures of this machine, its interfaces and this MainDevice, measured where they are to be used.
//!
//! `echo` is the other end of `round-trip`; the other measurements need SubDevices, or `ringcat sim`. Each prints lines
//! of a name, a colon and a figure with its unit.

mod cycles;
mod echo;
mod rate;
mod round_trip;

use clap::{Args, Subcommand};

use crate::interfaces::Failure;
use crate::verdict::Verdict;

/// Options of `ringcat bench`.
#[derive(Args, Debug)]
pub struct BenchArguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Sends every EtherCAT frame back as a segment of one SubDevice would: the other end for `round-trip`.
    Echo(echo::EchoArguments),
    /// One process-data cycle of one frame, against a bare client that only sends and receives, with `echo` as the
    /// other end of the cable. Blocks of both alternate.
    RoundTrip(round_trip::RoundTripArguments),
    /// Brings all SubDevices to OP, then exchanges process data as fast as the frames come back, then stops.
    Cycles(cycles::CyclesArguments),
    /// Brings all SubDevices to OP, then looks for the shortest cycle that can be kept.
    Rate(rate::RateArguments),
}

/// Runs a measurement. It has held where nothing was lost.
pub fn run(arguments: &BenchArguments) -> Result<Verdict, Failure> {
    match &arguments.what {
        What::Echo(arguments) => echo::run(arguments),
        What::RoundTrip(arguments) => round_trip::run(arguments),
        What::Cycles(arguments) => cycles::run(arguments),
        What::Rate(arguments) => rate::run(arguments),
    }
}

/// The value at a part of sorted times, in microseconds.
fn quantile_us(sorted_ns: &[u64], percent: usize) -> f64 {
    let at = (sorted_ns.len() * percent / 100).min(sorted_ns.len().saturating_sub(1));
    sorted_ns.get(at).map_or(0.0, |ns| *ns as f64 / 1e3)
}

#[cfg(test)]
mod tests {
    use super::quantile_us;

    // covers: bench
    #[test]
    fn quantiles_stay_within_the_times() {
        assert_eq!(quantile_us(&[], 50), 0.0);
        assert_eq!(quantile_us(&[1_000, 2_000, 3_000], 0), 1.0);
        assert_eq!(quantile_us(&[1_000, 2_000, 3_000], 50), 2.0);
        assert_eq!(quantile_us(&[1_000, 2_000, 3_000], 100), 3.0);
    }
}
