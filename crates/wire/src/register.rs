//! The registers of a SubDevice controller (protocol 3).
//!
//! * [`map`]: their addresses;
//! * [`table()`]: size, access rights, reset value and group of each register;
//! * typed views, re-exported here: `decode` takes exactly the register's bytes, `encode` returns them. Bits without a
//!   name are kept. Some layouts serve two registers, for example an event and its mask.

#[macro_use]
mod view;

mod addressing;
mod dc;
mod dc_sync;
mod dl;
mod error_counter;
mod esc_specific;
mod event;
mod fmmu;
mod information;
mod led;
pub mod map;
mod mii;
mod pdi;
mod sii_interface;
mod sync_manager;
mod table;
mod watchdog;

pub use crate::al::{AlControl, AlStatus, AlStatusCode};
pub use addressing::{EscReset, WriteEnable, WriteProtection};
pub use dc::{
    DcFilterDifference, DcFilterSpeed, DcLatchMode, DcReceiveTimes, DcSpeedCounterDifference, DcSpeedCounterStart,
    DcSystemTimeDelay, DcSystemTimeDifference, DcSystemTimeOffset,
};
pub use dc_sync::{
    DcActivation, DcActivationStatus, DcCyclicUnitControl, DcLatchControl, DcLatchStatus, DcPulseLength, DcSyncCycle,
    DcSyncStatus,
};
pub use dl::{DlControl, DlStatus, LoopControl, PhysicalOffset, PortStatus};
pub use error_counter::{ErrorCounters, RxErrorCounter};
pub use esc_specific::{DigitalOutputs, Gpi, Gpo, ProductId};
pub use event::{AlEvent, EcatEvent};
pub use fmmu::Fmmu;
pub use information::{Features, Information, PortDescriptor, PortKind};
pub use led::LedOverride;
pub use mii::{
    MiiCommand, MiiControl, MiiEcatAccess, MiiPdiAccess, MiiPhyAddress, MiiPhyData, MiiPhyPortStatus, MiiPhyRegister,
};
pub use pdi::{
    EscConfiguration, ExtendedPdiConfiguration, PdiConfiguration, PdiControl, PdiInformation, SyncLatchConfiguration,
};
pub use sii_interface::{SiiAddress, SiiCommand, SiiConfiguration, SiiControl, SiiData, SiiPdiAccess};
pub use sync_manager::{
    SyncManager, SyncManagerActivate, SyncManagerControl, SyncManagerDirection, SyncManagerMode, SyncManagerPdiControl,
    SyncManagerStatus,
};
pub use table::{Access, ClearGroup, RegisterGroup, RegisterInfo, find};
pub use watchdog::{WatchdogCounters, WatchdogDivider, WatchdogStatus, WatchdogTime};

/// Every register of the map in ascending order of address.
pub fn table() -> &'static [RegisterInfo] {
    table::TABLE
}

#[cfg(test)]
mod tests;
