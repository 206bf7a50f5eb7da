//! Status of the ring for queries at any time: both links, the SubDevices that answer on each, place and time of a
//! break.
//!
//! Redundancy is a state of its own, apart from faults of the bus: an open ring exchanges all process data and
//! tolerates no further break. The states of SubDevices and domains (lost, incomplete) are reported elsewhere.

mod cables;

use core::fmt;

use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::al::AlState;

pub use cables::{CableErrors, CableReport, cables, port_errors};

use crate::declared::SubDeviceId;
use crate::link::Link;
use crate::ring::RingState;
use crate::time::Instant;
use crate::topology::PortOf;

/// A cable in the order of the ring. `None` is an interface of the host: MAIN at the near end, REDUNDANT at the far
/// end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Cable {
    /// The end that is nearer to MAIN.
    pub near: Option<PortOf>,
    /// The other end.
    pub far: Option<PortOf>,
}

impl fmt::Display for Cable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("between ")?;
        match self.near {
            Some(port) => port.fmt(f)?,
            None => f.write_str("the MAIN interface")?,
        }
        f.write_str(" and ")?;
        match self.far {
            Some(port) => port.fmt(f),
            None => f.write_str("the REDUNDANT interface"),
        }
    }
}

/// The SubDevice at a cabling position.
///
/// Positions are not indices of the declaration: declared SubDevices may be missing, in another order, or in a hot
/// connect group, and undeclared ones may be between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Occupant {
    /// Station address.
    pub station: StationAddress,
    /// Index in the declaration; `None` for an undeclared SubDevice.
    pub declared: Option<SubDeviceId>,
}

impl Occupant {
    /// A SubDevice by its station address, and its index in the declaration if it is declared.
    pub const fn new(station: StationAddress, declared: Option<SubDeviceId>) -> Occupant {
        Occupant { station, declared }
    }
}

/// Number of SubDevices that process the copies of frames sent on each link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct LinkCounts {
    /// On MAIN.
    pub main: u16,
    /// On REDUNDANT; 0 with one link.
    pub redundant: u16,
}

/// Whether the ring tolerates a further break.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Redundancy {
    /// There is one link.
    #[default]
    None,
    /// No frame has proved a state yet.
    Unknown,
    /// The ring is closed and passes frames in both directions.
    Ready,
    /// The next break isolates SubDevices.
    Lost {
        /// Reason.
        cause: RedundancyLoss,
        /// Time of detection.
        since: Instant,
    },
}

/// Why redundancy is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RedundancyLoss {
    /// The ring is open.
    Open,
    /// The ring passes frames in one direction only: the copies sent on this link do not come back.
    OneWay(Link),
}

impl fmt::Display for RedundancyLoss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RedundancyLoss::Open => f.write_str("the ring is open"),
            RedundancyLoss::OneWay(link) => write!(f, "frames that are sent on {link} do not come back"),
        }
    }
}

/// One link (`ecrt_master_link_state` of the IgH manual).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct LinkStatus {
    /// Whether the interface has a carrier; `None` if the link layer does not report it.
    pub carrier: Option<bool>,
    /// Number of SubDevices that processed the last frames sent on this link. In a closed ring without branches, all of
    /// them process the frames of MAIN.
    pub answering: u16,
    /// AL states of these SubDevices, ORed: bits 0 to 3 as in register AL_STATUS.
    pub al_states: u8,
}

impl LinkStatus {
    /// Whether the link is up: it has a carrier; if the carrier is not known: SubDevices answer on it.
    pub fn is_up(&self) -> bool {
        self.carrier.unwrap_or(self.answering > 0)
    }

    /// Whether any SubDevice on this link is in a state.
    pub fn has(&self, state: AlState) -> bool {
        // BOOT is coded as 3, INIT and PREOP together (protocol 5.1).
        self.al_states & state.code() == state.code()
    }
}

impl Cable {
    /// Positions at the near and at the far end.
    pub fn positions(&self) -> [Option<Position>; 2] {
        [self.near, self.far].map(|end| end.map(PortOf::position))
    }
}

/// The ring and both links.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct RingStatus {
    /// Closed or open, as proved by frames.
    pub state: RingState,
    /// Whether the ring tolerates a further break.
    pub redundancy: Redundancy,
    /// Status of each link, by [`Link::index`].
    pub links: [LinkStatus; 2],
    /// The cable that is broken, once known.
    pub place: Option<Cable>,
    /// The SubDevices at the near and at the far end of that cable.
    pub place_ends: [Option<Occupant>; 2],
    /// Number of changes since activation, including those too frequent for an event each.
    pub changes: u32,
    /// The ring changes too often for an event per change.
    pub unsteady: bool,
}

impl RingStatus {
    /// The status of a link.
    pub fn link(&self, link: Link) -> &LinkStatus {
        &self.links[link.index()]
    }

    /// Whether SubDevices are reached on the redundant link only, because the ring is broken (`redundancy_active` of
    /// the IgH manual).
    pub fn redundancy_active(&self) -> bool {
        self.state == RingState::Open && self.link(Link::Redundant).answering > 0
    }
}

#[cfg(test)]
mod tests {
    use std::string::ToString;

    use super::*;

    // covers: CR-12
    #[test]
    fn a_cable_is_displayed_by_its_two_ends() {
        let (near, far) = (Some(PortOf { node: 7, port: 1 }), Some(PortOf { node: 8, port: 0 }));
        assert_eq!(Cable { near, far }.to_string(), "between SubDevice 7 port 1 and SubDevice 8 port 0");
        let host = Cable { near: None, far: Some(PortOf { node: 0, port: 0 }) };
        assert_eq!(host.to_string(), "between the MAIN interface and SubDevice 0 port 0");
        let host = Cable { near, far: None };
        assert_eq!(host.to_string(), "between SubDevice 7 port 1 and the REDUNDANT interface");
    }

    // covers: ring-status
    #[test]
    fn redundancy_is_active_if_an_open_ring_has_subdevices_on_the_redundant_link() {
        let mut status = RingStatus { state: RingState::Open, ..RingStatus::default() };
        status.links[0].answering = 5;
        assert!(!status.redundancy_active(), "MAIN reaches all SubDevices");
        status.links[1] = LinkStatus { carrier: None, answering: 2, al_states: 0x0C };
        assert!(status.redundancy_active());
        let redundant = status.link(Link::Redundant);
        assert!(redundant.is_up() && redundant.has(AlState::Op) && redundant.has(AlState::SafeOp));
        assert!(!redundant.has(AlState::PreOp));
        status.state = RingState::Closed;
        assert!(!status.redundancy_active(), "in a closed ring, a branch on port 2 processes the redundant copy");
    }
}
