//! The record of the last seconds before a fault (`enable-debug-ring`), as settings.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::value::{number, yes_or_no};

/// Longest time that is recorded, in seconds.
const MOST_SECONDS: u32 = 3600;
/// Limits of the memory.
const BYTES: std::ops::RangeInclusive<u64> = 1 << 16..=1 << 30;
/// Largest number of files.
const MOST_FILES: u32 = 10_000;
/// Largest number of incomplete cycles.
const MOST_CYCLES: u32 = 1_000_000;

/// The record of the last seconds before a fault.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct DebugRing {
    /// Frames are recorded.
    pub is_on: bool,
    /// Time before a fault, in seconds.
    pub seconds: u32,
    /// Memory for frames.
    pub bytes: u64,
    /// Where files are written.
    pub directory: PathBuf,
    /// Largest number of files of a master; those of lost owners are removed first, then the oldest ones.
    pub files: u32,
    /// Incomplete cycles of a domain in a row that are a fault.
    pub cycles: u32,
}

impl Default for DebugRing {
    fn default() -> DebugRing {
        let directory = PathBuf::from("/var/log/ringcat");
        DebugRing { is_on: false, seconds: 10, bytes: 16 << 20, directory, files: 10, cycles: 10 }
    }
}

impl DebugRing {
    /// Names of all variables, behind `RINGCAT_`.
    pub const VARIABLES: [&'static str; 6] = [
        "DEBUG_RING",
        "DEBUG_RING_SECONDS",
        "DEBUG_RING_BYTES",
        "DEBUG_RING_DIRECTORY",
        "DEBUG_RING_FILES",
        "DEBUG_RING_CYCLES",
    ];

    /// Evaluates a variable by its name behind `RINGCAT_DEBUG_RING`. Returns its meaning.
    pub(super) fn set(&mut self, name: &str, value: &str) -> Result<String, String> {
        match name {
            "" => {
                self.is_on = yes_or_no(value)?;
                let does = if self.is_on { "keeps the last frames for a file at a fault" } else { "keeps no frames" };
                Ok(does.to_owned())
            }
            "_SECONDS" => {
                self.seconds = number(value, 1, MOST_SECONDS)?;
                Ok(format!("{value} s before a fault are kept"))
            }
            "_BYTES" => {
                self.bytes = number(value, *BYTES.start(), *BYTES.end())?;
                Ok(format!("at most {value} bytes of frames are kept"))
            }
            "_DIRECTORY" if value.starts_with('/') => {
                self.directory = value.into();
                Ok(format!("files are written in {value}"))
            }
            "_DIRECTORY" => Err(format!("expected a path from /, got {value:?}")),
            "_FILES" => {
                self.files = number(value, 1, MOST_FILES)?;
                Ok(format!("at most {value} files of a master are kept"))
            }
            "_CYCLES" => {
                self.cycles = number(value, 1, MOST_CYCLES)?;
                Ok(format!("{value} incomplete cycles in a row are a fault"))
            }
            _ => Err(format!("expected one of {}", DebugRing::VARIABLES.join(", "))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::BusSettings;

    // covers: daemon
    #[test]
    fn the_record_before_a_fault_has_limits_and_is_off_by_default() {
        let mut settings = BusSettings::default();
        assert!(!settings.debug_ring.is_on);
        let set = [("", "yes"), ("_SECONDS", "3"), ("_BYTES", "65536"), ("_DIRECTORY", "/d"), ("_FILES", "2")];
        for (name, value) in set.into_iter().chain([("_CYCLES", "7")]) {
            settings.set(&format!("DEBUG_RING{name}"), value).unwrap_or_else(|error| panic!("{name}: {error}"));
        }
        let expected =
            DebugRing { is_on: true, seconds: 3, bytes: 65_536, directory: "/d".into(), files: 2, cycles: 7 };
        assert_eq!(settings.debug_ring, expected);
        for (name, value) in [("_SECONDS", "0"), ("_BYTES", "1"), ("_DIRECTORY", "d"), ("_FILES", "-1"), ("_X", "1")] {
            assert!(settings.set(&format!("DEBUG_RING{name}"), value).is_err(), "{name}");
        }
        assert_eq!(settings.debug_ring, expected);
    }
}
