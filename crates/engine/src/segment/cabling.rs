//! How SubDevices are connected, as it was found last.

use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;

use super::member::Member;
use crate::ring_status::{Cable, CableErrors};
use crate::topology::Topology;

/// A port, by the SubDevice that has it.
pub type End = (StationAddress, u8);

/// Connections, and what is known of the cables.
#[derive(Clone, Debug)]
pub struct Cabling {
    /// Connections as the scan found them, or a rescan after it.
    pub topology: Topology,
    /// Station addresses by position, as found together with these.
    pub stations: Vec<StationAddress>,
    /// All cables with what their ends have counted.
    pub cables: Vec<(Cable, CableErrors)>,
    /// Both ends of the closing cables of all rings behind junctions that were learned or declared, the junction's
    /// first: also those whose SubDevices are not all there.
    pub closings: Vec<[End; 2]>,
    /// How often other cables, or other SubDevices at their ends, were found since the scan.
    pub version: u32,
}

/// Station addresses by position: those of members, and at other places what was found there.
pub fn stations_by_position(members: &[Member], found: impl Iterator<Item = StationAddress>) -> Vec<StationAddress> {
    let mut stations: Vec<StationAddress> = found.collect();
    for member in members {
        if let Some(station) = member.node.and_then(|node| stations.get_mut(node)) {
            *station = member.station;
        }
    }
    stations
}
