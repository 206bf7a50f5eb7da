//! Crossed lines in operation (facts 9.5): whenever ports of SubDevices have changed, the segment is looked at anew and
//! who is entered at another port than 0 is told, once.
//!
//! More rings behind junctions than are known are told too: whoever asked for junction redundancy must know that one of
//! them is not watched.
//!
//! One look proves little: cables that are cut and healed within milliseconds, and frames that get lost meanwhile, make a
//! straight ring look crossed. So a look counts only if the segment was the same before and behind it, and what it shows
//! beyond what was told is believed when the next one shows the same.
//!
//! In a closed ring that shows only that something is crossed (LC-02). In *enhanced* mode the redundant link is
//! disconnected under control meanwhile: the segment is an open line then, and each crossing has its place (LC-03). That
//! costs what a cut of that cable costs, and what mending it does; it is not told as a break.

use alloc::collections::BTreeSet;
use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::{Cell, RefCell};
use core::time::Duration;

use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::register::{DcReceiveTimes, DlStatus, PortKind, map};

use super::fleet::{Phase, SharedFleet};
use super::inspect::Look;
use super::junction::closings;
use super::latch::latch_anyway;
use super::strangers::{Stranger, view};
use crate::event::Event;
use crate::junction::JunctionMode;
use crate::link::{Link, LinkSet};
use crate::ring::RingState;
use crate::supervisor::{Bus, BusError};
use crate::topology::{Closing, Finding, NodeStatus, Topology, rings_shown, with_longer_rings};

/// From a change of ports until the segment is looked at: a plug that is pushed in bounces.
const SETTLE: Duration = Duration::from_millis(5);
/// Looks at a segment that changes meanwhile, or of which they show different things.
const ATTEMPTS: u8 = 5;
/// Pause between two of them.
const PAUSE: Duration = Duration::from_millis(10);
/// Until both ends of a link have noticed that it went or came, and frames have shown it. Interfaces take seconds to
/// find their partner again.
const LINK_LIMIT: Duration = Duration::from_secs(5);
/// Pause between two looks for that.
const LINK_PAUSE: Duration = Duration::from_millis(1);

/// A SubDevice that frames enter at another port than 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Crossing {
    /// Who, by the station address, and by the position now; `None` where only the ring shows that there is one.
    pub who: Option<(StationAddress, Position)>,
    /// The port of entry, where known.
    pub entry_port: Option<u8>,
}

/// What is known about SubDevices by their station addresses.
pub(super) trait Known {
    /// Kinds of the ports.
    fn ports(&self, station: StationAddress) -> [PortKind; 4];
    /// Closing cables of the local rings that are known, in a segment in which these are, by position.
    fn closings(&self, stations: &[StationAddress]) -> Vec<Closing>;
    /// Of all of these it is known who they are.
    fn are_known(&self, stations: &[StationAddress]) -> bool;
    /// Ports were read: those that have changed in between have told it to this look.
    fn note_look(&self);
    /// Clocks are being measured, which need the receive times of their own frame.
    fn are_measuring(&self) -> bool;
}

/// What a look at the segment shows.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Cabling {
    /// Who is crossed.
    pub crossings: Vec<Crossing>,
    /// Everybody is, in a ring: its interfaces are swapped.
    pub swapped: bool,
    /// Who else was looked at and is not crossed; empty where the ring was closed, which shows that of nobody.
    pub straight: Vec<StationAddress>,
    /// Rings behind junctions that are whole and not known.
    pub unknown_rings: usize,
}

/// Who is crossed, and which rings are not known; `None` where the segment changes too much to tell. `told` is what was told
/// of it before. With `in_control`, for a ring that [`stays_closed`], the redundant link is taken down meanwhile; where it
/// cannot be, that is reported, and the ring is looked at as it is.
pub(super) async fn cabling(bus: &Bus, known: &impl Known, in_control: bool, told: &Cabling) -> Option<Cabling> {
    if in_control && !bus.force_disconnect(Link::Redundant, true).await {
        bus.report(Event::CannotDisconnect { link: Link::Redundant });
        return look_often(bus, known, told).await;
    }
    if !in_control {
        return look_often(bus, known, told).await;
    }
    wait_for(bus, RingState::Open).await;
    let found = look_often(bus, known, told).await;
    bus.force_disconnect(Link::Redundant, false).await;
    wait_for(bus, RingState::Closed).await;
    // Carriers are looked at less often than frames come.
    let until = bus.now() + LINK_LIMIT;
    while bus.carriers().contains(&Some(false)) && bus.now() < until {
        bus.sleep(LINK_PAUSE).await;
    }
    found
}

async fn wait_for(bus: &Bus, state: RingState) {
    let until = bus.now() + LINK_LIMIT;
    while bus.ring() != state && bus.now() < until {
        bus.sleep(LINK_PAUSE).await;
        // Before activation nothing else shows it.
        let _ = bus.brd(map::TYPE, 1).await;
    }
}

/// Whether a ring of two links is closed, and still is a moment later, with the same SubDevices in the same places: a link
/// that is taken down in a ring that breaks costs those in between.
pub(super) async fn stays_closed(bus: &Bus) -> bool {
    if bus.links() != LinkSet::Ring || bus.ring() != RingState::Closed {
        return false;
    }
    let Ok(Some(before)) = view(bus).await else { return false };
    bus.sleep(PAUSE).await;
    matches!(view(bus).await, Ok(Some(after)) if after == before) && bus.ring() == RingState::Closed
}

/// Looks until one shows what was told already, or two in a row show the same.
async fn look_often(bus: &Bus, known: &impl Known, told: &Cabling) -> Option<Cabling> {
    let mut before = None;
    for attempt in 0..ATTEMPTS {
        if attempt > 0 {
            bus.sleep(PAUSE).await;
        }
        if known.are_measuring() {
            before = None;
            continue;
        }
        let found = look(bus, known).await.ok().flatten();
        known.note_look();
        if found.as_ref().is_some_and(|found| found.says_the_same_as(told) || before.as_ref() == Some(found)) {
            return found;
        }
        before = found;
    }
    None
}

/// What DL_STATUS says of all stations; `None` where one does not answer.
async fn ports_of(bus: &Bus, stations: &[StationAddress]) -> Result<Option<Vec<DlStatus>>, BusError> {
    let read = bus.gather(stations.to_vec(), |bus, station| async move {
        bus.fprd_array(station, map::DL_STATUS).await.map(|bytes| DlStatus::decode(&bytes))
    });
    match read.await.into_iter().collect::<Result<Vec<_>, BusError>>() {
        Ok(read) => Ok(Some(read)),
        Err(BusError::Wkc { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}

/// One look; `None` where something changed meanwhile.
async fn look(bus: &Bus, known: &impl Known) -> Result<Option<Cabling>, BusError> {
    let closed_before = bus.ring() == RingState::Closed;
    let Some(before) = view(bus).await?.filter(|view| known.are_known(&view.stations)) else { return Ok(None) };
    let Some(ports) = ports_of(bus, &before.stations).await? else { return Ok(None) };
    let _latches = latch_anyway(bus).await?;
    let read = bus.gather(before.stations.clone(), |bus, station| async move {
        // Without a clock nobody answers.
        match bus.fprd_array(station, map::DC_RECEIVE_TIME).await {
            Ok(bytes) => Ok(Some(DcReceiveTimes::decode(&bytes).ports.map(|time| time.0))),
            Err(BusError::Wkc { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    });
    let receive_times = read.await.into_iter().collect::<Result<Vec<_>, BusError>>()?;
    // A cable that went or came meanwhile has moved frames, ports or SubDevices to another place.
    let bits = |ports: &[DlStatus]| ports.iter().map(|it| it.bits() & PORT_BITS).collect::<Vec<_>>();
    let same_ports = ports_of(bus, &before.stations).await?.is_some_and(|now| bits(&now) == bits(&ports));
    let is_closed = bus.links() == LinkSet::Ring && bus.ring() == RingState::Closed;
    let same_ring = bus.links() == LinkSet::Single || is_closed == closed_before;
    if !same_ports || !same_ring || view(bus).await?.as_ref() != Some(&before) {
        return Ok(None);
    }
    let nodes = before.stations.iter().zip(ports).zip(receive_times).map(|((station, dl_status), receive_times)| {
        NodeStatus { dl_status, receive_times, ports: known.ports(*station) }
    });
    let nodes: Vec<NodeStatus> = nodes.collect();
    let closings = known.closings(&before.stations);
    let topology = with_longer_rings(&nodes, usize::from(before.counts.0.0), &closings);
    let mut found: Vec<Crossing> = topology
        .findings
        .iter()
        .filter_map(|finding| match *finding {
            Finding::CrossedLine { node, entry_port } => Some(Crossing {
                who: Some((before.stations[node], Position(node as u16))),
                entry_port: Some(entry_port),
            }),
            _ => None,
        })
        .collect();
    // In a closed ring only branches on port 2 and crossed SubDevices work on the redundant copy (LC-04).
    let on_redundant = before.counts.1.0 > 0;
    if found.is_empty() && is_closed && on_redundant {
        found.push(Crossing { who: None, entry_port: None });
    }
    // Odd ports and stubs of a broken ring would be counted wrongly.
    let is_plain = topology.findings.is_empty() && !on_redundant;
    let shown = if is_plain { rings_shown(&nodes, is_closed) } else { 0 };
    let swapped = bus.links() == LinkSet::Ring && is_swapped(&topology);
    let is_crossed = |station: &StationAddress| found.iter().any(|it| it.who.is_some_and(|(who, _)| who == *station));
    let straight = before.stations.iter().copied().filter(|station| !is_closed && !is_crossed(station)).collect();
    let unknown_rings = shown.saturating_sub(closings.len());
    Ok(Some(Cabling { crossings: found, swapped, straight, unknown_rings }))
}

/// Whether all of a ring are met the wrong way round: in a closed one by frames of the redundant link only, in an open one as
/// the findings say.
pub(super) fn is_swapped(topology: &Topology) -> bool {
    let crossed = |finding: &&Finding| matches!(finding, Finding::CrossedLine { .. });
    let count = topology.nodes.len();
    count > 0
        && ((topology.is_assumed() && topology.main_count == 0)
            || topology.findings.iter().filter(crossed).count() == count)
}

/// Looks out for changes of ports, and has crossings told once each.
#[derive(Debug)]
pub(super) struct CablingWatch {
    enhanced: bool,
    /// Rings behind junctions are watched.
    junctions: bool,
    /// What members said about their ports when the segment was looked at last.
    ports: Vec<Option<u16>>,
    /// That look has come to nothing.
    again: Rc<Cell<bool>>,
    busy: Rc<Cell<bool>>,
    told: Rc<RefCell<Cabling>>,
}

impl CablingWatch {
    /// Watches a fleet; what the scan told is not told again.
    pub fn new(fleet: &SharedFleet, enhanced: bool, junctions: JunctionMode) -> CablingWatch {
        let access = fleet.access();
        let told = access.topology.findings.iter().filter_map(|finding| match *finding {
            Finding::CrossedLine { node, entry_port } => {
                let member = access.members.iter().find(|member| member.node == Some(node))?;
                Some(Crossing { who: Some((member.station, Position(node as u16))), entry_port: Some(entry_port) })
            }
            _ => None,
        });
        let mut told = Cabling { crossings: told.collect(), ..Cabling::default() };
        if access.topology.is_assumed() {
            told.crossings.push(Crossing { who: None, entry_port: None });
        }
        told.swapped = is_swapped(&access.topology);
        let junctions = junctions != JunctionMode::Disabled || !access.topology.local_rings.is_empty();
        let told = Rc::new(told.into());
        CablingWatch { enhanced, junctions, ports: Vec::new(), again: Rc::default(), busy: Rc::default(), told }
    }

    /// Takes in looks at all members; where ports have changed, the segment is looked at.
    pub fn note(&mut self, bus: &Bus, fleet: &SharedFleet, looks: &[Look]) {
        let ports = |look: &Look| match look {
            Look::Answer { dl_status, .. } => Some(dl_status.bits() & PORT_BITS),
            Look::Unknown | Look::Silent | Look::Doubled => None,
        };
        let now: Vec<Option<u16>> = looks.iter().map(ports).collect();
        // Who is silent and not lost yet will be one or the other.
        let is_open = |(index, ports): (usize, &Option<u16>)| ports.is_none() && fleet.phase(index) != Phase::Absent;
        // Clocks that are being measured need the receive times of their own frame.
        let waits = self.busy.get() || fleet.clocks.are_measuring();
        // Who may be a member, and the end of a ring, is somebody else before it is known who he is.
        let waits = waits || !fleet.access().strangers.iter().all(Stranger::is_settled);
        let is_new = now != self.ports || self.again.get();
        if waits || !is_new || now.iter().enumerate().any(is_open) {
            return;
        }
        let first = self.ports.is_empty();
        self.again.set(false);
        self.ports = now;
        if first {
            return;
        }
        self.busy.set(true);
        let (bus, fleet) = (bus.clone(), fleet.clone());
        let (busy, told, enhanced) = (self.busy.clone(), self.told.clone(), self.enhanced);
        let (junctions, again) = (self.junctions, self.again.clone());
        bus.clone().spawn(async move {
            bus.sleep(SETTLE).await;
            // Only where the link is really taken down: a ring that breaks or closes meanwhile has to be told.
            let in_control = enhanced && stays_closed(&bus).await;
            fleet.set_controlled_break(in_control);
            let known = told.borrow().clone();
            let found = cabling(&bus, &fleet, in_control, &known).await;
            fleet.set_controlled_break(false);
            // Whose ports changed in between has told it to this look.
            fleet.note_news();
            // Where more than the places was not known, looking again soon would not help.
            again.set(found.is_none() && !in_control);
            if let Some(found) = found {
                tell(&bus, &fleet, &found, &told.borrow());
                if junctions && found.unknown_rings > told.borrow().unknown_rings {
                    bus.report(Event::JunctionUnknown { rings: found.unknown_rings });
                }
                let before = told.take();
                *told.borrow_mut() = before.and(found);
            }
            busy.set(false);
        });
    }
}

/// Bits of DL_STATUS that are about ports.
const PORT_BITS: u16 = 0xFFF0;

impl Cabling {
    /// Whether it adds nothing to what was told of a segment and takes nothing back.
    fn says_the_same_as(&self, told: &Cabling) -> bool {
        let who = |cabling: &Cabling| cabling.crossings.iter().map(Crossing::station).collect::<BTreeSet<_>>();
        who(self) == who(told) && self.swapped == told.swapped && self.unknown_rings <= told.unknown_rings
    }

    /// What was told and still stands, with what is new. A closed ring takes nothing back that an open one has shown, and
    /// an open one shows nothing of those who do not answer.
    fn and(mut self, found: Cabling) -> Cabling {
        if found.crossings.is_empty() {
            self.crossings.clear();
        }
        let straight = |it: &Crossing| it.who.is_some_and(|(station, _)| found.straight.contains(&station));
        self.crossings.retain(|it| !straight(it));
        let is_new = |it: &Crossing| !self.crossings.iter().any(|old| old.station() == it.station());
        let new: Vec<Crossing> = found.crossings.iter().copied().filter(is_new).collect();
        self.crossings.extend(new);
        Cabling {
            swapped: found.swapped || (self.swapped && !found.crossings.is_empty()),
            unknown_rings: self.unknown_rings.max(found.unknown_rings),
            crossings: self.crossings,
            straight: Vec::new(),
        }
    }
}

impl Crossing {
    fn station(&self) -> Option<StationAddress> {
        self.who.map(|(station, _)| station)
    }
}

fn tell(bus: &Bus, fleet: &SharedFleet, found: &Cabling, told: &Cabling) {
    if found.swapped {
        if !told.swapped {
            bus.report(Event::InterfacesSwapped);
        }
        return;
    }
    let is_told = |new: &Crossing| match new.who {
        Some((station, _)) => told.crossings.iter().any(|old| old.station() == Some(station)),
        // Who it is may be known from when the ring was open.
        None => !told.crossings.is_empty(),
    };
    for crossing in found.crossings.iter().filter(|new| !is_told(new)) {
        let position = crossing.who.map(|(station, now)| {
            let access = fleet.access();
            let member = access.members.iter().find(|member| member.station == station);
            member.and_then(|member| member.node).map_or(now, |node| Position(node as u16))
        });
        let event = Event::LineCrossed { position, entry_port: crossing.entry_port };
        match crossing.who {
            Some((station, _)) => bus.report_of(event, fleet.access().occupant(station)),
            None => bus.report(event),
        }
    }
}

impl Known for SharedFleet {
    fn note_look(&self) {
        self.note_news();
    }

    fn are_measuring(&self) -> bool {
        self.clocks.are_measuring()
    }

    fn ports(&self, station: StationAddress) -> [PortKind; 4] {
        let access = self.access();
        let member = access.members.iter().find(|member| member.station == station);
        member.and_then(|member| member.info.as_ref()).map(|info| info.controller.ports).unwrap_or_default()
    }

    fn closings(&self, stations: &[StationAddress]) -> Vec<Closing> {
        closings(&self.access(), stations)
    }

    fn are_known(&self, stations: &[StationAddress]) -> bool {
        let access = self.access();
        let is_member = |station: &StationAddress| access.members.iter().any(|member| member.station == *station);
        let stranger = |station: &StationAddress| access.strangers.iter().find(|it| it.station == *station);
        stations.iter().all(|station| is_member(station) || stranger(station).is_some_and(Stranger::is_settled))
    }
}
