//! What a scan found about one SubDevice, in owned types (protocol 3.1, 4).
//!
//! Input: the controller's registers ([`Readout`]), the fixed area of the SII and the categories that the scan read.
//! Output: a [`SubDeviceInfo`]. No fault of an SII keeps a SubDevice from being listed: valid parts are used, faults
//! are listed in [`SubDeviceInfo::warnings`], with category and offset. [`crate::plan`] refuses an SII that is unfit
//! for process data.

mod collect;
mod identity_field;
mod subdevice;
mod warning;

use alloc::vec::Vec;

use ringcat_wire::sii::{Category, SiiHeader};

pub use crate::direction::Direction;
pub use identity_field::IdentityField;
pub use subdevice::{ControllerInfo, PdoEntryInfo, PdoInfo, Readout, SubDeviceInfo};
pub use warning::{InfoWarning, SiiProblem};

impl SubDeviceInfo {
    /// Combines what was read. `categories` are those that the scan read, in any order; a category that the image does
    /// not have is left out. Invalid bytes become warnings.
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
