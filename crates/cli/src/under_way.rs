//! The option `--under-way`: cycles whose frames are out at once.

use clap::Args;
use ringcat::MAX_UNDER_WAY;

use crate::numbers::number;

/// The option.
#[derive(Args, Clone, Copy, Debug)]
pub struct UnderWayArgument {
    /// Cycles that may be under way at once
    ///
    /// For a cycle time that is shorter than the way of a frame through segment and host. Inputs are then as many
    /// cycles old as their way takes.
    #[arg(
        long,
        value_name = "CYCLES",
        default_value = "1",
        help_heading = "Cycle",
        value_parser = number(1..=MAX_UNDER_WAY, 2)
    )]
    pub under_way: u8,
}
