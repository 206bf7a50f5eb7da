//! What a scan found.

use alloc::vec::Vec;

use crate::info::SubDeviceInfo;
use crate::topology::Topology;

/// What a scan found.
#[derive(Clone, Debug)]
pub struct Scan {
    /// The SubDevices in the order of the processing units.
    pub subdevices: Vec<SubDeviceInfo>,
    /// How they are connected.
    pub topology: Topology,
    /// How many of them the main copy met.
    pub main_count: usize,
    /// How many the redundant copy met.
    pub redundant_count: usize,
}
