//! `ringcat bench`: figures of this machine, its interfaces and this MainDevice, measured where they are to be used.
//!
//! `echo` is the other end of `round-trip`; the other measurements need SubDevices, or `ringcat sim`. Each prints lines
//! of a name, a colon and a figure with its unit.

mod cycles;
mod echo;
mod quantile;
mod rate;
mod round_trip;

use clap::{Args, Subcommand};

use crate::failure::Failure;
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
