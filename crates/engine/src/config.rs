//! Declarations of SubDevices: expected place, identity, process data, watchdog, start-up commands and time limits.
//!
//! Everything not declared comes from the SII. [`resolve`] assigns declarations to the SubDevices of a scan;
//! [`crate::plan`] derives the register values.

mod address;
mod builder;
mod clocks;
mod declared;
mod dictionary;
#[cfg(feature = "standby")]
mod digest;
mod groups;
mod ip;
mod matching;
mod pdo;
mod refused_pdos;
mod register;
mod repetition;
mod resolution;
mod resolve;
mod startup;
mod steps;
mod sync_modes;
mod timeouts;

use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::al::AlState;

use crate::declared::GroupId;
use crate::info::{Direction, SubDeviceInfo};

pub use crate::info::IdentityField;

pub use address::ConfigAddress;
pub use declared::{DeclaredArea, DeclaredSyncManager, SyncManagerRole};
#[cfg(feature = "standby")]
pub use digest::{ConfigPart, Digest};
pub(crate) use groups::can_be_head;
pub use groups::{Group, data_words, groups};
pub use ip::IpSettings;
pub use matching::SubDevicesByIdentifier;
pub use pdo::{PdoAssignment, PdoEntry, PdoMapping};
pub use refused_pdos::RefusedPdos;
pub use register::{RegisterAccess, RegisterCommand};
pub use repetition::Repetition;
pub use startup::{
    FileRead, FileWrite, IdnRead, IdnWrite, MailMessage, SdoDownload, SdoUpload, StartupAction, StartupCommand,
    Transition,
};
pub use timeouts::{StateTimeout, Timeouts};

pub use clocks::{ClockConfig, Passage, PulseGrid, ReferenceClock, SyncSignals, WhenUnlocked};
pub use resolution::{ConfigError, Resolution};
pub use resolve::{DuplicateAlias, duplicate_aliases, resolve};
pub use sync_modes::ModeError;

/// Expected identity; `None` matches any value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct Expected {
    /// Vendor id.
    pub vendor_id: Option<u32>,
    /// Product code.
    pub product_code: Option<u32>,
    /// Revision; its bits in `revision_mask` are compared.
    pub revision: Option<u32>,
    /// Bits of the revision that are compared; all by default.
    pub revision_mask: u32,
    /// Lowest revision.
    pub minimum_revision: Option<u32>,
    /// Serial number.
    pub serial: Option<u32>,
    /// Explicit device identification (protocol 5.3).
    pub identification: Option<u16>,
}

impl Default for Expected {
    fn default() -> Expected {
        Expected {
            vendor_id: None,
            product_code: None,
            revision: None,
            revision_mask: u32::MAX,
            minimum_revision: None,
            serial: None,
            identification: None,
        }
    }
}

impl Expected {
    /// The first field that does not match.
    pub fn mismatch(&self, info: &SubDeviceInfo) -> Option<IdentityMismatch> {
        let got = &info.identity;
        let identification = u32::from(info.identification.unwrap_or(0));
        let mask = self.revision_mask;
        let revision = if mask == u32::MAX { IdentityField::Revision } else { IdentityField::RevisionBits };
        let minimum = self.minimum_revision.filter(|minimum| got.revision < *minimum);
        [
            (IdentityField::VendorId, self.vendor_id, got.vendor_id),
            (IdentityField::ProductCode, self.product_code, got.product_code),
            (revision, self.revision.map(|revision| revision & mask), got.revision & mask),
            (IdentityField::MinimumRevision, minimum, got.revision),
            (IdentityField::Serial, self.serial, got.serial),
            (IdentityField::Identification, self.identification.map(u32::from), identification),
        ]
        .into_iter()
        .find_map(|(field, expected, got)| {
            let expected = expected.filter(|expected| *expected != got)?;
            Some(IdentityMismatch { field, expected, got })
        })
    }
}

/// A field of the identity with another value than expected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct IdentityMismatch {
    /// The field.
    pub field: IdentityField,
    /// Its expected value.
    pub expected: u32,
    /// The value of the SubDevice.
    pub got: u32,
}

/// Whether writes to a SyncManager retrigger the process data watchdog.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Watchdog {
    /// As in the SII.
    #[default]
    Default,
    /// Enabled.
    On,
    /// Disabled.
    Off,
}

/// Settings of a SyncManager that override the SII.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct SyncManagerOverride {
    /// Its number.
    pub index: u8,
    /// Its direction.
    pub direction: Direction,
    /// Its watchdog.
    pub watchdog: Watchdog,
}

/// Declaration of one SubDevice. The default expects a SubDevice of any identity at position 0, with everything else
/// from the SII.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SubDeviceConfig {
    /// Expected place.
    pub address: ConfigAddress,
    /// Expected identity.
    pub expected: Expected,
    /// The segment works without it.
    pub optional: bool,
    /// Number of the [group](Group) to which it belongs.
    pub group: Option<GroupId>,
    /// SyncManagers with settings that override the SII.
    pub sync_managers: Vec<SyncManagerOverride>,
    /// PDOs by SyncManager; SyncManagers without an assignment, or all if this is `None`, have the PDOs of the SII.
    pub pdos: Option<Vec<PdoAssignment>>,
    /// What follows if it refuses their assignment or mapping.
    pub refused_pdos: RefusedPdos,
    /// All its SyncManagers from a configuration file; `None` takes them from the SII. If they are given,
    /// `sync_managers` and `pdos` are ignored, PDO assignment and mapping are not written, and the mailboxes of the
    /// file replace those of the SII.
    pub declared: Option<Vec<DeclaredSyncManager>>,
    /// Its mailboxes in BOOT from a configuration file, first the mailbox that the MainDevice writes; `None` takes them
    /// from the SII.
    pub declared_bootstrap: Option<[DeclaredSyncManager; 2]>,
    /// Register WATCHDOG_DIVIDER.
    pub watchdog_divider: Option<u16>,
    /// Register WATCHDOG_TIME_PROCESS_DATA, in units of the divider; 0 switches the watchdog off.
    pub watchdog_intervals: Option<u16>,
    /// Register WATCHDOG_TIME_PDI, in units of the divider; 0 switches the watchdog off.
    pub pdi_watchdog_intervals: Option<u16>,
    /// Start-up commands. Those of a transition are sent in this order, at each pass of the transition.
    pub startup: Vec<StartupCommand>,
    /// The EEPROM is assigned to the PDI before PREOP is requested. A later access by the MainDevice takes it back.
    pub sii_to_pdi: bool,
    /// Pause in PREOP before SAFEOP is requested, for SubDevices that need it.
    pub wait_before_safeop: Duration,
    /// SYNC signals of its distributed clock; `None`: no SYNC signals.
    pub sync: Option<SyncSignals>,
    /// What it may receive a second time within a cycle, when a frame was lost and is sent again.
    pub repetition: Repetition,
    /// Time that frames take through it; `None`: that of [`ClockConfig::passage`].
    pub passage: Option<Passage>,
    /// Time limits.
    pub timeouts: Timeouts,
    /// Time limits of single state changes; they override `timeouts`.
    pub state_timeouts: Vec<StateTimeout>,
    /// Target state.
    pub target: AlState,
}

impl Default for SubDeviceConfig {
    fn default() -> SubDeviceConfig {
        SubDeviceConfig {
            address: ConfigAddress::Position(0),
            expected: Expected::default(),
            optional: false,
            group: None,
            sync_managers: Vec::new(),
            pdos: None,
            refused_pdos: RefusedPdos::default(),
            declared: None,
            declared_bootstrap: None,
            watchdog_divider: None,
            watchdog_intervals: None,
            pdi_watchdog_intervals: None,
            startup: Vec::new(),
            sii_to_pdi: false,
            wait_before_safeop: Duration::ZERO,
            sync: None,
            repetition: Repetition::Automatic,
            passage: None,
            timeouts: Timeouts::default(),
            state_timeouts: Vec::new(),
            target: AlState::Op,
        }
    }
}

#[cfg(test)]
mod tests;
