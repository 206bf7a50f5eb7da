//! The registers of a SubDevice controller (facts section 3).
//!
//! * [`map`]: their addresses;
//! * [`table()`]: size, access rights, reset value and groups of each;
//! * typed views, re-exported here: `decode` takes exactly the register's bytes, `encode` gives them back. Bits
//!   without a name are kept.

#[macro_use]
mod view;

mod dl;
mod fmmu;
mod information;
pub mod map;
mod sii_interface;
mod sync_manager;

pub use crate::al::{AlControl, AlStatus, AlStatusCode};
pub use dl::{DlControl, DlStatus, LoopControl, PhysicalOffset, PortStatus};
pub use fmmu::Fmmu;
pub use information::{Features, Information, PortDescriptor, PortKind};
pub use sii_interface::{SiiAddress, SiiCommand, SiiConfiguration, SiiControl, SiiData, SiiPdiAccess};
pub use sync_manager::{
    SyncManager, SyncManagerActivate, SyncManagerControl, SyncManagerDirection, SyncManagerMode, SyncManagerPdiControl,
    SyncManagerStatus,
};
