//! Information about one SubDevice from a scan, in owned types (protocol 3.1, 4).
//!
//! Input: the controller's registers ([`Readout`]), the fixed area of the SII and the categories that the scan read.
//! Output: a [`SubDeviceInfo`]. A SubDevice with a faulty SII is listed too: valid parts are used, and faults are
//! listed in [`SubDeviceInfo::warnings`], with category and offset. [`crate::plan`] refuses an SII that is unfit for
//! process data.

mod collect;
mod dictionary;
mod eeprom;
mod extend;
mod extent;
mod identity_field;
mod object;
mod pdo_source;
mod pdos;
mod subdevice;
mod warning;

use alloc::vec::Vec;

use ringcat_wire::sii::{Category, SiiHeader};

pub use crate::direction::Direction;
pub(crate) use collect::{alias_of, is_possible};
pub(crate) use dictionary::{KnownDictionary, MISSING_BYTES, bytes_of_entry, bytes_of_object, place};
pub use eeprom::{AliasSource, SiiAssignment};
pub use extent::SiiExtent;
pub use identity_field::IdentityField;
pub use object::{Entry, Object};
pub use pdo_source::PdoSource;
pub use subdevice::{ControllerInfo, DataWord, MailboxSyncManagers, PdoEntryInfo, PdoInfo, Readout, SubDeviceInfo};
pub use warning::{InfoWarning, SiiProblem};

impl SubDeviceInfo {
    /// Combines registers and SII. `categories` are those that the scan read, in any order. Invalid bytes become
    /// warnings.
    pub fn from_parts<'a>(
        readout: Readout,
        header: &SiiHeader,
        categories: impl IntoIterator<Item = Category<'a>>,
    ) -> SubDeviceInfo {
        let parts: Vec<_> = categories.into_iter().collect();
        collect::collect(readout, header, &parts)
    }
}

#[cfg(test)]
mod tests;
