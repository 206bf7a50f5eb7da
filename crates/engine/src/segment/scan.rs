//! Result of a scan, and the model's form of it.

use alloc::rc::Rc;
use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;

use crate::info::SubDeviceInfo;
use crate::ring_status::LinkCounts;
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

impl Scan {
    /// The scan of a segment that does not answer.
    pub(crate) fn nothing() -> Scan {
        Scan { subdevices: Vec::new(), topology: Topology::build(&[], 0), main_count: 0, redundant_count: 0 }
    }
}

/// The SubDevices that the last scan found. Members and SubDevices without a declaration share their data with it.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Found {
    /// SubDevices by position.
    pub subdevices: Vec<Rc<SubDeviceInfo>>,
    /// Their connections.
    pub topology: Topology,
    /// Number of SubDevices that the main copy passed.
    pub main_count: usize,
}

impl Found {
    /// Station addresses by position.
    pub fn stations(&self) -> Vec<StationAddress> {
        self.subdevices.iter().map(|info| info.station).collect()
    }

    /// SubDevices on each link.
    pub fn counts(&self) -> LinkCounts {
        let redundant = self.subdevices.len().saturating_sub(self.main_count);
        LinkCounts { main: self.main_count as u16, redundant: redundant as u16 }
    }

    /// The result of the scan.
    pub fn scan(&self) -> Scan {
        Scan {
            subdevices: self.subdevices.iter().map(|info| (**info).clone()).collect(),
            topology: self.topology.clone(),
            main_count: self.main_count,
            redundant_count: self.subdevices.len() - self.main_count,
        }
    }
}

impl From<Scan> for Found {
    fn from(scan: Scan) -> Found {
        let Scan { subdevices, topology, main_count, .. } = scan;
        Found { subdevices: subdevices.into_iter().map(Rc::new).collect(), topology, main_count }
    }
}
