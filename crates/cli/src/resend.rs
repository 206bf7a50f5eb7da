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
    /// Send lost frames again within their cycle: always or never
    ///
    /// Works with one cycle under way (--under-way 1) and where the cycle has time for two round trips. SubDevices that
    /// take each write of outputs for an event, or have a SyncManager with one buffer, receive them once in a cycle;
    /// they are listed with the reason. Without this option, the setting of each domain in the network file is used;
    /// without a network file, never.
    #[arg(long, value_name = "WHEN", value_enum, hide_possible_values = true, help_heading = "Cycle")]
    pub resend: Option<Resend>,
}

impl ResendArgument {
    /// The declaration with this choice for all domains, or as it is without a choice.
    pub fn adapt(self, declaration: Declaration) -> Declaration {
        match self.resend {
            Some(resend) => declaration.with_sends_again(resend == Resend::Always),
            None => declaration,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use ringcat::automatic;

    use super::*;
    use crate::under_way::UnderWayArgument;

    /// `ringcat run --network` took the defaults of both options instead of the domains of the file.
    // covers: network-file
    #[test]
    fn without_an_option_a_domain_is_as_its_file_declares_it() {
        let file = automatic(&[], Duration::from_millis(1)).with_under_way(3).with_sends_again(true);
        let of = |under_way, resend| {
            let declaration = UnderWayArgument { under_way }.adapt(ResendArgument { resend }.adapt(file.clone()));
            (declaration.domains[0].under_way, declaration.domains[0].sends_again)
        };
        assert_eq!(of(None, None), (3, true));
        assert_eq!(of(Some(1), None), (1, true));
        assert_eq!(of(None, Some(Resend::Never)), (3, false));
    }
}
