//! Crossed lines in operation (protocol 9.5): whenever ports of SubDevices have changed, the segment is looked at anew
//! and each SubDevice that frames enter at another port than 0 is reported, once.
//!
//! More rings behind junctions than are known are reported too: an application that wants junction redundancy must know
//! that one of them is not watched.
//!
//! One look proves little: cables that are cut and healed within milliseconds, and frames that get lost meanwhile, make
//! a straight ring look crossed. So a look counts only if the segment was the same before and behind it, and what it
//! shows beyond what was reported is believed when the next one shows the same.
//!
//! In a closed ring that shows only that something is crossed (LC-02). In *enhanced* mode the redundant link is
//! disconnected under control meanwhile: the segment is an open line then, and each crossing has its place (LC-03).
//! That costs what a cut of that cable costs, and what mending it does; it is not told as a break.

use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::register::{DcReceiveTimes, DlStatus, PortKind, map};

use super::latch::latch_anyway;
use super::shared_segment::SharedSegment;
use super::unassigned::view;
use crate::event::Event;
use crate::link::{Link, LinkSet};
use crate::ring::RingState;
use crate::segment::disturbance::Disturbance;
use crate::segment::unassigned::UnassignedSubDevice;
use crate::segment::{Crossing, LineCheck, Observation, PORT_BITS, is_swapped, retrace};
use crate::supervisor::{Bus, BusError};
use crate::topology::{Closing, Finding, NodeStatus, rings_shown, with_longer_rings};

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

/// What is known about SubDevices by their station addresses.
pub(super) trait Known {
    /// Kinds of the ports.
    fn ports(&self, station: StationAddress) -> [PortKind; 4];
    /// Closing cables of the local rings that are known, in a segment in which these are, by position.
    fn closings(&self, stations: &[StationAddress]) -> Vec<Closing>;
    /// All of these are identified.
    fn are_known(&self, stations: &[StationAddress]) -> bool;
    /// Ports were read: those that have changed in between have told it to this look.
    fn note_look(&self);
    /// Clocks are being measured, which need the receive times of their own frame.
    fn are_measuring(&self) -> bool;
    /// The redundant link has to come up soon, since a more urgent disturbance waits for that.
    fn is_outranked(&self) -> bool;
}

/// Looks at the segment after a change of ports, and hands what it shows to the model.
pub(super) async fn examine(bus: Bus, segment: SharedSegment, enhanced: bool) {
    bus.sleep(SETTLE).await;
    // Only where the link is really taken down: a ring that breaks or closes meanwhile has to be told.
    let turn = match enhanced && stays_closed(&bus).await {
        true => segment.disturb(Disturbance::OpenByLink, LINK_LIMIT).await,
        false => None,
    };
    let in_control = turn.is_some();
    let told = segment.view().told_crossings().clone();
    let found = cabling(&bus, &segment, in_control, &told).await;
    drop(turn);
    segment.observe(Observation::LineChecked { found, in_control });
}

/// Crossed SubDevices, and rings that are not known; `None` where the segment changes too much to tell. `told` is what
/// was reported of it before. With `in_control`, for a ring that [`stays_closed`], the redundant link is taken down
/// meanwhile; where it cannot be, that is reported, and the ring is looked at as it is.
pub(super) async fn cabling(bus: &Bus, known: &impl Known, in_control: bool, told: &LineCheck) -> Option<LineCheck> {
    if in_control && !bus.force_disconnect(Link::Redundant, true).await {
        bus.report(Event::CannotDisconnect { link: Link::Redundant });
        return look_often(bus, known, told).await;
    }
    if !in_control {
        return look_often(bus, known, told).await;
    }
    wait_for(bus, known, RingState::Open).await;
    let found = look_often(bus, known, told).await;
    bus.force_disconnect(Link::Redundant, false).await;
    wait_for(bus, known, RingState::Closed).await;
    // A carrier that is still missing would be reported as lost. The links read it less often than frames come.
    let (until, signal) = (bus.now() + LINK_LIMIT, bus.signal());
    while bus.carriers().contains(&Some(false)) && bus.now() < until {
        bus.until_posted(bus.posted(), until, &signal, || false).await;
    }
    found
}

async fn wait_for(bus: &Bus, known: &impl Known, state: RingState) {
    let until = bus.now() + LINK_LIMIT;
    while bus.ring() != state && bus.now() < until && !known.is_outranked() {
        bus.sleep(LINK_PAUSE).await;
        // Before activation nothing else shows it.
        let _ = bus.brd(map::TYPE, 1).await;
    }
}

/// Whether a ring of two links is closed, and still is a moment later, with the same SubDevices in the same places: a
/// link that is taken down in a ring that breaks costs those in between.
pub(super) async fn stays_closed(bus: &Bus) -> bool {
    if bus.links() != LinkSet::Ring || bus.ring() != RingState::Closed {
        return false;
    }
    let Ok(Some(before)) = view(bus).await else { return false };
    bus.sleep(PAUSE).await;
    matches!(view(bus).await, Ok(Some(after)) if after == before) && bus.ring() == RingState::Closed
}

/// Looks until one shows what was reported already, or two in a row show the same.
async fn look_often(bus: &Bus, known: &impl Known, told: &LineCheck) -> Option<LineCheck> {
    let mut before = None;
    for attempt in 0..ATTEMPTS {
        if attempt > 0 {
            bus.sleep(PAUSE).await;
        }
        if known.is_outranked() {
            return None;
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
async fn look(bus: &Bus, known: &impl Known) -> Result<Option<LineCheck>, BusError> {
    let closed_before = bus.ring() == RingState::Closed;
    let Some(before) = view(bus).await?.filter(|view| known.are_known(&view.stations)) else { return Ok(None) };
    let Some(ports) = ports_of(bus, &before.stations).await? else { return Ok(None) };
    let _latches = latch_anyway(bus).await?;
    let read = bus.gather(before.stations.clone(), |bus, station| async move {
        // Without a clock it does not answer.
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
                subdevice: Some((before.stations[node], Position(node as u16))),
                entry_port: Some(entry_port),
            }),
            _ => None,
        })
        .collect();
    // In a closed ring only branches on port 2 and crossed SubDevices work on the redundant copy (LC-04).
    let on_redundant = before.counts.1.0 > 0;
    if found.is_empty() && is_closed && on_redundant {
        found.push(Crossing { subdevice: None, entry_port: None });
    }
    // Odd ports and stubs of a broken ring would be counted wrongly.
    let is_plain = topology.findings.is_empty() && !on_redundant;
    let shown = if is_plain { rings_shown(&nodes, is_closed) } else { 0 };
    let swapped = bus.links() == LinkSet::Ring && is_swapped(&topology);
    let is_crossed =
        |station: &StationAddress| found.iter().any(|it| it.subdevice.is_some_and(|(crossed, _)| crossed == *station));
    let straight = before.stations.iter().copied().filter(|station| !is_closed && !is_crossed(station)).collect();
    let unknown_rings = shown.saturating_sub(closings.len());
    Ok(Some(LineCheck { crossings: found, swapped, straight, unknown_rings }))
}

impl Known for SharedSegment {
    fn note_look(&self) {
        self.observe(Observation::LookAgain);
    }

    fn are_measuring(&self) -> bool {
        self.view().disturbance() == Some(Disturbance::OpenByPort)
    }

    fn is_outranked(&self) -> bool {
        let view = self.view();
        view.disturbance() == Some(Disturbance::OpenByLink) && view.is_outranked()
    }

    fn ports(&self, station: StationAddress) -> [PortKind; 4] {
        let view = self.view();
        let member = view.members.iter().find(|member| member.station == station);
        member.and_then(|member| member.info.as_ref()).map(|info| info.controller.ports).unwrap_or_default()
    }

    fn closings(&self, stations: &[StationAddress]) -> Vec<Closing> {
        retrace::closings(&self.view().cabling, stations)
    }

    fn are_known(&self, stations: &[StationAddress]) -> bool {
        let view = self.view();
        let is_settled = |station| view.unassigned(station).is_some_and(UnassignedSubDevice::is_settled);
        stations.iter().all(|station| view.member_of(*station).is_some() || is_settled(*station))
    }
}
