//! Crossed lines in operation (protocol 9.5): after each change of ports the segment is scanned again, and each
//! SubDevice that frames enter at another port than 0 is reported once.
//!
//! Unknown rings behind junctions are reported too: an application with junction redundancy needs the information that
//! one of them is not monitored.
//!
//! One scan is no proof: cables that are cut and healed within milliseconds, and lost frames, make a straight ring seem
//! crossed. So a scan counts only if the segment was the same before and after it, and a new finding is reported only
//! if the next scan shows the same.
//!
//! A closed ring shows only that a SubDevice is crossed (LC-02), not which. In *enhanced* mode the redundant link is
//! disconnected on purpose during the scan: the segment is then an open line, and each crossing has a position (LC-03).
//! This costs as many cycles as a cut of that cable and its repair; it is not reported as a break.

use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::register::{DcReceiveTimes, DlStatus, PortKind, map};

use super::latch::latch_anyway;
use super::shared_segment::SharedSegment;
use super::unassigned::view;
use crate::event::Notice;
use crate::link::{Link, LinkSet};
use crate::ring::RingState;
use crate::segment::disturbance::Disturbance;
use crate::segment::{Crossing, LineCheck, LinkObservation, Observation, PORT_BITS, SubDevice, is_swapped, retrace};
use crate::supervisor::{Bus, BusError};
use crate::topology::{Closing, Finding, NodeStatus, rings_shown, with_longer_rings};

/// Time from a change of ports to the scan: contacts of a plug bounce.
const SETTLE: Duration = Duration::from_millis(5);
/// Scans of a segment that changes during the scan, or while two scans differ.
const ATTEMPTS: u8 = 5;
/// Pause between two scans.
const PAUSE: Duration = Duration::from_millis(10);
/// Limit until both ends of a link have detected that it went down or up, and frames have shown it. Interfaces need
/// seconds to establish a link.
const LINK_LIMIT: Duration = Duration::from_secs(5);
/// Limit until frames have shown a change of a link that has a carrier, if the ring may have been broken meanwhile.
const FRAME_LIMIT: Duration = Duration::from_millis(200);
/// Interval of the check for it.
const LINK_PAUSE: Duration = Duration::from_millis(1);

/// Known data of SubDevices by their station addresses.
pub(super) trait Known {
    /// Kinds of the ports.
    fn ports(&self, station: StationAddress) -> [PortKind; 4];
    /// Closing cables of the known local rings, in a segment with these SubDevices by position.
    fn closings(&self, stations: &[StationAddress]) -> Vec<Closing>;
    /// All of these are identified.
    fn are_known(&self, stations: &[StationAddress]) -> bool;
    /// Ports were read: this cleared the ECAT events of ports that changed before.
    fn note_port_scan(&self);
    /// Clocks are being measured; the receive times must be those of the measurement's frame.
    fn are_measuring(&self) -> bool;
    /// A more urgent disturbance waits until the redundant link is up.
    fn is_outranked(&self) -> bool;
    /// The model, which has the link that is down on purpose.
    fn segment(&self) -> &SharedSegment;
}

/// Scans the segment after a change of ports, and passes the result to the model.
pub(super) async fn examine(bus: Bus, segment: SharedSegment, enhanced: bool) {
    bus.sleep(SETTLE).await;
    // Only if the link is really taken down: a ring that opens or closes during the scan has to be reported.
    let turn = match enhanced && stays_closed(&bus).await {
        true => segment.disturb(Disturbance::OpenByLink, LINK_LIMIT).await,
        false => None,
    };
    let in_control = turn.is_some();
    let (versions, reported) = (segment.view().versions(), segment.view().reported_crossings().clone());
    let found = cabling(&bus, &segment, in_control, &reported).await;
    drop(turn);
    segment.observe(Observation::LineChecked { versions, found, in_control });
}

/// Crossed SubDevices, and unknown rings; `None` if the segment changes too often for a result. `reported` is the
/// result reported before. With `in_control`, for a ring that [`stays_closed`], the redundant link is taken down during
/// the scan; if it cannot be, that is reported, and the ring is scanned as it is.
pub(super) async fn cabling(
    bus: &Bus,
    known: &impl Known,
    in_control: bool,
    reported: &LineCheck,
) -> Option<LineCheck> {
    if in_control && !known.segment().force_disconnect(Link::Redundant, true).await {
        bus.notice(Notice::CannotDisconnect { link: Link::Redundant });
        return scan_until_confirmed(bus, known, reported).await;
    }
    if !in_control {
        return scan_until_confirmed(bus, known, reported).await;
    }
    wait_for(bus, known, RingState::Open, LINK_LIMIT).await;
    let found = scan_until_confirmed(bus, known, reported).await;
    known.segment().force_disconnect(Link::Redundant, false).await;
    wait_for(bus, known, RingState::Closed, LINK_LIMIT).await;
    until_carriers(bus).await;
    known.segment().observe(Observation::Link(LinkObservation::Connected));
    found
}

/// Waits until a link is up again that an ended procedure had taken down: until then a scan would find the ring open.
pub(crate) async fn until_link_returns(bus: &Bus, segment: &SharedSegment) {
    if !segment.view().is_link_returning() {
        return;
    }
    let is_up = segment.until(|model| (!model.is_link_down()).then_some(()));
    if bus.within(LINK_LIMIT, is_up).await.is_ok() {
        until_carriers(bus).await;
        wait_for(bus, segment, RingState::Closed, FRAME_LIMIT).await;
    }
    segment.observe(Observation::Link(LinkObservation::Connected));
}

/// Waits until all links have a carrier: a link without one would be reported as lost. The links are polled less often
/// than frames arrive.
async fn until_carriers(bus: &Bus) {
    let (until, signal) = (bus.now() + LINK_LIMIT, bus.signal());
    while bus.carriers().contains(&Some(false)) && bus.now() < until {
        bus.until_posted(bus.posted(), until, &signal, || false).await;
    }
}

async fn wait_for(bus: &Bus, known: &impl Known, state: RingState, limit: Duration) {
    let until = bus.now() + limit;
    while bus.ring() != state && bus.now() < until && !known.is_outranked() {
        bus.sleep(LINK_PAUSE).await;
        // Before activation no other frame shows it.
        let _ = bus.brd(map::TYPE, 1).await;
    }
}

/// Whether a ring of two links is closed, and still is a moment later, with the same SubDevices in the same positions:
/// taking a link down in a ring with a break would disconnect the SubDevices in between.
pub(super) async fn stays_closed(bus: &Bus) -> bool {
    if bus.links() != LinkSet::Ring || bus.ring() != RingState::Closed {
        return false;
    }
    let Ok(Some(before)) = view(bus).await else { return false };
    bus.sleep(PAUSE).await;
    matches!(view(bus).await, Ok(Some(after)) if after == before) && bus.ring() == RingState::Closed
}

/// Scans until a result equals the reported one, or two in a row are equal.
async fn scan_until_confirmed(bus: &Bus, known: &impl Known, reported: &LineCheck) -> Option<LineCheck> {
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
        let found = scan_once(bus, known).await.ok().flatten();
        known.note_port_scan();
        if found.as_ref().is_some_and(|found| found.adds_nothing_to(reported) || before.as_ref() == Some(found)) {
            return found;
        }
        before = found;
    }
    None
}

/// DL_STATUS of all stations; `None` if a station does not answer.
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

/// One scan; `None` if something changed meanwhile.
async fn scan_once(bus: &Bus, known: &impl Known) -> Result<Option<LineCheck>, BusError> {
    let closed_before = bus.ring() == RingState::Closed;
    let Some(before) = view(bus).await?.filter(|view| known.are_known(&view.stations)) else { return Ok(None) };
    let Some(ports) = ports_of(bus, &before.stations).await? else { return Ok(None) };
    let _latches = latch_anyway(bus, None).await?;
    let read = bus.gather(before.stations.clone(), |bus, station| async move {
        // A SubDevice without a clock does not increment the WKC.
        match bus.fprd_array(station, map::DC_RECEIVE_TIME).await {
            Ok(bytes) => Ok(Some(DcReceiveTimes::decode(&bytes).ports.map(|time| time.0))),
            Err(BusError::Wkc { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    });
    let receive_times = read.await.into_iter().collect::<Result<Vec<_>, BusError>>()?;
    // A cable that was cut or plugged in meanwhile has moved frames, ports or SubDevices.
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
    // In a closed ring only branches on port 2 and crossed SubDevices process the redundant copy (LC-04).
    let on_redundant = before.counts.1.0 > 0;
    if found.is_empty() && is_closed && on_redundant {
        found.push(Crossing { subdevice: None, entry_port: None });
    }
    // Unexpected ports and stubs of a broken ring would be counted wrongly.
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
    fn segment(&self) -> &SharedSegment {
        self
    }

    fn note_port_scan(&self) {
        self.observe(Observation::RoundWanted);
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
        let member = view.members().find(|member| member.station == station);
        member.and_then(|member| member.info).map(|info| info.controller.ports).unwrap_or_default()
    }

    fn closings(&self, stations: &[StationAddress]) -> Vec<Closing> {
        retrace::closings(self.view().cabling(), stations)
    }

    fn are_known(&self, stations: &[StationAddress]) -> bool {
        let view = self.view();
        let is_settled = |it: &SubDevice| it.as_unassigned().is_none_or(|it| it.is_settled());
        stations.iter().all(|station| view.subdevices().at(*station).is_some_and(is_settled))
    }
}
