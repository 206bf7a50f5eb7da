//! Result of the resolution for a declaration or for a SubDevice that was found.

use core::fmt;

use ringcat_wire::address::Position;

use super::ConfigAddress;
use crate::declared::SubDeviceId;
use crate::info::IdentityField;

/// Why a declaration has no SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ConfigError {
    /// A SubDevice of another identity is at its place.
    Mismatch {
        /// Position of the SubDevice.
        position: Position,
        /// The field that differs.
        field: IdentityField,
        /// Declared value.
        expected: u32,
        /// Value of the SubDevice.
        got: u32,
    },
    /// No SubDevice is at its place.
    Missing {
        /// The place.
        address: ConfigAddress,
        /// SubDevices in the segment.
        present: usize,
    },
    /// Several SubDevices have the alias or the identification.
    Ambiguous {
        /// The address with the alias or identification.
        address: ConfigAddress,
        /// Position of the first one.
        first: Position,
        /// Position of the second one.
        second: Position,
    },
    /// An earlier declaration already has the SubDevice.
    DeclaredTwice {
        /// Position of the SubDevice.
        position: Position,
        /// Number of the earlier declaration.
        first: SubDeviceId,
    },
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ConfigError::Mismatch { position, field, expected, got } => {
                write!(f, "position {position}: expected {field} {expected:#010x}, got {got:#010x}")
            }
            ConfigError::Missing { address, present } => {
                write!(f, "no SubDevice at {address}; {present} are present")
            }
            ConfigError::Ambiguous { address, first, second } => {
                write!(f, "{} belongs to position {first} and to position {second}", address.mark())
            }
            ConfigError::DeclaredTwice { position, first } => {
                write!(f, "position {position} is declared as SubDevice {first} already")
            }
        }
    }
}

impl core::error::Error for ConfigError {}

/// Result for a declaration, or for a SubDevice without a declaration; `config` and `info` are indices in the slices
/// given to `resolve`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resolution {
    /// The declaration has its SubDevice.
    Found {
        /// The declaration.
        config: usize,
        /// The SubDevice.
        info: usize,
    },
    /// An optional SubDevice is absent.
    Absent {
        /// The declaration.
        config: usize,
        /// Mismatch with the SubDevice at its place, or that it is missing.
        error: ConfigError,
    },
    /// A declaration that requires a SubDevice has none.
    Failed {
        /// The declaration.
        config: usize,
        /// Reason why it has none.
        error: ConfigError,
    },
    /// The SubDevice has no declaration.
    Extra {
        /// The SubDevice.
        info: usize,
    },
}
