//! Result of a scan.

use alloc::vec::Vec;

use crate::info::SubDeviceInfo;
use crate::topology::Topology;

/// Result of a scan.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Scan {
    /// The SubDevices in the order of the processing units.
    pub subdevices: Vec<SubDeviceInfo>,
    /// Their connections.
    pub topology: Topology,
    /// Number of SubDevices that the main copy passed.
    pub main_count: usize,
    /// Number of SubDevices that the redundant copy passed.
    pub redundant_count: usize,
}
