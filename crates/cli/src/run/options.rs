//! The options of `ringcat run`.

use std::time::Duration;

use clap::Args;

use super::declared::DeclarationArguments;
use super::junction::{self, Junctions, junctions};
use super::services::ServiceArguments;
use crate::access::AccessArguments;
use crate::descriptions::EsiArgument;
use crate::resend::ResendArgument;
use crate::times::time;
use crate::under_way::UnderWayArgument;

/// How to read what it prints.
const SUMMARY_HELP: &str = "\
All outputs stay zero. Watchdogs, process data and mailboxes are set up as the
EEPROM (SII) of each SubDevice says; with --eni or --network as the file says,
and outputs as --set does.

Ctrl-C ends it in order: outputs zero, all SubDevices to INIT; so do SIGTERM and
SIGHUP. Exit status 0: all reached OP and stayed there, every cycle was
complete, with two interfaces the ring is closed, and all clocks are locked
where there are any. Otherwise 1, and the last line gives the reasons.

Distributed clocks are in use with --clocks, or with any of --phase,
--bus-shift, --reference, --estimate-delays and --sync; --for then counts from
their lock. SubDevices with SYNC signals wait for it before OP. `ringcat clocks`
shows more about clocks.

The summary distinguishes three things:
  this machine  wake-ups that came late, and cycles that were left out for that.
                The cable is not the cause: try --priority 80, a --cpu of its
                own, a real-time kernel
  the wire      frames that did not come back in time: missing, too late or
                damaged, each counted once. Causes are cables, plugs, power,
                other MainDevices; a simulator on a busy computer sends too late
  round trips   from sending a frame to the arrival of each of its copies at the
                interface, by the kernel's receive time: the rest of the cycle
                is free";

/// Options of `ringcat run`.
#[derive(Args, Debug)]
#[command(after_long_help = SUMMARY_HELP)]
pub struct RunArguments {
    #[command(flatten)]
    pub access: AccessArguments,
    #[command(flatten)]
    pub declared: DeclarationArguments,
    #[command(flatten)]
    pub under_way: UnderWayArgument,
    #[command(flatten)]
    pub resend: ResendArgument,
    /// How long to exchange process data in OP, such as 10s; until Ctrl-C by default
    #[arg(long = "for", value_name = "TIME", value_parser = time, help_heading = "Cycle")]
    pub lasts: Option<Duration>,
    /// Limit for all SubDevices to reach OP, and for all clocks to lock
    ///
    /// When it has passed, everything is stopped and the command fails.
    #[arg(long, value_name = "TIME", default_value = "60s", value_parser = time, help_heading = "Cycle")]
    pub within: Duration,
    #[arg(
        long,
        value_name = "MODE",
        default_value = "disabled",
        value_parser = junctions,
        help = junction::HELP,
        long_help = junction::LONG_HELP,
        help_heading = "Segment"
    )]
    pub junction: Junctions,
    /// Search swapped IN and OUT by taking the redundant interface down
    ///
    /// Briefly, whenever cables have changed. Needs the permission to configure interfaces (CAP_NET_ADMIN).
    #[arg(long, help_heading = "Segment")]
    pub enhanced_line_crossed: bool,
    #[command(flatten)]
    pub services: ServiceArguments,
    /// Take the time of each job of a cycle: receive, process, work, queue, send
    ///
    /// The clock is read before and after each job, which takes some time itself. Times count from the first cycle.
    #[arg(long, help_heading = "Output")]
    pub jobs: bool,
    /// Print every event, however often it comes
    ///
    /// Without it, frequent events of one kind are counted after the first twenty.
    #[arg(long, help_heading = "Output")]
    pub all_events: bool,
    #[command(flatten)]
    pub esi: EsiArgument,
}
