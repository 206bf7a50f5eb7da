//! The model of the segment: what is known of SubDevices, cables, rings and links after activation, and what follows
//! from what is seen of them.
//!
//! A pure machine: [`Segment::observe`] takes in one [`Observation`] and returns the [`Effects`]: events to tell,
//! procedures to start. Nothing else changes it. It sends nothing and waits for nothing; procedures do that, and report
//! what they found as observations. What the cyclic half must know is posted to the board within `observe`, before
//! anything else follows.
//!
//! Looking takes time, and the segment moves on meanwhile. So findings come with what they were asked of ([`Asked`],
//! the number of an attempt), and what is out of date is refused.

mod asked;
mod attention;
mod breaks;
mod cabling;
mod crossings;
mod damper;
pub mod disturbance;
pub mod effect;
mod group_matching;
mod hot_connect;
mod local_rings;
mod look;
mod matching;
pub mod member;
mod members;
mod neighbours;
mod observation;
mod owners;
mod port_control;
mod recabling;
pub mod retrace;
mod ring;
pub mod setup;
mod silence;
pub mod start;
pub mod unassigned;
pub mod view;

use alloc::sync::Arc;
use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;

pub use asked::Asked;
pub use attention::Round;
pub use cabling::{Cabling, stations_by_position};
pub use crossings::{Crossing, LineCheck, PORT_BITS, is_swapped};
pub use hot_connect::counts;
pub use local_rings::is_down;
pub use look::Look;
pub use members::Looked;
pub use observation::{Observation, ProcessDataStep};
pub use owners::Owners;
pub use port_control::{BlockedPort, PortControl};
pub use recabling::Seen;
pub use ring::Words;

use attention::Attention;
use breaks::Breaks;
use crossings::Crossings;
use disturbance::{Disturbance, Slot};
use effect::Effects;
use hot_connect::HotConnect;
use local_rings::LocalRings;
use member::Member;
use ring::{Cabled, Ring};
use silence::Silence;
use unassigned::UnassignedSubDevice;

use crate::board::Board;
use crate::junction::JunctionMode;
use crate::layout::Layout;
use crate::ring_status::{Occupant, RingStatus};
use crate::time::Instant;

/// What is chosen at activation.
#[derive(Clone, Copy, Debug)]
pub struct Choices {
    /// The redundant link is taken down for a moment where a closed ring has crossed lines (LC-03).
    pub enhanced_line_crossed: bool,
    /// Rings behind junctions.
    pub junctions: JunctionMode,
    /// The cabling is taken over when a hot connect group joins or leaves.
    pub follow_groups: bool,
}

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
    /// What junctions of local rings were told to do about their ports.
    pub port_controls: Vec<PortControl>,
    board: Arc<Board>,
    choices: Choices,
    ring: Ring,
    breaks: Breaks,
    local_rings: LocalRings,
    silence: Silence,
    crossings: Crossings,
    hot_connect: HotConnect,
    attention: Attention,
    slot: Slot,
    /// How often the cabling was taken over from a look at the whole segment.
    adoptions: u32,
}

impl Segment {
    /// The segment at activation.
    pub fn new(known: Known, board: Arc<Board>, choices: Choices) -> Segment {
        let Known { members, unassigned, layout, cabling, ring, carriers } = known;
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
            board,
            choices,
        }
    }

    /// Takes in what was seen. What follows is to be carried out in its order.
    pub fn observe(&mut self, seen: Observation<'_>, now: Instant) -> Effects {
        let mut effects = Effects::default();
        self.take(seen, now, &mut effects);
        self.hot_connect.observe(&self.members, &mut effects);
        effects
    }

    /// When to look at what is posted though nothing else is posted.
    pub fn next_look(&self) -> Instant {
        self.attention.wake
    }

    /// The ring and its links, as they were told.
    pub fn ring_status(&self) -> RingStatus {
        self.ring.status
    }

    /// What puts SubDevices out of reach, or a link out of use, on purpose now.
    pub fn disturbance(&self) -> Option<Disturbance> {
        self.slot.running()
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

    /// What was told of crossed lines.
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
        let at =
            |(node, station): (usize, &StationAddress)| Occupant { station: *station, declared: self.member_at(node) };
        self.cabling.stations.iter().enumerate().map(at).collect()
    }

    /// The SubDevice with a station address.
    pub fn occupant(&self, station: StationAddress) -> Occupant {
        Occupant { station, declared: self.member_of(station) }
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

    fn observe_words(&mut self, words: &Words, now: Instant, effects: &mut Effects) {
        let disturbance = self.slot.running();
        let cabled = Cabled { topology: &self.cabling.topology, cables: &self.cabling.cables };
        let ring = self.ring.observe(words, disturbance, &cabled, now, effects);
        let silence = self.observe_silence(words, now, effects);
        let reported = self.ring.reported();
        let look = self.attention.observe(words, reported, disturbance, now, effects);
        self.attention.wake = [ring, silence, Some(look)].into_iter().flatten().min().unwrap_or(Instant::NEVER);
    }
}

#[cfg(test)]
mod tests;
