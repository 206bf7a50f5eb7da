//! Crossed lines in operation (facts 9.5): whenever ports of SubDevices have changed, the segment is looked at anew and
//! who is entered at another port than 0 is told, once.
//!
//! More rings behind junctions than are known are told too: whoever asked for junction redundancy must know that one of
//! them is not watched.
//!
//! In a closed ring that shows only that something is crossed (LC-02). In *enhanced* mode the redundant link is
//! disconnected under control meanwhile: the segment is an open line then, and each crossing has its place (LC-03). That
//! costs what a cut of that cable costs, and what mending it does; it is not told as a break.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::{Cell, RefCell};
use core::time::Duration;

use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::register::{DcReceiveTimes, DlStatus, PortKind, map};

use super::fleet::{Phase, SharedFleet};
use super::inspect::Look;
use super::junction::closings;
use super::strangers::{Stranger, view};
use crate::event::Event;
use crate::junction::JunctionMode;
use crate::link::{Link, LinkSet};
use crate::ring::RingState;
use crate::supervisor::{Bus, BusError};
use crate::topology::{Closing, Finding, NodeStatus, Topology, rings_shown, with_longer_rings};

/// From a change of ports until the segment is looked at: a plug that is pushed in bounces.
const SETTLE: Duration = Duration::from_millis(5);
/// Looks at a segment that changes meanwhile.
const ATTEMPTS: u8 = 3;
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

/// Who is crossed, and which rings are not known; `None` where the segment changes too much to tell. With `enhanced` and
/// a closed ring the redundant link is taken down meanwhile; where it cannot be, that is reported, and the ring is looked
/// at as it is.
pub(super) async fn cabling(bus: &Bus, known: &impl Known, enhanced: bool) -> Option<Cabling> {
    let in_control = enhanced && bus.links() == LinkSet::Ring && bus.ring() == RingState::Closed;
    if in_control && !bus.force_disconnect(Link::Redundant, true).await {
        bus.report(Event::CannotDisconnect { link: Link::Redundant });
        return look_often(bus, known).await;
    }
    if !in_control {
        return look_often(bus, known).await;
    }
    wait_for(bus, RingState::Open).await;
    let found = look_often(bus, known).await;
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

async fn look_often(bus: &Bus, known: &impl Known) -> Option<Cabling> {
    for attempt in 0..ATTEMPTS {
        if attempt > 0 {
            bus.sleep(PAUSE).await;
        }
        if let Ok(Some(found)) = look(bus, known).await {
            return Some(found);
        }
    }
    None
}

async fn look(bus: &Bus, known: &impl Known) -> Result<Option<Cabling>, BusError> {
    let Some(before) = view(bus).await?.filter(|view| known.are_known(&view.stations)) else { return Ok(None) };
    bus.bwr(map::DC_RECEIVE_TIME, &[0; 4]).await?;
    let read = bus.gather(before.stations.clone(), |bus, station| async move {
        let dl_status = DlStatus::decode(&bus.fprd_array(station, map::DL_STATUS).await?);
        // Without a clock nobody answers.
        let receive_times = match bus.fprd_array(station, map::DC_RECEIVE_TIME).await {
            Ok(bytes) => Some(DcReceiveTimes::decode(&bytes).ports.map(|time| time.0)),
            Err(BusError::Wkc { .. }) => None,
            Err(error) => return Err(error),
        };
        Ok((station, dl_status, receive_times))
    });
    let read = match read.await.into_iter().collect::<Result<Vec<_>, BusError>>() {
        Ok(read) => read,
        Err(BusError::Wkc { .. }) => return Ok(None),
        Err(error) => return Err(error),
    };
    let nodes = read.into_iter().map(|(station, dl_status, receive_times)| NodeStatus {
        dl_status,
        receive_times,
        ports: known.ports(station),
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
    let is_closed = bus.links() == LinkSet::Ring && bus.ring() == RingState::Closed;
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
            let in_control = enhanced && bus.links() == LinkSet::Ring && bus.ring() == RingState::Closed;
            fleet.set_controlled_break(in_control);
            let found = cabling(&bus, &fleet, enhanced).await;
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
