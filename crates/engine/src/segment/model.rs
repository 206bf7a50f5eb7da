//! The model itself: what it holds, and what can be asked of it.

use alloc::sync::Arc;
use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;

use super::asked::Asked;
use super::attention::{Attention, Round};
use super::breaks::Breaks;
use super::cabling::Cabling;
use super::choices::Choices;
use super::clocks::Clocks;
use super::crossings::{Crossings, LineCheck};
use super::disturbance::{Disturbance, Slot};
use super::hot_connect::HotConnect;
use super::local_rings::LocalRings;
use super::member::Member;
use super::port_control::{BlockedPort, PortControl};
use super::ring::{Ring, Words};
use super::silence::Silence;
use super::unassigned::UnassignedSubDevice;
use crate::board::Board;
use crate::board::clocks::References;
use crate::declared::SubDeviceId;
use crate::layout::Layout;
use crate::ring_status::{Occupant, RingStatus};
use crate::time::Instant;

/// What is known, to begin with.
#[derive(Debug)]
pub struct Known {
    /// The declared SubDevices.
    pub members: Vec<Member>,
    /// SubDevices without a declaration.
    pub unassigned: Vec<UnassignedSubDevice>,
    /// Where process data lies.
    pub layout: Layout,
    /// How all of them are connected.
    pub cabling: Cabling,
    /// Distributed clocks.
    pub clocks: Clocks,
    /// What is known of the ring.
    pub ring: RingStatus,
    /// Carriers of the links.
    pub carriers: [Option<bool>; 2],
}

/// The model.
#[derive(Debug)]
pub struct Segment {
    /// The declared SubDevices.
    pub members: Vec<Member>,
    /// SubDevices that answer and have no declaration, or are not known to have one yet.
    pub unassigned: Vec<UnassignedSubDevice>,
    /// Where process data lies.
    pub layout: Layout,
    /// Connections, as the scan found them or a rescan after it.
    pub cabling: Cabling,
    /// Ports that were closed to cut SubDevices off.
    pub blocked: Vec<BlockedPort>,
    /// Orders to junctions of local rings about their ports.
    pub port_controls: Vec<PortControl>,
    pub(super) board: Arc<Board>,
    pub(super) choices: Choices,
    pub(super) ring: Ring,
    pub(super) clocks: Clocks,
    pub(super) breaks: Breaks,
    pub(super) local_rings: LocalRings,
    pub(super) silence: Silence,
    pub(super) crossings: Crossings,
    pub(super) hot_connect: HotConnect,
    pub(super) attention: Attention,
    pub(super) slot: Slot,
    /// How often the cabling was taken over from a look at the whole segment.
    pub(super) adoptions: u32,
}

impl Segment {
    /// The segment at activation.
    pub fn new(known: Known, board: Arc<Board>, choices: Choices) -> Segment {
        let Known { members, unassigned, layout, cabling, clocks, ring, carriers } = known;
        Segment {
            ring: Ring::new(ring, carriers),
            breaks: Breaks::default(),
            local_rings: LocalRings::new(&cabling, &members),
            silence: Silence::default(),
            crossings: Crossings::new(&cabling, &members, choices),
            hot_connect: HotConnect::new(&members, choices.follow_groups),
            attention: Attention::default(),
            slot: Slot::default(),
            adoptions: 0,
            blocked: Vec::new(),
            port_controls: Vec::new(),
            members,
            unassigned,
            layout,
            cabling,
            clocks,
            board,
            choices,
        }
    }

    /// When to look at what is posted though nothing else is posted.
    pub fn next_look(&self) -> Instant {
        self.attention.wake
    }

    /// Distributed clocks.
    pub fn clocks(&self) -> &Clocks {
        &self.clocks
    }

    /// The references that the exchange distributes; `None` while these are not the right ones, or stopped.
    pub fn references_in_use(&self) -> Option<References> {
        let (references, _) = self.board.clocks.references();
        (references == self.clocks.references() && !self.board.clocks.is_held()).then_some(references)
    }

    /// The ring and its links, as they were reported.
    pub fn ring_status(&self) -> RingStatus {
        self.ring.status
    }

    /// What puts SubDevices out of reach, or a link out of use, on purpose now.
    pub fn disturbance(&self) -> Option<Disturbance> {
        self.slot.running()
    }

    /// Whether the disturbance with this number is under way.
    pub fn is_granted(&self, number: u32) -> bool {
        self.slot.is_granted(number)
    }

    /// Whether a more urgent disturbance waits for the end of the one under way.
    pub fn is_outranked(&self) -> bool {
        self.slot.is_outranked()
    }

    /// Whether no frame comes back because of broken local rings.
    pub fn is_blocked(&self) -> bool {
        self.silence.is_blocked
    }

    /// What a question that is asked now is about.
    pub fn asked(&self) -> Asked {
        Asked { cabling: self.cabling.version, isolations: self.slot.isolations() }
    }

    /// The last round of looks.
    pub fn round(&self) -> Round {
        self.attention.round
    }

    /// Whether nothing has changed since the last round began.
    pub fn is_calm(&self, words: &Words) -> bool {
        !self.attention.has_changed(words, self.ring.reported())
    }

    /// Crossed lines as reported.
    pub fn told_crossings(&self) -> &LineCheck {
        self.crossings.told()
    }

    /// How often the cabling was taken over from a look at the whole segment.
    pub fn adoptions(&self) -> u32 {
        self.adoptions
    }

    /// Local rings whose cables are watched.
    pub fn has_local_rings(&self) -> bool {
        !self.local_rings.is_empty()
    }

    /// Which SubDevice is at each position of the cabling.
    pub fn occupants(&self) -> Vec<Occupant> {
        let at = |(node, station): (usize, &StationAddress)| Occupant {
            station: *station,
            declared: self.member_at(node).map(SubDeviceId),
        };
        self.cabling.stations.iter().enumerate().map(at).collect()
    }

    /// The SubDevice with a station address.
    pub fn occupant(&self, station: StationAddress) -> Occupant {
        Occupant { station, declared: self.member_of(station).map(SubDeviceId) }
    }

    /// The member at a position of the cabling.
    pub fn member_at(&self, node: usize) -> Option<usize> {
        self.members.iter().position(|member| member.node == Some(node))
    }

    /// The member with a station address.
    pub fn member_of(&self, station: StationAddress) -> Option<usize> {
        self.members.iter().position(|member| member.station == station)
    }

    /// The station address of the member at a place.
    pub fn station_of(&self, node: usize) -> Option<StationAddress> {
        self.members.iter().find(|member| member.node == Some(node)).map(|member| member.station)
    }

    /// Changes of hot connect groups so far.
    pub fn group_changes(&self) -> u32 {
        self.hot_connect.changes()
    }
}
