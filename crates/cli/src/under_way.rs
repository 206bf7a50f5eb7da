//! The option `--under-way`: cycles whose frames are out at once.

use clap::Args;
use ringcat::{Declaration, MAX_UNDER_WAY};

use crate::numbers::number;

/// The option.
#[derive(Args, Clone, Copy, Debug)]
pub struct UnderWayArgument {
    /// Cycles that may be under way at once
    ///
    /// For a cycle time that is shorter than the way of a frame through segment and host. Inputs are then as many
    /// cycles old as their way takes. Without this option, the setting of each domain in the network file is used;
    /// without a network file, 1.
    #[arg(long, value_name = "CYCLES", help_heading = "Cycle", value_parser = number(1..=MAX_UNDER_WAY, 2))]
    pub under_way: Option<u8>,
}

impl UnderWayArgument {
    /// The declaration with this choice for all domains, or as it is without a choice.
    pub fn adapt(self, declaration: Declaration) -> Declaration {
        match self.under_way {
            Some(under_way) => declaration.with_under_way(under_way),
            None => declaration,
        }
    }
}
