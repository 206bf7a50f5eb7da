//! The ports of all SubDevices: links, neighbours, receive times, delays, error counters, with and without an
//! application (protocol 2.3 to 2.5, 7.1).
//!
//! Without an application frames are latched for the receive times, `SAMPLES` for a mean: a clock counts in steps of
//! 10 ns. A frame passes each SubDevice of a closed ring only once, so every ring is opened for this, of two links and
//! behind junctions. Its cable times are those of the open ring, the delays those of the closed one.
//! While an application is active its clocks own the latches: then the times are those of the last latched frame, and
//! the delays those that were measured.

use alloc::collections::BTreeMap;
use alloc::rc::Rc;
use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::address::{Position, StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{DcReceiveTimes, DlStatus, ErrorCounters, PortKind, map};

use super::ServiceError;
use super::open_ring::{Rings, while_open};
use crate::clocks::{Cables, Latched, Measurements, Wiring};
use crate::declared::{Address, SubDeviceId};
use crate::link::{Link, LinkSet};
use crate::procedures::idle::follow_ports;
use crate::procedures::latch::latch_anyway;
use crate::procedures::shared_segment::SharedSegment;
use crate::ring::RingState;
use crate::ring_status::cables;
use crate::segment::Segment;
use crate::supervisor::{Bus, BusError};
use crate::topology::{PortOf, Topology};

/// Frames that are latched for the delays.
const SAMPLES: usize = 8;

/// What is at the other end of the cable on a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Neighbour {
    /// An interface of the host.
    Interface(Link),
    /// A port of another SubDevice. A broken cable has its ends as well.
    SubDevice(PortOf),
}

/// One port, as its registers show it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct PortRegisters {
    /// The physical link is up (DL_STATUS, 0x0110).
    pub link: bool,
    /// The loop is closed: frames are not sent out of this port.
    pub loop_closed: bool,
    /// Communication is established.
    pub signal: bool,
    /// DC_RECEIVE_TIME (0x0900 and following): time at which the latched frame came in, in nanoseconds of the local
    /// clock, modulo 2^32; `None` without a clock.
    pub receive_time_ns: Option<u32>,
    /// RX_ERROR_COUNTER, invalid frames (0x0300): damaged on the cable of this port. All counters end at 255.
    pub invalid_frames: u8,
    /// RX_ERROR_COUNTER, symbol errors (0x0301).
    pub symbol_errors: u8,
    /// FORWARDED_RX_ERROR_COUNTER (0x0308): damaged before.
    pub forwarded_errors: u8,
    /// LOST_LINK_COUNTER (0x0310).
    pub lost_links: u8,
}

/// One port.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct PortReport {
    /// Kind of the port.
    pub kind: PortKind,
    /// The other end of its cable, by the last scan; `None` if nothing is connected.
    pub neighbour: Option<Neighbour>,
    /// Delay from this SubDevice to the neighbour in nanoseconds, processing included; `None` if one of them has no
    /// clock, or the delay is not known.
    pub delay_ns: Option<i64>,
    /// Its registers; all ports of a SubDevice that does not answer have none.
    pub registers: Option<PortRegisters>,
}

/// The ports of one SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SubDevicePorts {
    /// Its index in the active declaration, or its position if it has no declaration.
    pub subdevice: Address,
    /// Its position.
    pub position: Position,
    /// Its station address.
    pub station: StationAddress,
    /// Port 0 to 3.
    pub ports: [PortReport; 4],
    /// Delay from the reference clock in nanoseconds; before an application is active, and without distributed clocks,
    /// from the first SubDevice with a clock. `None` without a clock, or if it is not known: with rings behind
    /// junctions that the scan has not found, behind forks without a clock, on the other link than the first clock, and
    /// while the segment changes.
    pub delay_ns: Option<i64>,
    /// EPU_ERROR_COUNTER (0x030C); `None` if it does not answer.
    pub unit_errors: Option<u8>,
}

/// Receive times of one frame, by SubDevice.
type Sample = Vec<Option<Latched>>;

/// What is known before registers are read.
struct Known {
    stations: Vec<StationAddress>,
    topology: Topology,
    kinds: Vec<[PortKind; 4]>,
    has_clock: Vec<bool>,
    names: Vec<Address>,
    /// The ports as the last scan has found them; empty while active.
    scanned: Vec<(StationAddress, DlStatus)>,
    /// While active: delays by station, if they are measured.
    delays: Option<BTreeMap<StationAddress, i64>>,
}

impl Known {
    fn of(segment: &Segment) -> Option<Known> {
        let is_active = segment.is_active();
        let (stations, topology) = match segment.found().filter(|_| !is_active) {
            Some(found) => (found.stations(), found.topology.clone()),
            None if is_active => (segment.cabling().stations.clone(), segment.cabling().topology.clone()),
            None => return None,
        };
        let info = |station: &StationAddress| {
            let all = segment.subdevices().all().iter();
            let here = all.filter(|it| it.key.station == *station).find_map(|it| it.knowledge.info());
            here.map(|info| (info.controller.ports, info.controller.features.dc)).unwrap_or_default()
        };
        let found = segment.found().filter(|_| !is_active);
        let scanned = found.map(|found| found.subdevices.iter().map(|info| (info.station, info.dl_status)).collect());
        let (kinds, has_clock) = stations.iter().map(info).unzip();
        let name = |(position, station): (u16, &StationAddress)| {
            let member = segment.subdevices().member_of(*station).filter(|_| is_active);
            member.map_or(Address::Scanned(Position(position)), |index| SubDeviceId(index).into())
        };
        let names = (0..).zip(&stations).map(name).collect();
        let measured = || segment.clocks().status().into_iter().filter(|it| it.hidden.is_none());
        let delays = is_active.then(|| measured().map(|clock| (clock.station, clock.delay_ns)).collect());
        Some(Known { stations, topology, kinds, has_clock, names, scanned: scanned.unwrap_or_default(), delays })
    }

    /// Delays from the first clock. `cables`: known delays of cables; the delays that these frames show are added.
    fn propagation(&self, wiring: &Wiring, samples: Vec<Sample>, cables: &mut Cables) -> Option<Vec<Option<i64>>> {
        let reference = self.has_clock.iter().position(|clock| *clock)?;
        let mut measurements = Measurements::new(wiring);
        samples.into_iter().for_each(|sample| measurements.add(sample));
        if measurements.count() == 0 || measurements.disagreement(reference).is_some() {
            return None;
        }
        let passages = vec![Default::default(); self.stations.len()];
        let segment = crate::clocks::Segment { wiring, stations: &self.stations, passages: &passages };
        let delays = segment.propagation(&measurements.mean(reference), reference, cables);
        if delays.is_guessed || delays.is_implausible || delays.is_contradictory || delays.is_shared {
            return None;
        }
        Some((0..self.stations.len()).map(|node| delays.between(reference, node)).collect())
    }
}

/// Registers of one SubDevice.
struct Readings {
    ports: [PortRegisters; 4],
    dl_status: DlStatus,
    unit_errors: u8,
}

/// Reads the ports of all SubDevices, in the order of positions.
pub(crate) async fn read(bus: &Bus, segment: &SharedSegment) -> Result<Vec<SubDevicePorts>, ServiceError> {
    let Some(known) = Known::of(&segment.view()) else { return Ok(Vec::new()) };
    let known = Rc::new(known);
    if known.delays.is_none() {
        // The state of the ring is that of the last frames, which may be old without idle operation.
        let _ = bus.brd(map::TYPE, 1).await;
    }
    let is_closed = bus.links() == LinkSet::Ring && bus.ring() == RingState::Closed;
    let samples = match known.delays {
        Some(_) => Samples::default(),
        None => Samples::take(bus, segment, &known, is_closed).await,
    };
    let each: Vec<(StationAddress, bool)> =
        known.stations.iter().copied().zip(known.has_clock.iter().copied()).collect();
    let readings = bus.gather(each, |bus, (station, clock)| async move { one(&bus, station, clock).await.ok() }).await;
    // Reading the ports has cleared their ECAT events, which show a change.
    let ports_of = |readings: &Option<Readings>| readings.as_ref().map(|readings| readings.dl_status.ports);
    let is_as_scanned = known.scanned.iter().map(|(_, status)| Some(status.ports)).eq(readings.iter().map(ports_of));
    follow_ports(segment, is_as_scanned);
    let delays = match &known.delays {
        Some(delays) => known.stations.iter().map(|station| delays.get(station).copied()).collect(),
        None => samples.delays(&known).filter(|_| is_as_scanned).unwrap_or_else(|| vec![None; known.stations.len()]),
    };
    Ok(reports(&known, &readings, &delays, bus.links()))
}

/// Receive times of some frames without an application.
#[derive(Default)]
struct Samples {
    /// The cables that the frames used.
    wiring: Wiring,
    whole: Vec<Sample>,
    /// The ports that were closed so that every ring was open, and the frames meanwhile.
    ends: Vec<PortOf>,
    open: Vec<Sample>,
}

impl Samples {
    /// `is_closed`: the ring of two links is closed.
    async fn take(bus: &Bus, segment: &SharedSegment, known: &Rc<Known>, is_closed: bool) -> Samples {
        // Delays are reported only if the ports are still as scanned.
        let port = |at: PortOf| known.scanned.get(at.node).map(|(_, status)| status.ports[usize::from(at.port & 3)]);
        let is_open = |at: PortOf| port(at).is_some_and(|port| port.communication && !port.loop_closed);
        let enters = |node: usize| port(PortOf { node, port: 0 }).is_some_and(|port| port.communication);
        let wiring = Wiring::new(&known.topology, is_closed, is_open);
        let ends = wiring.whole_rings(&known.topology, is_closed, enters);
        let place = |end: &PortOf| Some((*known.stations.get(end.node)?, end.port));
        let ports: Vec<(StationAddress, u8)> = ends.iter().filter_map(place).collect();
        if ports.is_empty() {
            return Samples { wiring, whole: samples(bus, known, None).await, ..Samples::default() };
        }
        let rings = Rings { ports, status: known.scanned.clone() };
        let no_return = is_closed.then_some(Link::Redundant);
        let work = |no_return| {
            let (own_bus, own) = (bus.clone(), known.clone());
            async move { samples(&own_bus, &own, no_return).await }
        };
        match while_open(bus, segment, rings, work(no_return), work(None)).await {
            Some((open, whole)) => Samples { wiring, whole, ends, open },
            None => Samples::default(),
        }
    }

    /// Delays from the first clock, by the mean of the frames. None unless all cables are measured one by one: those of
    /// rings while they were open.
    fn delays(self, known: &Known) -> Option<Vec<Option<i64>>> {
        let Samples { mut wiring, whole, ends, open } = self;
        let (closed, mut cables) = (wiring.clone(), Cables::default());
        if !ends.is_empty() {
            wiring.open(&ends);
            known.propagation(&wiring, open, &mut cables)?;
        }
        known.propagation(&closed, whole, &mut cables)
    }
}

/// Receive times of some frames. Copies on the link `no_return` do not return.
async fn samples(bus: &Bus, known: &Known, no_return: Option<Link>) -> Vec<Sample> {
    let mut samples = Vec::new();
    while samples.len() < SAMPLES {
        // Lost frames leave fewer samples; another attempt costs time without end.
        let Ok(sample) = sample(bus, known, no_return).await else { break };
        samples.push(sample);
    }
    samples
}

/// Receive times of one frame; none of SubDevices without a clock or without an answer.
async fn sample(bus: &Bus, known: &Known, no_return: Option<Link>) -> Result<Sample, BusError> {
    let _latches = latch_anyway(bus, no_return).await?;
    let each: Vec<(StationAddress, bool)> =
        known.stations.iter().copied().zip(known.has_clock.iter().copied()).collect();
    let read = bus.gather(each, |bus, (station, clock)| async move {
        let bytes = if clock { bus.fprd_array(station, map::DC_RECEIVE_TIME).await.ok()? } else { return None };
        Some(Latched { ports: DcReceiveTimes::decode(&bytes).ports.map(|time| time.0), unit: 0 })
    });
    Ok(read.await)
}

async fn one(bus: &Bus, station: StationAddress, clock: bool) -> Result<Readings, BusError> {
    let registers = [
        (map::DL_STATUS, DlStatus::LEN),
        (map::RX_ERROR_COUNTER, ErrorCounters::LEN),
        (map::DC_RECEIVE_TIME, DcReceiveTimes::LEN),
    ];
    let count = if clock { 3 } else { 2 };
    let read = |(register, length)| (Command::Fprd, Target::Station(station, register), vec![0; length]);
    let replies = bus.transfer_all(registers.into_iter().take(count).map(read), Some(Wkc(1))).await?;
    if let Some(reply) = replies.iter().find(|reply| reply.wkc() != Wkc(1)) {
        let target = Target::Station(station, map::DL_STATUS);
        return Err(BusError::Wkc { target, expected: Wkc(1), got: reply.wkc() });
    }
    let dl_status = DlStatus::decode(&bytes(replies.first().map(|reply| reply.data.as_slice())));
    let counters = ErrorCounters::decode(&bytes(replies.get(1).map(|reply| reply.data.as_slice())));
    let times = replies.get(2).map(|reply| DcReceiveTimes::decode(&bytes(Some(&reply.data))));
    let port = |port: usize| PortRegisters {
        link: dl_status.ports[port].link,
        loop_closed: dl_status.ports[port].loop_closed,
        signal: dl_status.ports[port].communication,
        receive_time_ns: times.as_ref().map(|times| times.ports[port].0),
        invalid_frames: counters.rx[port].invalid_frames,
        symbol_errors: counters.rx[port].rx_errors,
        forwarded_errors: counters.forwarded[port],
        lost_links: counters.lost_link[port],
    };
    Ok(Readings { ports: [0, 1, 2, 3].map(port), dl_status, unit_errors: counters.epu })
}

/// The first bytes of data; zeros where it is shorter.
fn bytes<const N: usize>(data: Option<&[u8]>) -> [u8; N] {
    let mut array = [0; N];
    array.iter_mut().zip(data.unwrap_or_default()).for_each(|(to, from)| *to = *from);
    array
}

fn reports(
    known: &Known,
    readings: &[Option<Readings>],
    delays: &[Option<i64>],
    links: LinkSet,
) -> Vec<SubDevicePorts> {
    let mut neighbours: BTreeMap<PortOf, Neighbour> = BTreeMap::new();
    for cable in cables(&known.topology, links) {
        let end = |other: Option<PortOf>, link| other.map_or(Neighbour::Interface(link), Neighbour::SubDevice);
        cable.near.into_iter().for_each(|at| _ = neighbours.insert(at, end(cable.far, Link::Redundant)));
        cable.far.into_iter().for_each(|at| _ = neighbours.insert(at, end(cable.near, Link::Main)));
    }
    let delay = |node: usize| delays.get(node).copied().flatten();
    let port = |node: usize, port: u8| {
        let neighbour = neighbours.get(&PortOf { node, port }).copied();
        let delay_ns = match neighbour {
            Some(Neighbour::SubDevice(other)) => delay(other.node).zip(delay(node)).map(|(other, own)| other - own),
            Some(Neighbour::Interface(_)) | None => None,
        };
        let registers = readings[node].as_ref().map(|readings| readings.ports[usize::from(port)]);
        PortReport { kind: known.kinds[node][usize::from(port)], neighbour, delay_ns, registers }
    };
    let report = |node: usize| SubDevicePorts {
        subdevice: known.names[node],
        position: Position(node as u16),
        station: known.stations[node],
        ports: [0, 1, 2, 3].map(|at| port(node, at)),
        delay_ns: delay(node),
        unit_errors: readings[node].as_ref().map(|readings| readings.unit_errors),
    };
    (0..known.stations.len()).map(report).collect()
}
