//! Why the process data of a SubDevice does not fit its place in the image.

use crate::plan::PlanError;

/// Why a SubDevice cannot be set up.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SetupError {
    /// The declaration does not fit the SubDevice.
    Plan(PlanError),
    /// The process image has no place, or a place of another size, for an area of the SubDevice.
    Area {
        /// The SyncManager.
        sync_manager: u8,
        /// Bytes in the process image.
        expected: u16,
        /// Bytes of the SubDevice.
        got: u16,
    },
    /// Its areas lie in several domains, and each place needs an FMMU.
    TooManyPlaces {
        /// FMMUs that process data needs.
        needed: usize,
        /// FMMUs of the SubDevice.
        available: u8,
    },
    /// Its AL status has to be mapped through an FMMU, and it has none free; the number of its FMMUs.
    NoSpareFmmu(u8),
}

impl core::fmt::Display for SetupError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            SetupError::Plan(error) => error.fmt(f),
            SetupError::Area { sync_manager, expected, got } => write!(
                f,
                "SyncManager {sync_manager}: the process image has {expected} bytes for it, the SubDevice {got}"
            ),
            SetupError::TooManyPlaces { needed, available } => {
                write!(f, "its process data is in several domains and needs {needed} FMMUs, it has {available}")
            }
            SetupError::NoSpareFmmu(count) => {
                write!(f, "expected an FMMU to spare for the AL status, all {count} are in use")
            }
        }
    }
}

impl core::error::Error for SetupError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            SetupError::Plan(error) => Some(error),
            _ => None,
        }
    }
}
