//! Settings of a master, for the daemon and for applications, which get them with the bus.
//!
//! They are what the switches of `configure` in the manual of the IgH EtherCAT Master (table 9.1) decide, with its
//! defaults. Their names are those of variables, in the configuration of the daemon and in the environment of a program
//! that opens links itself.

mod debug_ring;
mod value;

use serde::{Deserialize, Serialize};

pub use debug_ring::DebugRing;
use value::yes_or_no;

/// Settings of a master.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct BusSettings {
    /// Vendor and product 0xFFFFFFFF of a declaration in C stand for any (`enable-wildcards`).
    pub has_wildcards: bool,
    /// An alias is that of register 0x0012, otherwise that of the SII (`enable-regalias`).
    pub reads_alias_register: bool,
    /// The EEPROM is assigned to the PDI while a SubDevice goes to PREOP (`enable-sii-assign`).
    pub assigns_sii: bool,
    /// Lines about working counters and lost datagrams of cyclic frames are printed (`enable-rt-syslog`).
    pub prints_cyclic_lines: bool,
    /// The last seconds before a fault are recorded (`enable-debug-ring`).
    pub debug_ring: DebugRing,
}

impl Default for BusSettings {
    fn default() -> BusSettings {
        BusSettings {
            has_wildcards: false,
            reads_alias_register: false,
            assigns_sii: false,
            prints_cyclic_lines: true,
            debug_ring: DebugRing::default(),
        }
    }
}

/// Names of the variables that are `yes` or `no`, behind `RINGCAT_`.
const SWITCHES: [&str; 4] = ["WILDCARDS", "REGALIAS", "SII_ASSIGN", "RT_SYSLOG"];

impl BusSettings {
    /// Names of all variables, behind `RINGCAT_`.
    pub fn variables() -> impl Iterator<Item = &'static str> {
        SWITCHES.into_iter().chain(DebugRing::VARIABLES)
    }

    /// Evaluates a variable by its name behind `RINGCAT_`. Returns its meaning.
    ///
    /// # Errors
    /// There is no such variable, or it does not have such a value; in one sentence.
    pub fn set(&mut self, name: &str, value: &str) -> Result<String, String> {
        if let Some(rest) = name.strip_prefix("DEBUG_RING") {
            return self.debug_ring.set(rest, value);
        }
        let (setting, [yes, no]) = match name {
            "WILDCARDS" => (
                &mut self.has_wildcards,
                ["vendor and product 0xFFFFFFFF stand for any", "vendor and product are compared as they are"],
            ),
            "REGALIAS" => (
                &mut self.reads_alias_register,
                ["aliases are those of register 0x0012", "aliases are those of the SII"],
            ),
            "SII_ASSIGN" => (
                &mut self.assigns_sii,
                ["the EEPROM belongs to the PDI on the way to PREOP", "the EEPROM stays with EtherCAT"],
            ),
            "RT_SYSLOG" => (
                &mut self.prints_cyclic_lines,
                ["prints working counters and lost datagrams", "does not print working counters and lost datagrams"],
            ),
            _ => return Err(expected()),
        };
        *setting = yes_or_no(value)?;
        Ok(if *setting { yes } else { no }.to_owned())
    }
}

fn expected() -> String {
    format!("expected one of {}", BusSettings::variables().collect::<Vec<_>>().join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon, c-interface
    #[test]
    fn defaults_are_those_of_the_manual_and_each_variable_sets_one() {
        let values = |settings: &BusSettings| {
            let BusSettings { has_wildcards, reads_alias_register, assigns_sii, prints_cyclic_lines, .. } = *settings;
            [has_wildcards, reads_alias_register, assigns_sii, prints_cyclic_lines]
        };
        assert_eq!(values(&BusSettings::default()), [false, false, false, true]);
        for (at, name) in SWITCHES.into_iter().enumerate() {
            let mut settings = BusSettings::default();
            for (value, expected) in [("yes", true), ("no", false)] {
                assert!(settings.set(name, value).is_ok());
                let mut all = values(&BusSettings::default());
                all[at] = expected;
                assert_eq!(values(&settings), all, "{name}");
            }
            assert_eq!(settings.set(name, "1"), Err("expected yes or no, got \"1\"".to_owned()));
        }
        assert!(BusSettings::default().set("OTHER", "yes").is_err());
    }
}
