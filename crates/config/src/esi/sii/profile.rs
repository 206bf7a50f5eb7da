//! Habits of the tools that write EEPROMs: order of strings, padding, fields that they leave out (protocol ES-82 to
//! ES-99).

use std::fmt;

/// A tool that writes SII images.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum SiiProfile {
    /// TwinCAT, as in the terminals of Beckhoff.
    #[default]
    TwinCat,
    /// siitool of the Open EtherCAT Society.
    Siitool,
    /// The tool of rt-labs.
    RtLabs,
    /// Everything that the description says, with zeros as padding.
    Plain,
}

impl SiiProfile {
    /// All profiles.
    pub const ALL: [SiiProfile; 4] = [SiiProfile::TwinCat, SiiProfile::Siitool, SiiProfile::RtLabs, SiiProfile::Plain];

    /// The name on command lines.
    pub const fn name(self) -> &'static str {
        match self {
            SiiProfile::TwinCat => "twincat",
            SiiProfile::Siitool => "siitool",
            SiiProfile::RtLabs => "rtlabs",
            SiiProfile::Plain => "plain",
        }
    }

    /// Byte behind data of an odd length.
    pub(super) const fn pad(self) -> u8 {
        match self {
            SiiProfile::TwinCat => 0xFF,
            SiiProfile::Siitool | SiiProfile::RtLabs | SiiProfile::Plain => 0,
        }
    }

    /// Byte 4 of the general category: reserved, once the physical layer.
    pub(super) fn physical_layer(self, physics: &str) -> u8 {
        match (self, physics) {
            (SiiProfile::TwinCat, "KK") => 0x0C,
            (SiiProfile::TwinCat, "YKY") => 0x02,
            (SiiProfile::RtLabs, _) => 0x05,
            _ => 0,
        }
    }
}

impl fmt::Display for SiiProfile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// How an image is built.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SiiOptions {
    /// Habits of a tool.
    pub profile: SiiProfile,
    /// LcId of the language of the strings.
    pub language: u32,
    /// The factor of SYNC1 is written. TwinCAT writes 0.
    pub sync1_factor: bool,
    /// PDOs and their strings are left out, for an EEPROM that is too small for them.
    pub without_pdos: bool,
    /// Station alias; `None`: that of `ConfigData`.
    pub alias: Option<u16>,
    /// Serial number; `None`: that of the description.
    pub serial: Option<u32>,
    /// Byte 4 of the general category; `None`: as the profile has it.
    pub physical_layer: Option<u8>,
}

impl Default for SiiOptions {
    fn default() -> SiiOptions {
        SiiOptions {
            profile: SiiProfile::default(),
            language: 1033,
            sync1_factor: false,
            without_pdos: false,
            alias: None,
            serial: None,
            physical_layer: None,
        }
    }
}

impl SiiOptions {
    /// The options of a profile and a language.
    pub fn of(profile: SiiProfile, language: u32) -> SiiOptions {
        SiiOptions { profile, language, sync1_factor: profile == SiiProfile::Plain, ..SiiOptions::default() }
    }
}
