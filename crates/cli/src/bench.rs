//! `ringcat bench`: figures of this machine, its interfaces and this MainDevice, measured where they are to be used.
//!
//! `echo` is the other end of `round-trip`; `cycles` and `rate` need SubDevices, or `ringcat sim`. Each prints lines of
//! a name, a colon and a figure with its unit.

mod cycles;
mod echo;
mod quantile;
mod rate;
mod round_trip;

use clap::{Args, Subcommand};

use crate::failure::Failure;
use crate::verdict::Report;

/// Options of `ringcat bench`.
#[derive(Args, Debug)]
pub struct BenchArguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Sends every EtherCAT frame back: the other end for `round-trip`
    ///
    /// As a segment of one SubDevice would send it back.
    Echo(echo::EchoArguments),
    /// Measures a process-data cycle against a bare client
    ///
    /// The bare client only sends and receives one frame; blocks of both alternate. `echo` runs at the other end of the
    /// cable.
    RoundTrip(round_trip::RoundTripArguments),
    /// Measures start-up, and cycles as fast as the frames come back
    ///
    /// Brings all SubDevices to OP, exchanges process data as fast as the frames come back, then stops.
    Cycles(cycles::CyclesArguments),
    /// Finds the shortest cycle that can be kept
    ///
    /// Brings all SubDevices to OP, then tries ever shorter cycles.
    Rate(rate::RateArguments),
}

impl BenchArguments {
    /// The command with its measurement.
    pub fn name(&self) -> &'static str {
        match self.what {
            What::Echo(_) => "bench echo",
            What::RoundTrip(_) => "bench round-trip",
            What::Cycles(_) => "bench cycles",
            What::Rate(_) => "bench rate",
        }
    }
}

/// Runs a measurement. It has held where nothing was lost.
pub fn run(arguments: &BenchArguments) -> Result<Report, Failure> {
    match &arguments.what {
        What::Echo(arguments) => echo::run(arguments),
        What::RoundTrip(arguments) => round_trip::run(arguments),
        What::Cycles(arguments) => cycles::run(arguments),
        What::Rate(arguments) => rate::run(arguments),
    }
}
