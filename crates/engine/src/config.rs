//! What the application declares about each SubDevice: where it is expected, who it is, its process data, watchdog,
//! start-up commands and time limits.
//!
//! Everything not declared comes from the SII. Which declaration belongs to which SubDevice of a scan is the matter
//! of [`resolve`]; what follows for its registers, of [`crate::plan`].

mod address;
mod builder;
mod clocks;
mod declared;
mod groups;
mod ip;
mod matching;
mod pdo;
mod register;
mod resolution;
mod resolve;
mod startup;
mod sync_modes;
mod timeouts;

use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::al::AlState;

use crate::info::{Direction, SubDeviceInfo};

pub use crate::info::IdentityField;

pub use address::ConfigAddress;
pub use declared::{DeclaredSyncManager, SyncManagerRole};
pub(crate) use groups::can_lead;
pub use groups::{Group, groups};
pub use ip::IpSettings;
pub use pdo::{PdoAssignment, PdoEntry, PdoMapping};
pub use register::{RegisterAccess, RegisterCommand};
pub use startup::{IdnWrite, SdoDownload, SdoUpload, StartupAction, StartupCommand, Transition};
pub use timeouts::{StateTimeout, Timeouts};

pub use clocks::{ClockConfig, Passage, ReferenceClock, SyncSignals};
pub use resolution::{ConfigError, Resolution};
pub use resolve::{DuplicateAlias, duplicate_aliases, resolve};
pub use sync_modes::ModeError;

/// Who is expected; `None` matches any value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Expected {
    /// Vendor id.
    pub vendor_id: Option<u32>,
    /// Product code.
    pub product_code: Option<u32>,
    /// Revision.
    pub revision: Option<u32>,
    /// Lowest revision.
    pub minimum_revision: Option<u32>,
    /// Serial number.
    pub serial: Option<u32>,
    /// Explicit device identification (protocol 5.3).
    pub identification: Option<u16>,
}

impl Expected {
    /// The first field that does not match: field, expected, got.
    pub fn mismatch(&self, info: &SubDeviceInfo) -> Option<(IdentityField, u32, u32)> {
        let got = &info.identity;
        let identification = u32::from(info.identification.unwrap_or(0));
        let minimum = self.minimum_revision.filter(|minimum| got.revision < *minimum);
        [
            (IdentityField::VendorId, self.vendor_id, got.vendor_id),
            (IdentityField::ProductCode, self.product_code, got.product_code),
            (IdentityField::Revision, self.revision, got.revision),
            (IdentityField::MinimumRevision, minimum, got.revision),
            (IdentityField::Serial, self.serial, got.serial),
            (IdentityField::Identification, self.identification.map(u32::from), identification),
        ]
        .into_iter()
        .find_map(|(field, expected, got)| expected.filter(|expected| *expected != got).map(|e| (field, e, got)))
    }
}

/// Whether writes to a SyncManager retrigger the process data watchdog.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Watchdog {
    /// As the SII says.
    #[default]
    Default,
    /// They do.
    On,
    /// They do not.
    Off,
}

/// What is to be different about a SyncManager.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SyncManagerOverride {
    /// Its number.
    pub index: u8,
    /// Its direction.
    pub direction: Direction,
    /// Its watchdog.
    pub watchdog: Watchdog,
}

/// What the application declares about one SubDevice. The default expects anybody at position 0, with everything else
/// from the SII.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SubDeviceConfig {
    /// Where it is expected.
    pub address: ConfigAddress,
    /// Who is expected.
    pub expected: Expected,
    /// The segment works without it.
    pub optional: bool,
    /// Number of the [group](Group) to which it belongs.
    pub group: Option<usize>,
    /// What is to be different about its SyncManagers.
    pub sync_managers: Vec<SyncManagerOverride>,
    /// PDOs of the SyncManagers named here; the others, and all where this is `None`, are as in the SII.
    pub pdos: Option<Vec<PdoAssignment>>,
    /// All its SyncManagers as a configuration file writes them; `None` takes them from the SII. With them
    /// `sync_managers` and `pdos` do not count, nothing is assigned or mapped, and the file's mailboxes take the place
    /// of the SII's.
    pub declared: Option<Vec<DeclaredSyncManager>>,
    /// Its mailboxes in BOOT as a configuration file writes them, first the one that the MainDevice writes; `None`
    /// takes them from the SII.
    pub declared_bootstrap: Option<[DeclaredSyncManager; 2]>,
    /// Register WATCHDOG_DIVIDER.
    pub watchdog_divider: Option<u16>,
    /// Register WATCHDOG_TIME_PROCESS_DATA, in units of the divider; 0 switches the watchdog off.
    pub watchdog_intervals: Option<u16>,
    /// Register WATCHDOG_TIME_PDI, in units of the divider; 0 switches the watchdog off.
    pub pdi_watchdog_intervals: Option<u16>,
    /// Start-up commands. Those of a transition are sent in this order, all of them each time it is passed.
    pub startup: Vec<StartupCommand>,
    /// The PDI keeps the EEPROM that it has on the way to PREOP. Whoever reads or writes the EEPROM takes it back.
    pub sii_to_pdi: bool,
    /// Pause in PREOP before SAFEOP is requested, for SubDevices that need it.
    pub wait_before_safeop: Duration,
    /// SYNC signals of its distributed clock; `None` runs it without them.
    pub sync: Option<SyncSignals>,
    /// What frames take through it; `None`: as [`ClockConfig::passage`] says.
    pub passage: Option<Passage>,
    /// Time limits.
    pub timeouts: Timeouts,
    /// Time limits of single state changes, which count before `timeouts`.
    pub state_timeouts: Vec<StateTimeout>,
    /// State to which it is to be brought.
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
            declared: None,
            declared_bootstrap: None,
            watchdog_divider: None,
            watchdog_intervals: None,
            pdi_watchdog_intervals: None,
            startup: Vec::new(),
            sii_to_pdi: false,
            wait_before_safeop: Duration::ZERO,
            sync: None,
            passage: None,
            timeouts: Timeouts::default(),
            state_timeouts: Vec::new(),
            target: AlState::Op,
        }
    }
}

#[cfg(test)]
mod tests;
