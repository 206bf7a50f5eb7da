//! Connections of the SubDevices according to the last scan or rescan.

use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;

use super::subdevices::SubDevices;
use crate::info::SubDeviceInfo;
use crate::ring_status::{Cable, CableErrors};
use crate::topology::Topology;

/// A port, with the station address of its SubDevice.
pub type End = (StationAddress, u8);

/// Connections, and data of the cables.
#[derive(Clone, Debug, Default)]
pub struct Cabling {
    /// Connections according to the scan or a later rescan.
    pub topology: Topology,
    /// Station addresses by position, found at the same time.
    pub stations: Vec<StationAddress>,
    /// Vendor and product code by position, found at the same time, as far as they were known.
    pub types: Vec<Option<(u32, u32)>>,
    /// All cables with the error counts of their ends.
    pub cables: Vec<(Cable, CableErrors)>,
    /// Both ends of the closing cables of all rings behind junctions that were learned or declared, the junction's end
    /// first: also rings with absent SubDevices.
    pub closings: Vec<[End; 2]>,
    /// Increased with each change of cables, or of the SubDevices at their ends, since the scan.
    pub version: u32,
}

/// Vendor and product code of a SubDevice.
pub fn type_of(info: &SubDeviceInfo) -> (u32, u32) {
    (info.identity.vendor_id, info.identity.product_code)
}

/// Station addresses by position: those of members, and at other positions those of the scan.
pub fn stations_by_position(
    subdevices: &SubDevices,
    found: impl Iterator<Item = StationAddress>,
) -> Vec<StationAddress> {
    let mut stations: Vec<StationAddress> = found.collect();
    for member in subdevices.members() {
        if let Some(station) = member.node.and_then(|node| stations.get_mut(node)) {
            *station = member.station;
        }
    }
    stations
}
