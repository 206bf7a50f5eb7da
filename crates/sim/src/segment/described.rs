//! Devices that description files (ESI) describe: what a segment file names, and how it becomes a device.
//!
//! The simulator reads no ESI itself; the library reads them and implements [`DescribedDevices`].

use std::path::{Path, PathBuf};

use crate::description::DeviceDescription;

/// A device as the table of a segment file names it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DescribedDevice {
    /// Key `esi`: the file, relative to the segment file or absolute.
    pub path: PathBuf,
    /// Key `type`: the type in the file; `None` if the table has none.
    pub kind: Option<String>,
    /// Key `revision`; `None`: the highest.
    pub revision: Option<u32>,
    /// Key `product`: the product code, where several devices have one type and revision.
    pub product: Option<u32>,
    /// Key `modules`: the modules in the slots, in order.
    pub modules: Vec<String>,
}

/// Why there is no such device, and the key of the table that is at fault.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct DescriptionFault {
    /// `esi`, `type`, `revision`, `product` or `modules`.
    pub key: &'static str,
    /// Expected and actual value.
    pub message: String,
}

impl DescriptionFault {
    /// A fault of this key.
    pub fn new(key: &'static str, message: impl Into<String>) -> DescriptionFault {
        DescriptionFault { key, message: message.into() }
    }
}

/// Reads description files.
pub trait DescribedDevices {
    /// The device of a file; `name` is its name in the segment.
    ///
    /// # Errors
    /// [`DescriptionFault`]: the file cannot be read, or has no such device.
    fn device(&self, wanted: &DescribedDevice, name: &str) -> Result<DeviceDescription, DescriptionFault>;
}

/// No description file can be read.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoDescriptions;

impl DescribedDevices for NoDescriptions {
    fn device(&self, _wanted: &DescribedDevice, _name: &str) -> Result<DeviceDescription, DescriptionFault> {
        let message = "expected no key esi: this program reads no device descriptions (feature esi of ringcat)";
        Err(DescriptionFault { key: "esi", message: message.into() })
    }
}

/// Where the devices of a segment file come from.
pub(super) struct Sources<'a> {
    pub(super) base_dir: &'a Path,
    pub(super) descriptions: &'a dyn DescribedDevices,
}
