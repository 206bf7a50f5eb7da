//! The data of the model, and its queries.

use alloc::rc::Rc;
use alloc::sync::Arc;
use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::DlControl;

use super::addresses::Addresses;
use super::attention::{Attention, Round};
use super::breaks::Breaks;
use super::cable_watch::CableWatch;
use super::cabling::Cabling;
use super::choices::Choices;
use super::clocks::{ClockVersions, Clocks};
use super::crossings::{Crossings, LineCheck};
use super::disturbance::{Disturbance, Slot};
use super::hot_connect::HotConnect;
use super::idle::Idle;
use super::key::SubDeviceKey;
use super::link_order::LinkControl;
use super::local_rings::LocalRings;
use super::member::MemberView;
use super::port_control::{BlockedPort, PortControl};
use super::ring::Ring;
use super::scan::Found;
use super::silence::Silence;
use super::stage::Stage;
use super::subdevices::SubDevices;
use super::unassigned::UnassignedView;
use super::undeclared::Keeping;
use super::versions::Versions;
use super::wake::Wake;
use super::words::{Changes, Reader, Words};
use crate::board::Board;
use crate::board::clocks::References;
use crate::clocks::KnownClocks;
use crate::declared::SubDeviceId;
use crate::layout::Layout;
use crate::ring_status::{Occupant, RingStatus};
use crate::time::Instant;

/// What an application declares, compared with what the scan has found.
#[derive(Debug)]
pub struct Declared {
    /// The SubDevices, declared or not.
    pub subdevices: SubDevices,
    /// Layout of process data.
    pub layout: Layout,
    /// Connections of all SubDevices.
    pub cabling: Cabling,
    /// Distributed clocks.
    pub clocks: Clocks,
    /// State of the ring.
    pub ring: RingStatus,
    /// Carriers of the links.
    pub carriers: [Option<bool>; 2],
    /// Words for the cyclic half.
    pub board: Arc<Board>,
}

impl Default for Declared {
    /// Nothing is declared.
    fn default() -> Declared {
        Declared {
            subdevices: SubDevices::default(),
            layout: Layout::default(),
            cabling: Cabling::default(),
            clocks: Clocks::undeclared(),
            ring: RingStatus::default(),
            carriers: [None; 2],
            board: Arc::new(Board::new(0)),
        }
    }
}

/// The model.
#[derive(Debug)]
pub struct Segment {
    pub(super) stage: Stage,
    /// Observations so far but those of words, clocks and orders, which supervision need not follow.
    pub(super) observed: u32,
    /// What posted words are compared with.
    pub(super) words: Reader,
    /// The SubDevices that were found, and those that are declared and absent.
    pub(super) subdevices: SubDevices,
    /// Number of the first attempts to configure the members: findings of an earlier application are refused.
    pub(super) first_attempt: u32,
    /// Layout of process data.
    pub(super) layout: Layout,
    /// Connections according to the scan or a later rescan.
    pub(super) cabling: Cabling,
    /// Ports that were closed to cut SubDevices off.
    pub(super) blocked: Vec<BlockedPort>,
    /// Commands to junctions of local rings about their ports.
    pub(super) port_controls: Vec<PortControl>,
    /// SubDevices with ports that are changed for a moment, and their settings before.
    pub(super) altered: Vec<(StationAddress, DlControl)>,
    pub(super) board: Arc<Board>,
    pub(super) choices: Choices,
    pub(super) ring: Ring,
    pub(super) clocks: Clocks,
    /// What is known of the clocks from a former application or another process.
    pub(super) known_clocks: Option<Rc<KnownClocks>>,
    pub(super) breaks: Breaks,
    /// Recent errors of the cables of a version of the cabling.
    pub(super) cable_watches: (u32, Vec<CableWatch>),
    pub(super) local_rings: LocalRings,
    pub(super) silence: Silence,
    pub(super) crossings: Crossings,
    pub(super) hot_connect: HotConnect,
    pub(super) attention: Attention,
    pub(super) slot: Slot,
    /// The link that is down on purpose.
    pub(super) link_control: LinkControl,
    pub(super) addresses: Addresses,
    pub(super) keeping: Keeping,
    pub(super) idle: Idle,
    /// How often the cabling of a rescan was taken over.
    pub(super) adoptions: u32,
    /// Until this time it is not necessary to test how many datagrams a frame may hold.
    pub(super) frames_tested_until: Instant,
}

impl Segment {
    /// A segment before the first scan.
    pub fn new(choices: Choices) -> Segment {
        Segment::of(Declared::default(), choices)
    }

    /// A segment with a declaration, of which nothing was observed.
    pub(super) fn of(declared: Declared, choices: Choices) -> Segment {
        let Declared { subdevices, layout, cabling, clocks, ring, carriers, board } = declared;
        Segment {
            stage: Stage::default(),
            observed: 0,
            words: Reader::default(),
            ring: Ring::new(ring, carriers),
            breaks: Breaks::default(),
            cable_watches: (0, Vec::new()),
            local_rings: LocalRings::new(&cabling, &subdevices),
            silence: Silence::default(),
            crossings: Crossings::new(&cabling, &subdevices, choices),
            hot_connect: HotConnect::new(&subdevices, choices.follow_groups),
            attention: Attention::default(),
            slot: Slot::default(),
            link_control: LinkControl::default(),
            addresses: Addresses::default(),
            keeping: Keeping::default(),
            idle: Idle::default(),
            adoptions: 0,
            frames_tested_until: Instant::default(),
            blocked: Vec::new(),
            port_controls: Vec::new(),
            altered: Vec::new(),
            subdevices,
            first_attempt: 0,
            layout,
            cabling,
            clocks,
            known_clocks: None,
            board,
            choices,
        }
    }

    /// The SubDevices of the last scan; `None` before a successful scan.
    pub fn found(&self) -> Option<&Rc<Found>> {
        self.stage.scanned().map(|scanned| &scanned.found)
    }

    /// Whether a scan is under way.
    pub fn is_scanning(&self) -> bool {
        matches!(self.stage, Stage::Scanning { .. })
    }

    /// Number of the scan that has begun last.
    pub fn scan_number(&self) -> u32 {
        self.addresses.version()
    }

    /// Whether another scan is under way than that with this number.
    pub fn has_another_scan(&self, number: u32) -> bool {
        self.is_scanning() && self.scan_number() != number
    }

    /// Whether a scan that the application has requested is under way.
    pub fn is_requested_scan_under_way(&self) -> bool {
        matches!(self.stage, Stage::Scanning { is_requested: true })
    }

    /// Changes of the segment that posted words have shown since the application began.
    pub fn changes(&self) -> Changes {
        self.words.before.changes
    }

    /// Number of observations that supervision has to follow; it changes with each.
    pub fn observed(&self) -> u32 {
        self.observed
    }

    /// Whether an application is active.
    pub fn is_active(&self) -> bool {
        matches!(self.stage, Stage::Active(_))
    }

    /// Number of the next request for a disturbance.
    pub fn next_disturbance(&self) -> u32 {
        self.slot.next_number()
    }

    /// The SubDevices that were found, and those that are declared and absent.
    pub fn subdevices(&self) -> &SubDevices {
        &self.subdevices
    }

    /// The declared SubDevices, by their indices in the declaration.
    pub fn members(&self) -> impl Iterator<Item = MemberView<'_>> + Clone {
        self.subdevices.members()
    }

    /// The SubDevice with an index in the declaration.
    pub fn member(&self, index: usize) -> Option<MemberView<'_>> {
        self.subdevices.member(index)
    }

    /// The unassigned SubDevice with a key, unless it has left.
    pub fn unassigned(&self, key: SubDeviceKey) -> Option<UnassignedView<'_>> {
        self.subdevices.unassigned().find(|it| it.key == key)
    }

    /// Layout of process data.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Connections according to the scan or a later rescan.
    pub fn cabling(&self) -> &Cabling {
        &self.cabling
    }

    /// Ports that were closed to cut SubDevices off.
    pub fn blocked(&self) -> &[BlockedPort] {
        &self.blocked
    }

    /// Station addresses by position: those of the last scan, or of the rescan that was taken over.
    pub fn stations_by_position(&self) -> Vec<StationAddress> {
        match &self.stage {
            Stage::Unscanned | Stage::Scanning { .. } => Vec::new(),
            Stage::Scanned(scanned) => scanned.found.stations(),
            Stage::Active(_) => self.cabling.stations.clone(),
        }
    }

    /// The next evaluation if no words are posted before.
    pub fn next_evaluation(&self) -> Wake {
        self.attention.wake
    }

    /// Distributed clocks.
    pub fn clocks(&self) -> &Clocks {
        &self.clocks
    }

    /// What is known of the clocks for their next set-up.
    pub fn known_clocks(&self) -> Option<Rc<KnownClocks>> {
        self.clocks.known().map(Rc::new).or_else(|| self.known_clocks.clone())
    }

    /// The references that the exchange distributes; `None` while they are outdated or the distribution is stopped.
    pub fn references_in_use(&self) -> Option<References> {
        let (references, _) = self.board.clocks.references();
        (references == self.clocks.references() && !self.board.clocks.is_held()).then_some(references)
    }

    /// State of the ring and its links as reported.
    pub fn ring_status(&self) -> RingStatus {
        self.ring.status
    }

    /// The procedure that now puts SubDevices out of reach, or a link out of use, on purpose.
    pub fn disturbance(&self) -> Option<Disturbance> {
        self.slot.running()
    }

    /// The answer of the link layer to the order that a procedure has given.
    pub fn link_answer(&self) -> Option<bool> {
        self.link_control.answer()
    }

    /// Whether an order has disconnected a link that is not known to be up again.
    pub fn is_link_returning(&self) -> bool {
        self.link_control.is_returning()
    }

    /// Whether a link is disconnected on purpose.
    pub fn is_link_down(&self) -> bool {
        self.link_control.is_down()
    }

    /// Whether the disturbance with this number is under way.
    pub fn is_granted(&self, number: u32) -> bool {
        self.slot.is_granted(number)
    }

    /// Whether a more urgent disturbance waits for the end of the one under way.
    pub fn is_outranked(&self) -> bool {
        self.slot.is_outranked()
    }

    /// Whether no frame returns because of broken local rings.
    pub fn is_blocked(&self) -> bool {
        self.silence.is_blocked
    }

    /// The version of the model, for a procedure that starts now.
    pub fn versions(&self) -> Versions {
        Versions {
            cabling: self.cabling.version,
            isolations: self.slot.isolations(),
            addresses: self.addresses.version(),
        }
    }

    /// The version of the clocks, for a procedure that starts now.
    pub fn clock_versions(&self) -> ClockVersions {
        let (isolations, holds) = (self.slot.isolations(), self.board.clocks.holds());
        ClockVersions { changes: self.clocks.changes, isolations, holds }
    }

    /// Whether no SubDevice was out of reach on purpose since this number of isolations.
    pub(super) fn was_all_in_reach(&self, isolations: u32) -> bool {
        self.slot.running() != Some(Disturbance::IsolateRings) && isolations == self.slot.isolations()
    }

    /// Whether station addresses are those of this version.
    pub(super) fn are_addresses_as_in(&self, versions: Versions) -> bool {
        versions.addresses == self.addresses.version()
    }

    /// Whether positions and station addresses that were requested in this version are still those of the segment.
    pub fn are_places_valid(&self, versions: Versions) -> bool {
        self.was_all_in_reach(versions.isolations) && self.are_addresses_as_in(versions)
    }

    /// Whether enough searches for SubDevices have failed for a test of the number of datagrams per frame.
    pub fn are_frames_doubtful(&self) -> bool {
        self.addresses.are_frames_doubtful()
    }

    /// Earliest time of the next test of how many datagrams a frame may hold.
    pub fn next_frame_test(&self) -> Instant {
        self.frames_tested_until
    }

    /// The last round of reads.
    pub fn round(&self) -> Round {
        self.attention.round
    }

    /// Whether nothing has changed since the last round began.
    pub fn is_calm(&self, words: &Words) -> bool {
        !self.attention.has_changed(&self.words, words, self.ring.reported())
    }

    /// Crossed lines as reported.
    pub fn reported_crossings(&self) -> &LineCheck {
        self.crossings.reported()
    }

    /// The temporary station address that was given last.
    pub fn last_offered(&self) -> StationAddress {
        self.addresses.last()
    }

    /// How often the cabling of a rescan was taken over.
    pub fn adoptions(&self) -> u32 {
        self.adoptions
    }

    /// Whether cables of local rings are monitored.
    pub fn has_local_rings(&self) -> bool {
        !self.local_rings.is_empty()
    }

    /// The SubDevice at each position of the cabling.
    pub fn occupants(&self) -> Vec<Occupant> {
        let at = |(node, station): (usize, &StationAddress)| Occupant {
            station: *station,
            declared: self.subdevices.member_at(node).map(SubDeviceId),
        };
        self.cabling.stations.iter().enumerate().map(at).collect()
    }

    /// The SubDevice with a station address.
    pub fn occupant(&self, station: StationAddress) -> Occupant {
        Occupant { station, declared: self.subdevices.member_of(station).map(SubDeviceId) }
    }

    /// The station address of the member at a place.
    pub fn station_of(&self, node: usize) -> Option<StationAddress> {
        self.members().find(|member| member.node == Some(node)).map(|member| member.station)
    }

    /// Changes of hot connect groups so far.
    pub fn group_changes(&self) -> u32 {
        self.hot_connect.changes()
    }
}
