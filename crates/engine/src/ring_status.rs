//! What can be asked about the ring at any time: both links, who answers on each, where it is broken, since when.
//!
//! Redundancy is a state of its own, apart from faults of the bus: a ring that is open exchanges everything and stands
//! no further break. What SubDevices and domains say (lost, incomplete) is told elsewhere.

mod cables;

use core::fmt;

use ringcat_wire::address::StationAddress;
use ringcat_wire::al::AlState;

pub use cables::{CableErrors, cables, port_errors};

use crate::link::Link;
use crate::ring::RingState;
use crate::time::Instant;
use crate::topology::PortOf;

/// A cable in the order of the ring. `None` is the interface of the host: MAIN at the near end, REDUNDANT at the far
/// one.
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

/// Who is at a position of the cabling.
///
/// Positions are not indices of the declaration: declared SubDevices may be missing, in another order, or behind a hot
/// connect group, and others may be between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Occupant {
    /// Station address.
    pub station: StationAddress,
    /// Index in the declaration; `None` where nobody declared it.
    pub declared: Option<usize>,
}

/// Whether another break would be survived.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Redundancy {
    /// There is one link.
    #[default]
    None,
    /// No frame has shown it yet.
    Unknown,
    /// The ring is closed, frames pass it both ways.
    Ready,
    /// The next break isolates somebody.
    Lost {
        /// Why.
        cause: RedundancyLoss,
        /// When that was seen.
        since: Instant,
    },
}

/// Why redundancy is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RedundancyLoss {
    /// The ring is open.
    Open,
    /// The ring passes frames one way only: the copies that are sent on this link do not come back.
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
pub struct LinkStatus {
    /// Whether the interface has a carrier; `None` where the links do not tell.
    pub carrier: Option<bool>,
    /// SubDevices that the frames sent on this link met last. In a closed straight ring all are met by those of MAIN.
    pub answering: u16,
    /// AL states of these, ORed: bits 0 to 3 as in register AL_STATUS.
    pub al_states: u8,
}

impl LinkStatus {
    /// The link is up: it has a carrier, or SubDevices answer on it where the carrier is not known.
    pub fn is_up(&self) -> bool {
        self.carrier.unwrap_or(self.answering > 0)
    }

    /// Whether somebody who answers on this link is in a state.
    pub fn has(&self, state: AlState) -> bool {
        // BOOT is a number of its own among the bits (protocol 5.1).
        self.al_states & state.code() == state.code()
    }
}

impl Cable {
    /// Positions at the near and at the far end.
    pub fn positions(&self) -> [Option<usize>; 2] {
        [self.near, self.far].map(|end| end.map(|at| at.node))
    }
}

/// The ring and both links.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RingStatus {
    /// Closed or open, as the frames show it.
    pub state: RingState,
    /// Whether another break would be survived.
    pub redundancy: Redundancy,
    /// By [`Link::index`].
    pub links: [LinkStatus; 2],
    /// Where the ring is broken, once that is known.
    pub place: Option<Cable>,
    /// Who is at the near and at the far end of that cable.
    pub place_ends: [Option<Occupant>; 2],
    /// How often the ring opened and closed since activation, also where that was too often to be told each time.
    pub changes: u32,
    /// It changes too often to be told each time.
    pub unsteady: bool,
}

impl RingStatus {
    /// A link.
    pub fn link(&self, link: Link) -> &LinkStatus {
        &self.links[link.index()]
    }

    /// SubDevices answer on the redundant link because the ring is broken: without it they would be lost
    /// (`redundancy_active` of the IgH manual).
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
    fn a_cable_is_named_by_its_ends() {
        let (near, far) = (Some(PortOf { node: 7, port: 1 }), Some(PortOf { node: 8, port: 0 }));
        assert_eq!(Cable { near, far }.to_string(), "between SubDevice 7 port 1 and SubDevice 8 port 0");
        let host = Cable { near: None, far: Some(PortOf { node: 0, port: 0 }) };
        assert_eq!(host.to_string(), "between the MAIN interface and SubDevice 0 port 0");
        let host = Cable { near, far: None };
        assert_eq!(host.to_string(), "between SubDevice 7 port 1 and the REDUNDANT interface");
    }

    // covers: ring-status
    #[test]
    fn redundancy_is_active_where_the_redundant_link_carries_somebody() {
        let mut status = RingStatus { state: RingState::Open, ..RingStatus::default() };
        status.links[0].answering = 5;
        assert!(!status.redundancy_active(), "all are on MAIN");
        status.links[1] = LinkStatus { carrier: None, answering: 2, al_states: 0x0C };
        assert!(status.redundancy_active());
        let redundant = status.link(Link::Redundant);
        assert!(redundant.is_up() && redundant.has(AlState::Op) && redundant.has(AlState::SafeOp));
        assert!(!redundant.has(AlState::PreOp));
        status.state = RingState::Closed;
        assert!(!status.redundancy_active(), "a branch on port 2 is met by the redundant copy of a closed ring");
    }
}
