//! Measures how SubDevices are connected and how long frames take from clock to clock (protocol 7.1).
//!
//! A measurement does not disturb process data, so it may run at any time. But a frame passes each SubDevice of a
//! closed ring only once, which gives no round-trip time. Therefore the set-up opens every ring for a moment, with the
//! temporary loop setting, which the controller reverts without a further command. In the ring of two links the last
//! port is closed, in a ring behind a junction both ends of its closing cable. Cable times measured this way stay
//! valid, also if the cables are moved. Before process data is exchanged, the branches of forks without a clock are
//! closed one after the other as well ([`branches`]).

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{DlStatus, map};

use crate::clocks::wiring::{TREES, Wiring};
use crate::clocks::{Cables, Disagreement, Latched, Measured, Measurements, Passage, Segment, branches, port_times};
use crate::event::Subject;
use crate::link::{Link, LinkSet};
use crate::procedures::latch::{self as frames, Pauses};
use crate::procedures::loops::{TEMPORARY, controls, until_ring_is_closed, while_closed};
use crate::procedures::shared_segment::SharedSegment;
use crate::procedures::unassigned::view;
use crate::ring::RingState;
use crate::segment::Observation;
use crate::segment::clocks::{ClockFinding, ClockKey, ClockObservation, ClockVersions, Clocks, Node};
use crate::segment::disturbance::Disturbance;
use crate::supervisor::{Bus, BusError};
use crate::time::Instant;
use crate::topology::{Closing, NodeStatus, PortOf, Topology};

/// Bytes from DC_RECEIVE_TIME to the end of DC_RECEIVE_TIME_EPU.
const LATCHED_LEN: usize = 32;
/// Attempts in total to repeat a latch of which a datagram was lost.
const MOST_FAILURES: u32 = 16;
/// Attempts to survey a segment that changes during the survey.
const SCANS: u32 = 3;
/// Maximum wait for other disturbances before rings are opened.
const LIMIT: Duration = Duration::from_secs(5);
/// Maximum wait until a ring whose ports have opened by themselves is seen closed.
const CLOSING: Duration = Duration::from_millis(50);
/// The SubDevices that answer, in the order in which frames pass them.
#[derive(Clone, Debug)]
struct Survey {
    /// Versions of the clocks when the survey began.
    versions: ClockVersions,
    stations: Vec<StationAddress>,
    dl_status: Vec<DlStatus>,
    topology: Topology,
    wiring: Wiring,
    is_closed: bool,
    /// Latched values since which no port has changed: usable as a measurement.
    latched: Option<Vec<Option<Latched>>>,
    /// Times of the ports after that of the processing unit, while all ports were as surveyed.
    port_times: Vec<Option<[u32; 4]>>,
    /// The link on which copies do not return while the ring is opened.
    no_return: Option<Link>,
    /// No branch is closed.
    is_whole: bool,
}

/// Ports that may be closed for a moment, for measuring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Opening {
    /// No ports.
    Nothing,
    /// Ports that make a ring a line: all SubDevices stay in reach.
    Rings,
    /// Branches too: no process data is exchanged yet.
    Branches,
}

/// Runs a measurement. For a set-up, that of a former one is enough if nothing has changed since.
pub(super) async fn measure(bus: &Bus, segment: &SharedSegment, opening: Opening) -> Result<Measured, String> {
    let mut survey = survey_segment(bus, segment).await?;
    if opening != Opening::Nothing
        && let Some(measured) = recall(bus, segment, &survey)
    {
        return Ok(measured);
    }
    let rings = survey.whole_rings();
    if opening != Opening::Nothing && !rings.is_empty() {
        survey.latched = None;
        measure_open(bus, segment, &survey, &rings, &[]).await?;
    }
    let mut measured = take(bus, segment, &survey).await?;
    if opening == Opening::Branches && !measured.delays.unknown.is_empty() {
        survey.latched = None;
        measure_branches(bus, segment, &survey, &rings).await;
        measured = take(bus, segment, &survey).await?;
    }
    // The ring of two links that was open until now has one cable that was never measured. A local ring that was
    // connected as a whole, or came back with other cables, has several.
    let is_open = |measured: &Measured| measured.delays.is_shared || (measured.delays.is_guessed && survey.is_closed);
    let is_open_question = is_open(&measured);
    // Opening changes ports, which triggers another measurement: a ring whose opening gave no result is not opened
    // again.
    let gave_no_result = segment.view().clocks().opened_without_result.as_ref() == Some(&survey.wiring);
    if !is_open_question || opening != Opening::Nothing || rings.is_empty() || gave_no_result {
        let is_still_open = is_open_question && !rings.is_empty();
        let without_result = is_still_open.then_some(survey.wiring);
        segment.find_of_clocks(survey.versions, ClockFinding::OpenedWithoutResult(without_result));
        return exact(measured);
    }
    let survey = Survey { latched: None, ..survey.clone() };
    measure_open(bus, segment, &survey, &rings, &[]).await?;
    measured = take(bus, segment, &survey).await?;
    let without_result = is_open(&measured).then_some(survey.wiring);
    segment.find_of_clocks(survey.versions, ClockFinding::OpenedWithoutResult(without_result));
    exact(measured)
}

/// The measurement of a former set-up, if the survey shows the same segment.
fn recall(bus: &Bus, segment: &SharedSegment, survey: &Survey) -> Option<Measured> {
    let (known, reference) = {
        let view = segment.view();
        let (known, clocks) = (view.known_clocks()?, view.clocks());
        let passages = passages(clocks, &survey.stations);
        let latched = survey.latched.as_ref()?;
        let is_same = known.measured.is_of(&survey.stations, &survey.wiring, &passages, latched);
        (is_same.then_some(known)?, clocks.reference)
    };
    bus.step(Subject::Clocks, || "the segment is as it was measured before".to_string());
    segment.find_of_clocks(survey.versions, ClockFinding::Recalled(&known));
    Some(known.measured.clone().referred_to(reference))
}

fn passages(clocks: &Clocks, stations: &[StationAddress]) -> Vec<Passage> {
    stations.iter().map(|station| clocks.passage_of(*station)).collect()
}

/// An error if times contradict each other.
fn exact(measured: Measured) -> Result<Measured, String> {
    if measured.delays.is_contradictory {
        return Err("the cable times of a ring contradict each other, although it was opened".to_string());
    }
    Ok(measured)
}

/// Opens rings, closes branches, measures cable times, and restores the ports.
async fn measure_open(
    bus: &Bus,
    segment: &SharedSegment,
    survey: &Survey,
    rings: &[PortOf],
    branches: &[PortOf],
) -> Result<(), String> {
    let mut wiring = survey.wiring.clone();
    wiring.open(branches);
    // An end of a ring in a closed branch needs no command, and could not receive the command that restores it.
    let links = if survey.is_closed { 1 } else { TREES };
    let passed: Vec<usize> = (0..links).flat_map(|link| wiring.path(link)).map(|arrival| arrival.at.node).collect();
    let is_reached = |at: &&PortOf| branches.is_empty() || passed.contains(&at.node);
    let all: Vec<PortOf> = rings.iter().chain(branches).filter(is_reached).copied().collect();
    let ports: Vec<(StationAddress, u8)> = all.iter().map(|at| (survey.stations[at.node], at.port)).collect();
    let asked_at = bus.now();
    let Some(turn) = segment.disturb(Disturbance::OpenByPort, LIMIT).await else {
        return Err("rings cannot be opened: another procedure needs their ports".to_string());
    };
    if bus.now() > asked_at {
        check_again(bus, segment, survey).await?;
    }
    let before = controls(bus, segment, &ports).await?;
    let mut open = survey.clone();
    open.wiring.open(&[rings, branches].concat());
    open.latched = None;
    open.is_whole = branches.is_empty();
    // The port at the end of a ring of two links is closed: frames on the redundant link do not return.
    open.no_return = survey.is_closed.then_some(Link::Redundant);
    let (result, is_restored) = while_closed(bus, segment, &before, &ports, take(bus, segment, &open)).await;
    if survey.is_closed {
        // The ports are open by now, unless the ring broke meanwhile.
        until_ring_is_closed(bus, if is_restored { TEMPORARY } else { CLOSING }).await;
    }
    drop(turn);
    result.map_err(|error| error.to_string())?.map(drop)
}

/// Other procedures had their turn since the survey: a ring that is open elsewhere by now must not be opened.
async fn check_again(bus: &Bus, segment: &SharedSegment, survey: &Survey) -> Result<(), String> {
    let now = survey_segment(bus, segment).await?;
    let is_same = (&now.stations, &now.wiring, now.is_closed) == (&survey.stations, &survey.wiring, survey.is_closed);
    if is_same { Ok(()) } else { Err("the segment has changed before its rings could be opened".to_string()) }
}

/// Measures the cables behind forks without a clock, branch by branch. Unmeasurable delays stay unknown.
async fn measure_branches(bus: &Bus, segment: &SharedSegment, survey: &Survey, rings: &[PortOf]) {
    let has_clock: Vec<bool> = {
        let view = segment.view();
        let has_clock = |station: &StationAddress| view.clocks().node_at(*station).is_some_and(|node| node.has_clock);
        survey.stations.iter().map(has_clock).collect()
    };
    let mut lines = survey.wiring.clone();
    lines.open(rings);
    for set in branches::sets(&lines, &has_clock) {
        let _ = measure_open(bus, segment, survey, rings, &set).await;
    }
}

impl Survey {
    /// The ports to close so that every ring is open.
    fn whole_rings(&self) -> Vec<PortOf> {
        let enters_at_port_0 = |node: usize| self.dl_status[node].ports[0].communication;
        self.wiring.whole_rings(&self.topology, self.is_closed, enters_at_port_0)
    }
}

async fn survey_segment(bus: &Bus, segment: &SharedSegment) -> Result<Survey, String> {
    for _ in 0..SCANS {
        let surveyed = survey_once(bus, segment).await;
        // The ECAT events of ports that changed before have been read and cleared by this survey, so another scan is
        // needed.
        segment.observe(Observation::RoundWanted);
        match surveyed {
            Ok(Some(survey)) => return Ok(survey),
            Ok(None) => {}
            Err(error) => return Err(error.to_string()),
        }
    }
    Err("SubDevices were added or lost repeatedly".to_string())
}

/// `None` while the segment changes.
async fn survey_once(bus: &Bus, segment: &SharedSegment) -> Result<Option<Survey>, BusError> {
    let versions = segment.view().clock_versions();
    let Some(before) = view(bus).await? else { return Ok(None) };
    let is_closed = bus.links() == LinkSet::Ring && bus.ring() == RingState::Closed;
    // Receive times show the port at which frames enter a SubDevice.
    let latched = match latch(bus, segment, &before.stations, None).await {
        Err(BusError::Wkc { .. }) => return Ok(None),
        other => other?.latched,
    };
    let read = bus.gather(before.stations.clone(), |bus, station| async move {
        Ok::<_, BusError>(DlStatus::decode(&bus.fprd_array(station, map::DL_STATUS).await?))
    });
    let dl_status = match read.await.into_iter().collect::<Result<Vec<_>, BusError>>() {
        Err(BusError::Wkc { .. }) => return Ok(None),
        other => other?,
    };
    let port_times = latched.iter().map(|latched| latched.as_ref().map(port_times)).collect();
    let (segment, counts) = (segment.view(), before.counts);
    let ports = |station: StationAddress| segment.clocks().node_at(station).map(|node| node.ports);
    let node = |position: usize| NodeStatus {
        dl_status: dl_status[position],
        receive_times: latched[position].map(|latched| latched.ports),
        ports: ports(before.stations[position]).unwrap_or_default(),
    };
    let place = |end: (StationAddress, u8)| Some(PortOf { node: before.position(end.0)?, port: end.1 });
    let closings = segment.present_closings().into_iter().filter_map(|[head, tail]| {
        let closing = Closing { head: place(head)?, tail: place(tail)? };
        (closing.head.node < closing.tail.node).then_some(closing)
    });
    let closings: Vec<Closing> = closings.collect();
    let nodes: Vec<NodeStatus> = (0..before.stations.len()).map(node).collect();
    let topology = Topology::with_local_rings(&nodes, usize::from(counts.0.0), &closings);
    let is_open = |at: PortOf| {
        let port = dl_status[at.node].ports[usize::from(at.port & 3)];
        port.communication && !port.loop_closed
    };
    let wiring = Wiring::new(&topology, is_closed, is_open);
    Ok(Some(Survey {
        versions,
        stations: before.stations,
        dl_status,
        topology,
        wiring,
        is_closed,
        latched: Some(latched),
        port_times,
        no_return: None,
        is_whole: true,
    }))
}

/// Latches several times without changing the segment.
async fn take(bus: &Bus, segment: &SharedSegment, survey: &Survey) -> Result<Measured, String> {
    let count = segment.view().clocks().config.measurements.clamp(1, 64);
    let entries = survey.wiring.entry_ports();
    let is_as_before = enter_backwards(bus, segment, &survey.stations, &entries).await;
    let mut measurements = Measurements::new(&survey.wiring);
    if let Some(latched) = survey.latched.as_ref().filter(|_| is_as_before) {
        measurements.add(latched.clone());
    }
    let count = count + measurements.count();
    let mut failures = 0;
    while measurements.count() < count {
        match latch(bus, segment, &survey.stations, survey.no_return).await {
            Ok(frame) => measurements.add(frame.latched),
            Err(error @ (BusError::Busy { .. } | BusError::Disturbed { .. })) => return Err(error.to_string()),
            Err(error) if failures >= MOST_FAILURES => return Err(error.to_string()),
            Err(_) => failures += 1,
        }
    }
    let (measured, cables) = evaluate(segment, survey, &measurements)?;
    segment.find_of_clocks(survey.versions, ClockFinding::Cables(cables));
    measured.ok_or_else(unfit)
}

/// Computes delays (`None` if latched receive times do not fit the cabling) and cable times.
fn evaluate(
    segment: &SharedSegment,
    survey: &Survey,
    measurements: &Measurements,
) -> Result<(Option<Measured>, Cables), String> {
    let view = segment.view();
    let clocks = view.clocks();
    let at = |station: StationAddress| survey.stations.iter().position(|at| *at == station);
    let is_there = |node: &Node| at(node.station).is_some();
    let reference = clocks.reference.filter(|station| at(*station).is_some());
    let reference = reference.or_else(|| clocks.elect(is_there));
    let on_clock = reference.and_then(at).unwrap_or(0);
    let passages = passages(clocks, &survey.stations);
    if let Some(odd) = measurements.disagreement(on_clock) {
        // If most latches of a port show impossible times, no frame enters there.
        return Err(if odd.is_possible() { describe(&odd, survey.stations[odd.node]) } else { unfit() });
    }
    let segment = Segment { wiring: &survey.wiring, stations: &survey.stations, passages: &passages };
    let mut cables = clocks.cables.clone();
    // Cables of closed branches keep their places.
    if survey.is_whole {
        segment.set_present(&mut cables);
    }
    let delays = segment.propagation(&measurements.mean(on_clock), on_clock, &mut cables);
    let (is_plausible, stations) = (!delays.is_implausible, survey.stations.clone());
    let (wiring, port_times) = (survey.wiring.clone(), survey.port_times.clone());
    let drift_ppb = measurements.drift_ppb(on_clock);
    let measured = Measured { stations, delays, drift_ppb, passages, wiring, port_times };
    Ok((is_plausible.then_some(measured), cables))
}

fn unfit() -> String {
    "receive times do not fit the cabling: a ring behind a junction may be unknown".to_string()
}

/// Describes measurements that disagree. Without figures, so that the same reason is reported once.
fn describe(odd: &Disagreement, station: StationAddress) -> String {
    match odd.port {
        Some(port) => format!(
            "receive times of station {station} at port {port} differ from measurement to measurement: frames of \
             another sender on the wire spoil them"
        ),
        None => format!(
            "the clock of station {station} does not go on from measurement to measurement like others: another sender \
             has receive times latched too"
        ),
    }
}

/// Writes DC_LATCH_MODE of controllers that latch in one direction only: the direction from which frames come (protocol
/// 3.12, 7.5). Returns whether all registers were right already.
async fn enter_backwards(bus: &Bus, segment: &SharedSegment, stations: &[StationAddress], entries: &[u8]) -> bool {
    let modes = segment.view().clocks().latch_modes(stations, entries);
    if modes.is_empty() {
        return true;
    }
    segment.observe_clocks(ClockObservation::LatchModes(&modes));
    let write = |bus: Bus, (key, backwards): (ClockKey, bool)| async move {
        bus.fpwr(key.station, map::DC_LATCH_MODE, &[u8::from(backwards)]).await
    };
    // SubDevices without the register do not increment the WKC.
    let _ = bus.gather(modes, write).await;
    false
}

/// One frame that clocks have latched.
pub(super) struct Frame {
    /// When the host sent it.
    pub sent_at: Instant,
    /// The times of each SubDevice that was asked; `None` without a clock or an answer.
    pub latched: Vec<Option<Latched>>,
}

/// Latches one frame in all clocks and reads the receive times of these SubDevices. Copies on the link `no_return` do
/// not return.
pub(super) async fn latch(
    bus: &Bus,
    segment: &SharedSegment,
    stations: &[StationAddress],
    no_return: Option<Link>,
) -> Result<Frame, BusError> {
    let (targets, pauses): (Vec<(StationAddress, bool)>, Pauses) = {
        let view = segment.view();
        let clocks = view.clocks();
        let lacks = |station| clocks.node_at(station).is_some_and(|node| !node.has_clock);
        let targets = stations.iter().map(|station| (*station, !lacks(*station)));
        (targets.collect(), if clocks.config.pauses { Pauses::Allowed } else { Pauses::Forbidden })
    };
    let latches = frames::latch(bus, pauses, no_return).await?;
    let read = bus.gather(targets, |bus, (station, has_clock)| async move {
        if !has_clock {
            return Ok(None);
        }
        let bytes: [u8; LATCHED_LEN] = match bus.fprd_array(station, map::DC_RECEIVE_TIME).await {
            Ok(bytes) => bytes,
            // A SubDevice that does not answer counts as one without a clock.
            Err(BusError::Wkc { .. }) => return Ok(None),
            Err(error) => return Err(error),
        };
        let word = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        let unit = u64::from(word(24)) | u64::from(word(28)) << 32;
        Ok(Some(Latched { ports: [word(0), word(4), word(8), word(12)], unit }))
    });
    let read: Vec<Option<Latched>> = read.await.into_iter().collect::<Result<_, _>>()?;
    // A SubDevice that the frame has not passed still has the times of an earlier frame.
    let answered = Wkc(read.iter().flatten().count() as u16);
    if latches.answered.0 < answered.0 {
        let target = Target::Broadcast(map::DC_RECEIVE_TIME);
        return Err(BusError::Wkc { target, expected: answered, got: latches.answered });
    }
    Ok(Frame { sent_at: latches.sent_at, latched: read })
}
