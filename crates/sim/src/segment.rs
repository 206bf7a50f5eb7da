//! Segments from files. The format is described in `docs/segments.md`.
//!
//! Input: TOML text and the directory of the SII images. Output: [`Segment`], a description of all devices, cables and
//! options from which [`Network::from_description`](crate::network::Network::from_description) makes a segment. An
//! error names file, line and device.

mod described;
mod devices;
mod error;
mod faults;
mod file;
mod format;
mod keys;
mod services;
mod topology;

use core::time::Duration;
use std::path::Path;

use crate::cable::CableSpec;
use crate::description::DeviceDescription;
use crate::fault::Fault;
use crate::network::NetworkOptions;
use described::Sources;

pub use described::{DescribedDevice, DescribedDevices, DescriptionFault, NoDescriptions};
pub use error::SegmentError;
use file::read_at_most;

/// The segment file of the demonstration: a ring of couplers, terminals and a servo drive.
pub const DEMO: &str = include_str!("../segments/demo.toml");

/// A segment as described in a file.
///
/// Cable `n` is the cable of device `n`. After these follow the cable that closes the ring, if there is one, and the
/// cables listed in the file. (Devices attached only by listed cables shift the numbers.)
#[derive(Clone, Debug)]
pub struct Segment {
    /// Name of the segment.
    pub name: String,
    /// Options of the network.
    pub options: NetworkOptions,
    /// The devices in the order of the file.
    pub devices: Vec<DeviceDescription>,
    /// The cables.
    pub cables: Vec<CableSpec>,
    /// Faults, with the time since the beginning of the simulation.
    pub faults: Vec<(Duration, Fault)>,
}

/// Longest segment file: 65,535 devices take a few megabytes.
const MOST_BYTES: u64 = 64 * 1024 * 1024;

impl Segment {
    /// Reads a segment file. Paths of SII images are relative to it. Devices of description files (ESI) need
    /// [`Segment::load_with`].
    ///
    /// # Errors
    /// A file that cannot be read, and the errors of [`Segment::from_toml`].
    pub fn load(path: &Path) -> Result<Segment, SegmentError> {
        Segment::load_with(path, &NoDescriptions)
    }

    /// The same, with devices of description files.
    ///
    /// # Errors
    /// The errors of [`Segment::load`], and those of the description files.
    pub fn load_with(path: &Path, descriptions: &dyn DescribedDevices) -> Result<Segment, SegmentError> {
        let bytes = read_at_most(path, MOST_BYTES).map_err(|text| SegmentError::new(text).in_file(path))?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let valid = &error.as_bytes()[..error.utf8_error().valid_up_to()];
            let line = 1 + valid.iter().filter(|byte| **byte == b'\n').count();
            SegmentError::new("expected UTF-8 text").at_line(line).in_file(path)
        })?;
        let base_dir = path.parent().unwrap_or(Path::new("."));
        Segment::from_toml_with(&text, base_dir, descriptions).map_err(|error| error.in_file(path))
    }

    /// Reads the text of a segment file. Paths of SII images are relative to `base_dir`.
    ///
    /// # Errors
    /// Text that is not TOML, unknown or missing keys, values out of range, unknown device types, SII images that
    /// cannot be read, duplicate names, cables with a missing end or at a port with another cable, and faults of
    /// cables or devices that do not exist.
    pub fn from_toml(text: &str, base_dir: &Path) -> Result<Segment, SegmentError> {
        Segment::from_toml_with(text, base_dir, &NoDescriptions)
    }

    /// The same, with devices of description files; their paths are also relative to `base_dir`.
    ///
    /// # Errors
    /// The errors of [`Segment::from_toml`], and those of the description files.
    pub fn from_toml_with(
        text: &str,
        base_dir: &Path,
        descriptions: &dyn DescribedDevices,
    ) -> Result<Segment, SegmentError> {
        keys::check(text)?;
        let file = format::File::parse(text)?;
        let options = file.options(text)?;
        let plan = devices::describe(&file, text, &Sources { base_dir, descriptions }, options.seed)?;
        let cables = topology::plug(&file, text, &plan)?;
        let faults = faults::planned(&file, text, &plan, cables.len())?;
        Ok(Segment {
            name: file.segment.name.clone().unwrap_or_else(|| String::from("segment")),
            options,
            devices: plan.into_iter().map(|device| device.description).collect(),
            cables,
            faults,
        })
    }
}

#[cfg(test)]
mod tests;
