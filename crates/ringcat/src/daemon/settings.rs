//! Settings of a master as options of the MainDevice that drives it.

use ringcat_control::settings::BusSettings;
use ringcat_engine::info::{AliasSource, SiiAssignment};

use crate::main_device::Options;

/// Options of a program with the settings of the master: these have priority, since the knowledge that is handed over
/// was read with them.
pub fn options_with(settings: &BusSettings, options: &Options) -> Options {
    let alias_source = if settings.reads_alias_register { AliasSource::Register } else { AliasSource::Sii };
    let sii_assignment = if settings.assigns_sii { SiiAssignment::TowardsPreOp } else { SiiAssignment::Never };
    options.clone().with_alias_source(alias_source).with_sii_assignment(sii_assignment)
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon, c-interface
    #[test]
    fn settings_of_a_master_have_priority_over_options() {
        let mut settings = BusSettings::default();
        let options = Options::default().with_alias_source(AliasSource::Register);
        let of = |settings: &BusSettings| {
            let options = options_with(settings, &options);
            (options.alias_source, options.sii_assignment)
        };
        assert_eq!(of(&settings), (AliasSource::Sii, SiiAssignment::Never));
        (settings.reads_alias_register, settings.assigns_sii) = (true, true);
        assert_eq!(of(&settings), (AliasSource::Register, SiiAssignment::TowardsPreOp));
    }
}
