//! Why an entry cannot be registered.

use core::fmt;

use super::registered_area::EntryPlace;
use crate::declared::SubDeviceId;
use crate::domain::DomainId;
use crate::plan::PlanError;

/// Why a PDO entry or a SyncManager cannot be registered.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RegisterError {
    /// The domain was not declared.
    NoSuchDomain {
        /// Its number.
        domain: DomainId,
    },
    /// The SubDevice was not declared.
    NoSuchSubDevice {
        /// Its index.
        subdevice: SubDeviceId,
    },
    /// The domain has members, which the MainDevice packs.
    Packed {
        /// Number of the domain.
        domain: DomainId,
    },
    /// The declaration does not fit the SubDevice.
    Plan {
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// What does not fit.
        error: PlanError,
    },
    /// The SubDevice was not found, and its PDOs with all entries are not declared: the places are unknown.
    Unknown {
        /// Index in the declaration.
        subdevice: SubDeviceId,
    },
    /// No PDO that is assigned contains the object.
    NotMapped {
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// Index of the object.
        index: u16,
        /// Subindex.
        sub_index: u8,
    },
    /// The SyncManager has no process data.
    NoProcessData {
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// The SyncManager.
        sync_manager: u8,
    },
    /// There is no entry at this place.
    NoSuchPlace {
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// The place.
        place: EntryPlace,
    },
    /// Each place needs an FMMU of the SubDevice.
    TooManyPlaces {
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// FMMUs that its places need.
        needed: usize,
        /// FMMUs that it has; 16 where it was not found.
        available: u8,
    },
    /// The image is larger than 2 GiB.
    TooLarge {
        /// Number of the domain.
        domain: DomainId,
    },
}

impl fmt::Display for RegisterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RegisterError::NoSuchDomain { domain } => write!(f, "domain {domain} is not declared"),
            RegisterError::NoSuchSubDevice { subdevice } => write!(f, "SubDevice {subdevice} is not declared"),
            RegisterError::Packed { domain } => write!(
                f,
                "domain {domain} has members, which the MainDevice packs at activation: register in a domain without"
            ),
            RegisterError::Plan { subdevice, error } => write!(f, "SubDevice {subdevice}: {error}"),
            RegisterError::Unknown { subdevice } => write!(
                f,
                "SubDevice {subdevice}: the scan has not found it, and its PDOs are not declared with their entries"
            ),
            RegisterError::NotMapped { subdevice, index, sub_index } => write!(
                f,
                "SubDevice {subdevice}: no assigned PDO contains {index:#06x}:{sub_index:02x}; assign one that does"
            ),
            RegisterError::NoProcessData { subdevice, sync_manager } => {
                write!(f, "SubDevice {subdevice}: SyncManager {sync_manager} has no process data")
            }
            RegisterError::NoSuchPlace { subdevice, place: EntryPlace { sync_manager, pdo, entry } } => write!(
                f,
                "SubDevice {subdevice}: SyncManager {sync_manager} has no entry {entry} in PDO {pdo}, counted from 0"
            ),
            RegisterError::TooManyPlaces { subdevice, needed, available } => write!(
                f,
                "SubDevice {subdevice}: its process data would need {needed} FMMUs, it has {available}: register \
                 it in fewer domains"
            ),
            RegisterError::TooLarge { domain } => write!(f, "domain {domain}: the image would exceed 2 GiB"),
        }
    }
}

impl core::error::Error for RegisterError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            RegisterError::Plan { error, .. } => Some(error),
            _ => None,
        }
    }
}
