//! What a scan found about one SubDevice, in owned types (protocol 3.1, 4).
//!
//! In go what was read from the controller's registers ([`Readout`]), the fixed area of the SII and those categories
//! that the scan fetched; out comes a [`SubDeviceInfo`]. Nothing in an SII keeps a SubDevice from being listed: what
//! can be used is used, and what is odd lands in [`SubDeviceInfo::warnings`], with category and offset. What an SII
//! leaves unfit for process data is refused by [`crate::plan`].

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
    /// Puts together what was read. `categories` are those that the scan fetched, in any order; a category that the
    /// image does not have is not there. Bytes that make no sense become warnings.
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
