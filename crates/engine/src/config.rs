//! What the application declares about each SubDevice: where it is expected, who it is, its process data, watchdog,
//! start-up commands and time limits.
//!
//! Everything not declared comes from the SII. Which declaration belongs to which SubDevice of a scan is the matter
//! of [`resolve`]; what follows for its registers, of [`crate::plan`].

mod clocks;
mod resolve;
mod startup;
mod timeouts;

use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::soe::Idn;
use ringcat_wire::sii::Identity;

use crate::info::{Direction, SubDeviceInfo};

pub use startup::{IdnWrite, SdoDownload, StartupAction, StartupCommand, Transition};
pub use timeouts::{StateTimeout, Timeouts};

pub use clocks::{ClockConfig, ReferenceClock, SyncSignals};
pub use resolve::{ConfigError, DuplicateAlias, IdentityField, Resolution, duplicate_aliases, resolve};

/// Where a SubDevice is expected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ConfigAddress {
    /// Position in the configured order, from 0. Where an optional SubDevice is absent, those behind it stand one place
    /// nearer to the start of the segment.
    Position(u16),
    /// `offset` SubDevices behind the one with this alias; alias 0 counts from the start of the segment.
    Alias {
        /// The alias.
        alias: u16,
        /// SubDevices behind it.
        offset: u16,
    },
}

impl fmt::Display for ConfigAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ConfigAddress::Position(position) => write!(f, "position {position}"),
            ConfigAddress::Alias { alias, offset } => write!(f, "alias {alias} offset {offset}"),
        }
    }
}

/// Who is expected; `None` matches any value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Expected {
    /// Vendor id.
    pub vendor_id: Option<u32>,
    /// Product code.
    pub product_code: Option<u32>,
    /// Revision.
    pub revision: Option<u32>,
    /// Serial number.
    pub serial: Option<u32>,
}

impl Expected {
    /// The first field that does not match: field, expected, got.
    pub fn mismatch(&self, got: &Identity) -> Option<(IdentityField, u32, u32)> {
        [
            (IdentityField::VendorId, self.vendor_id, got.vendor_id),
            (IdentityField::ProductCode, self.product_code, got.product_code),
            (IdentityField::Revision, self.revision, got.revision),
            (IdentityField::Serial, self.serial, got.serial),
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

/// An entry of a PDO mapping.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PdoEntry {
    /// Index of the object; 0 is a gap.
    pub index: u16,
    /// Subindex of the object.
    pub sub_index: u8,
    /// Bits.
    pub bit_length: u8,
}

/// A PDO and what it maps.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PdoMapping {
    /// Index of the PDO mapping object.
    pub index: u16,
    /// Its entries; `None` takes those of the SII.
    pub entries: Option<Vec<PdoEntry>>,
}

/// The PDOs of one SyncManager.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PdoAssignment {
    /// The SyncManager.
    pub sync_manager: u8,
    /// Its direction.
    pub direction: Direction,
    /// Its PDOs in order; none switches it off.
    pub pdos: Vec<PdoMapping>,
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
    /// What is to be different about its SyncManagers.
    pub sync_managers: Vec<SyncManagerOverride>,
    /// PDOs of the SyncManagers named here; the others, and all where this is `None`, are as in the SII.
    pub pdos: Option<Vec<PdoAssignment>>,
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
            sync_managers: Vec::new(),
            pdos: None,
            watchdog_divider: None,
            watchdog_intervals: None,
            pdi_watchdog_intervals: None,
            startup: Vec::new(),
            sii_to_pdi: false,
            wait_before_safeop: Duration::ZERO,
            sync: None,
            timeouts: Timeouts::default(),
            state_timeouts: Vec::new(),
            target: AlState::Op,
        }
    }
}

impl SubDeviceConfig {
    /// Anybody at a position.
    pub fn at_position(position: u16) -> SubDeviceConfig {
        SubDeviceConfig { address: ConfigAddress::Position(position), ..SubDeviceConfig::default() }
    }

    /// Anybody `offset` SubDevices behind the one with an alias.
    pub fn at_alias(alias: u16, offset: u16) -> SubDeviceConfig {
        SubDeviceConfig { address: ConfigAddress::Alias { alias, offset }, ..SubDeviceConfig::default() }
    }

    /// The SubDevice that a scan found: at its position, of its vendor and product, everything else from its SII.
    pub fn from_info(info: &SubDeviceInfo) -> SubDeviceConfig {
        SubDeviceConfig::at_position(info.position.0)
            .expect_product(info.identity.vendor_id, info.identity.product_code)
    }

    /// Expects a vendor and a product.
    #[must_use]
    pub fn expect_product(mut self, vendor_id: u32, product_code: u32) -> SubDeviceConfig {
        self.expected.vendor_id = Some(vendor_id);
        self.expected.product_code = Some(product_code);
        self
    }

    /// Expects a revision.
    #[must_use]
    pub fn expect_revision(mut self, revision: u32) -> SubDeviceConfig {
        self.expected.revision = Some(revision);
        self
    }

    /// Expects a serial number.
    #[must_use]
    pub fn expect_serial(mut self, serial: u32) -> SubDeviceConfig {
        self.expected.serial = Some(serial);
        self
    }

    /// The segment works without it.
    #[must_use]
    pub fn optional(mut self) -> SubDeviceConfig {
        self.optional = true;
        self
    }

    /// Declares a SyncManager; a later declaration of the same one replaces the earlier.
    #[must_use]
    pub fn sync_manager(mut self, index: u8, direction: Direction, watchdog: Watchdog) -> SubDeviceConfig {
        self.sync_managers.retain(|sync_manager| sync_manager.index != index);
        self.sync_managers.push(SyncManagerOverride { index, direction, watchdog });
        self
    }

    /// Declares the PDOs of a SyncManager; a later declaration for the same one replaces the earlier.
    #[must_use]
    pub fn assign(mut self, sync_manager: u8, direction: Direction, pdos: Vec<PdoMapping>) -> SubDeviceConfig {
        let assignments = self.pdos.get_or_insert_with(Vec::new);
        assignments.retain(|assignment| assignment.sync_manager != sync_manager);
        assignments.push(PdoAssignment { sync_manager, direction, pdos });
        self
    }

    /// Declares the watchdog: divider and, in units of it, the time for process data.
    #[must_use]
    pub fn watchdog(mut self, divider: Option<u16>, intervals: Option<u16>) -> SubDeviceConfig {
        self.watchdog_divider = divider;
        self.watchdog_intervals = intervals;
        self
    }

    /// Declares the time of the PDI watchdog, in units of the divider.
    #[must_use]
    pub fn pdi_watchdog(mut self, intervals: u16) -> SubDeviceConfig {
        self.pdi_watchdog_intervals = Some(intervals);
        self
    }

    /// Appends an SDO download before SAFEOP.
    #[must_use]
    pub fn sdo(self, index: u16, sub_index: u8, data: impl Into<Vec<u8>>) -> SubDeviceConfig {
        self.sdo_at(Transition::Ps, index, sub_index, data)
    }

    /// Appends an SDO download with complete access before SAFEOP, from subindex 0 or 1.
    #[must_use]
    pub fn sdo_complete(self, index: u16, sub_index: u8, data: impl Into<Vec<u8>>) -> SubDeviceConfig {
        let sdo = SdoDownload { index, sub_index, complete_access: true, data: data.into() };
        self.startup(Transition::Ps, StartupAction::Sdo(sdo))
    }

    /// Appends an SDO download at a transition.
    #[must_use]
    pub fn sdo_at(
        self,
        transition: Transition,
        index: u16,
        sub_index: u8,
        data: impl Into<Vec<u8>>,
    ) -> SubDeviceConfig {
        let sdo = SdoDownload { index, sub_index, complete_access: false, data: data.into() };
        self.startup(transition, StartupAction::Sdo(sdo))
    }

    /// Appends a write of the value of an IDN at a transition: in PREOP for [`Transition::Ps`], in SAFEOP for
    /// [`Transition::So`].
    #[must_use]
    pub fn idn_at(self, transition: Transition, drive: u8, idn: Idn, data: impl Into<Vec<u8>>) -> SubDeviceConfig {
        self.startup(transition, StartupAction::Idn(IdnWrite { drive, idn, data: data.into() }))
    }

    /// Appends a start-up command.
    #[must_use]
    pub fn startup(mut self, transition: Transition, action: StartupAction) -> SubDeviceConfig {
        self.startup.push(StartupCommand { transition, action });
        self
    }

    /// Leaves the EEPROM to the PDI from the way to PREOP on.
    #[must_use]
    pub fn sii_to_pdi(mut self) -> SubDeviceConfig {
        self.sii_to_pdi = true;
        self
    }

    /// Waits in PREOP before SAFEOP is requested.
    #[must_use]
    pub fn wait_before_safeop(mut self, pause: Duration) -> SubDeviceConfig {
        self.wait_before_safeop = pause;
        self
    }

    /// Sets the time limit of one state change; a later one for the same change replaces the earlier.
    #[must_use]
    pub fn state_timeout(mut self, from: AlState, to: AlState, limit: Duration) -> SubDeviceConfig {
        self.state_timeouts.retain(|own| (own.from, own.to) != (from, to));
        self.state_timeouts.push(StateTimeout { from, to, limit });
        self
    }

    /// Limit of a state change.
    pub fn limit(&self, from: AlState, to: AlState) -> Duration {
        let own = self.state_timeouts.iter().find(|own| (own.from, own.to) == (from, to));
        own.map_or_else(|| self.timeouts.transition(from, to), |own| own.limit)
    }

    /// Declares SYNC signals.
    #[must_use]
    pub fn sync(mut self, signals: SyncSignals) -> SubDeviceConfig {
        self.sync = Some(signals);
        self
    }

    /// Sets the time limits.
    #[must_use]
    pub fn timeouts(mut self, timeouts: Timeouts) -> SubDeviceConfig {
        self.timeouts = timeouts;
        self
    }

    /// Sets the state to which it is to be brought.
    #[must_use]
    pub fn target(mut self, target: AlState) -> SubDeviceConfig {
        self.target = target;
        self
    }
}

impl PdoMapping {
    /// A PDO with the entries that the SII gives it.
    pub fn from_sii(index: u16) -> PdoMapping {
        PdoMapping { index, entries: None }
    }

    /// A PDO with these entries.
    pub fn of(index: u16, entries: impl Into<Vec<PdoEntry>>) -> PdoMapping {
        PdoMapping { index, entries: Some(entries.into()) }
    }
}

impl PdoEntry {
    /// An object's bits.
    pub const fn new(index: u16, sub_index: u8, bit_length: u8) -> PdoEntry {
        PdoEntry { index, sub_index, bit_length }
    }
}

#[cfg(test)]
mod tests;
