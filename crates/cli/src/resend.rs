//! The option `--resend`: lost frames are sent again within their cycle.

use clap::{Args, ValueEnum};
use ringcat::Declaration;

/// When lost frames are sent again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Resend {
    /// A lost frame costs its cycle
    Never,
    /// A lost frame leaves again within its cycle
    Always,
}

/// The option.
#[derive(Args, Clone, Copy, Debug)]
pub struct ResendArgument {
    /// Send lost frames again within their cycle, such as always; or never
    ///
    /// Works with one cycle under way (--under-way 1) and where the cycle has time for two round trips. SubDevices that
    /// take each write of outputs for an event, or have a SyncManager with one buffer, receive them once in a cycle;
    /// they are listed with the reason.
    #[arg(
        long,
        value_name = "WHEN",
        default_value = "never",
        value_enum,
        hide_possible_values = true,
        help_heading = "Cycle"
    )]
    pub resend: Resend,
}

impl ResendArgument {
    /// The declaration with this choice for all domains.
    pub fn adapt(self, declaration: Declaration) -> Declaration {
        declaration.with_sends_again(self.resend == Resend::Always)
    }
}
