//! Finding out who is there (facts 5.6): count, common ground, station addresses, what each SubDevice is, topology.
//!
//! All SubDevices are asked at once, one task each; their datagrams share frames by themselves.

use alloc::rc::Rc;
use alloc::string::ToString;
use alloc::vec::Vec;
use core::cell::Cell;
use core::fmt;
use core::time::Duration;

use ringcat_wire::address::{Position, StationAddress, Wkc};
use ringcat_wire::al::{AlControl, AlState, AlStatus};
use ringcat_wire::register::{DcReceiveTimes, DlStatus, EcatEvent, Fmmu, Information, SyncManager, map};

use super::sii::{SiiCache, SiiReadError, SiiReader, claim_all};
use crate::config::duplicate_aliases;
use crate::event::Event;
use crate::info::{InfoWarning, Readout, SiiProblem, SubDeviceInfo};
use crate::link::LinkSet;
use crate::ring::RingState;
use crate::supervisor::{Bus, BusError};
use crate::topology::{Finding, NodeStatus, Topology};

/// Station address of the SubDevice at position 0; the others follow.
pub const FIRST_STATION: u16 = 0x1001;
/// SubDevices that a scan takes: what fits between [`FIRST_STATION`] and the end of the address space.
pub const MAX_SUBDEVICES: u16 = u16::MAX - FIRST_STATION;
/// Most SyncManagers and FMMUs that a controller can have.
const MAX_CHANNELS: usize = 16;
/// Pause between two counts.
const COUNT_PAUSE: Duration = Duration::from_millis(1);
/// How long SubDevices may take to get to INIT before they are addressed one by one.
const INIT_LIMIT: Duration = Duration::from_millis(100);
/// A scan is begun so often: a cable may be cut or plugged in while it runs.
const ATTEMPTS: u8 = 3;
/// Progress is reported in so many steps.
const PROGRESS_STEPS: usize = 10;

/// How to scan.
#[derive(Clone, Debug)]
pub struct ScanOptions {
    /// The count must stay the same for this long.
    pub settle: Duration,
    /// How long to wait for the first SubDevice.
    pub patience: Duration,
    /// SII contents read before.
    pub cache: SiiCache,
}

/// What a scan found.
#[derive(Clone, Debug)]
pub struct Scan {
    /// The SubDevices in the order of the processing units.
    pub subdevices: Vec<SubDeviceInfo>,
    /// How they are connected.
    pub topology: Topology,
    /// How many of them the main copy met.
    pub main_count: usize,
    /// How many the redundant copy met.
    pub redundant_count: usize,
}

/// Why a scan ended without a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScanError {
    /// Frames came back, but no SubDevice had touched them.
    NoSubDevices,
    /// No frame came back.
    NoAnswer,
    /// The count did not settle.
    Unsettled {
        /// The last two counts.
        counts: [u16; 2],
    },
    /// The segment changed while it was scanned, again and again.
    Changed {
        /// SubDevices on the main and on the redundant link at the beginning.
        before: (u16, u16),
        /// And at the end.
        after: (u16, u16),
    },
    /// More SubDevices than station addresses.
    TooMany {
        /// SubDevices counted.
        count: u32,
    },
    /// The bus failed.
    Bus(BusError),
    /// The SII of a SubDevice cannot be read.
    Sii {
        /// Where.
        position: Position,
        /// Why.
        error: SiiReadError,
    },
}

impl fmt::Display for ScanError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ScanError::NoSubDevices => f.write_str("frames return, but no SubDevice processes them"),
            ScanError::NoAnswer => {
                f.write_str("no frame returns: is the cable plugged and the first SubDevice powered?")
            }
            ScanError::Unsettled { counts: [a, b] } => {
                write!(f, "the number of SubDevices does not settle: {a}, then {b}")
            }
            ScanError::Changed { before, after } => write!(
                f,
                "the segment changes while it is scanned: {} SubDevices on the main and {} on the redundant link, then \
                 {} and {}",
                before.0, before.1, after.0, after.1
            ),
            ScanError::TooMany { count } => write!(f, "{count} SubDevices, at most {MAX_SUBDEVICES} are possible"),
            ScanError::Bus(error) => error.fmt(f),
            ScanError::Sii { position, error } => write!(f, "SubDevice at position {position}: {error}"),
        }
    }
}

impl core::error::Error for ScanError {}

impl From<BusError> for ScanError {
    fn from(error: BusError) -> ScanError {
        ScanError::Bus(error)
    }
}

/// Scans the segment. Every SubDevice is in INIT afterwards. A scan that the segment disturbed by changing is begun
/// again.
pub async fn scan(bus: &Bus, options: &ScanOptions) -> Result<Scan, ScanError> {
    let mut attempts = 1;
    loop {
        match attempt(bus, options).await {
            Err(ScanError::Bus(_) | ScanError::Changed { .. } | ScanError::Sii { error: SiiReadError::Bus(_), .. })
                if attempts < ATTEMPTS =>
            {
                attempts += 1;
            }
            result => return result,
        }
    }
}

async fn attempt(bus: &Bus, options: &ScanOptions) -> Result<Scan, ScanError> {
    let (main, redundant) = count(bus, options).await?;
    bus.report(Event::Counted { main: main.0, redundant: redundant.0 });
    let total = u32::from(main.0) + u32::from(redundant.0);
    if total > u32::from(MAX_SUBDEVICES) {
        return Err(ScanError::TooMany { count: total });
    }
    let count = total as u16;
    level(bus).await?;
    to_init(bus, count).await?;
    assign_addresses(bus, count).await?;
    bus.bwr(map::DC_RECEIVE_TIME, &[0; 4]).await?;
    let subdevices = read_all(bus, count, &options.cache).await?;
    let counted = bus.brd(map::TYPE, 1).await?;
    if (counted.main, counted.redundant) != (main, redundant) {
        return Err(ScanError::Changed { before: (main.0, redundant.0), after: (counted.main.0, counted.redundant.0) });
    }
    let statuses: Vec<NodeStatus> = subdevices.iter().map(node_status).collect();
    let topology = Topology::build(&statuses, usize::from(main.0));
    let scan =
        Scan { subdevices, topology, main_count: usize::from(main.0), redundant_count: usize::from(redundant.0) };
    report_findings(bus, &scan);
    bus.report(Event::ScanFinished { subdevices: scan.subdevices.len() });
    Ok(scan)
}

pub(super) fn node_status(info: &SubDeviceInfo) -> NodeStatus {
    NodeStatus { dl_status: info.dl_status, receive_times: info.receive_times, ports: info.controller.ports }
}

/// Counts until the same number came for the settling time.
async fn count(bus: &Bus, options: &ScanOptions) -> Result<(Wkc, Wkc), ScanError> {
    let begin = bus.now();
    let mut last = (Wkc(0), Wkc(0));
    let mut since = begin;
    let mut answered = false;
    loop {
        let counted = match bus.brd(map::TYPE, 1).await {
            Ok(reply) => {
                answered = true;
                (reply.main, reply.redundant)
            }
            Err(BusError::Lost { .. }) => (Wkc(0), Wkc(0)),
            Err(error) => return Err(error.into()),
        };
        let now = bus.now();
        let previous = last;
        if counted != last {
            last = counted;
            since = now;
        }
        let settled = now.since(since) >= options.settle;
        if settled && last != (Wkc(0), Wkc(0)) {
            return Ok(last);
        }
        if now.since(begin) >= options.patience {
            return Err(match (answered, last.0.plus(last.1)) {
                (false, _) => ScanError::NoAnswer,
                (true, Wkc(0)) => ScanError::NoSubDevices,
                (true, Wkc(count)) => ScanError::Unsettled { counts: [previous.0.plus(previous.1).0, count] },
            });
        }
        bus.sleep(COUNT_PAUSE).await;
    }
}

/// The same starting point for all: loops automatic, aliases off, event mask, no FMMU, no SyncManager, no clock
/// activity, EEPROM to EtherCAT, error counters clear.
async fn level(bus: &Bus) -> Result<(), BusError> {
    let mask = event_mask();
    bus.bwr(map::DL_CONTROL.offset(1), &[0]).await?;
    bus.bwr(map::DL_CONTROL.offset(3), &[0]).await?;
    bus.bwr(map::AL_CONTROL, &AlControl::with_acknowledge(AlState::Init).encode()).await?;
    bus.bwr(map::ECAT_EVENT_MASK, &mask.encode()).await?;
    bus.bwr(map::RX_ERROR_COUNTER, &[0; 8]).await?;
    bus.bwr(map::FMMU_BASE, &[0; Fmmu::LEN * MAX_CHANNELS]).await?;
    bus.bwr(map::SYNC_MANAGER_BASE, &[0; SyncManager::LEN * MAX_CHANNELS]).await?;
    bus.bwr(map::DC_ACTIVATION, &[0]).await?;
    claim_all(bus).await
}

/// ECAT events that SubDevices tell in every datagram: a port changed.
pub(super) fn event_mask() -> EcatEvent {
    EcatEvent { dl_status: true, ..EcatEvent::default() }
}

/// Waits until all are in INIT. Devices that copy AL control into AL status show the acknowledge bit as an error: they
/// get the bare state.
async fn to_init(bus: &Bus, count: u16) -> Result<(), BusError> {
    let until = bus.now() + INIT_LIMIT;
    loop {
        let reply = bus.brd(map::AL_STATUS, AlStatus::LEN).await?;
        let status = AlStatus::decode(&[reply.data[0], reply.data[1]]);
        if reply.wkc() == Wkc(count) && status.state == AlState::Init.code() {
            if !status.error {
                return Ok(());
            }
            bus.bwr(map::AL_CONTROL, &AlControl::new(AlState::Init).encode()).await?;
        }
        if bus.now() >= until {
            // Whoever is not there yet is dealt with when it is configured.
            return Ok(());
        }
        bus.sleep(COUNT_PAUSE).await;
    }
}

async fn assign_addresses(bus: &Bus, count: u16) -> Result<(), BusError> {
    let written = bus.gather((0..count).map(Position), |bus, position| async move {
        bus.apwr(position, map::STATION_ADDRESS, &station_at(position).0.to_le_bytes()).await
    });
    written.await.into_iter().collect()
}

/// The station address that a scan gives to a position.
pub const fn station_at(position: Position) -> StationAddress {
    StationAddress(FIRST_STATION + position.0)
}

async fn read_all(bus: &Bus, count: u16, cache: &SiiCache) -> Result<Vec<SubDeviceInfo>, ScanError> {
    let total = usize::from(count);
    let step = total.div_ceil(PROGRESS_STEPS).max(1);
    let done = Rc::new(Cell::new(0_usize));
    let read = bus.gather((0..count).map(Position), |bus, position| {
        let (done, cache) = (done.clone(), cache.clone());
        async move {
            let result = read_one(&bus, position, station_at(position), &cache).await;
            done.set(done.get() + 1);
            if done.get().is_multiple_of(step) || done.get() == total {
                bus.report(Event::ScanProgress { done: done.get(), total });
            }
            result
        }
    });
    read.await.into_iter().collect()
}

/// Reads what one SubDevice is: controller, ports, alias, receive times, SII.
pub(super) async fn read_one(
    bus: &Bus,
    position: Position,
    station: StationAddress,
    cache: &SiiCache,
) -> Result<SubDeviceInfo, ScanError> {
    let information = Information::decode(&bus.fprd_array(station, map::TYPE).await?);
    let dl_status = DlStatus::decode(&bus.fprd_array(station, map::DL_STATUS).await?);
    let alias = u16::from_le_bytes(bus.fprd_array(station, map::STATION_ALIAS).await?);
    let receive_times = if information.features.dc {
        let times = DcReceiveTimes::decode(&bus.fprd_array(station, map::DC_RECEIVE_TIME).await?);
        Some(times.ports.map(|time| time.0))
    } else {
        None
    };
    let mut reader = SiiReader::new(bus, station, cache);
    let contents = reader.read().await.map_err(|error| ScanError::Sii { position, error })?;
    let readout = Readout { position, station, alias, information, dl_status, receive_times };
    let categories = contents.categories.iter().map(|(kind, data)| (*kind, data.as_slice()));
    let mut info = SubDeviceInfo::from_parts(readout, &contents.header, categories);
    if !contents.complete {
        info.warnings.push(InfoWarning { category: None, offset: 0, problem: SiiProblem::NoEndMarker });
    }
    Ok(info)
}

fn report_findings(bus: &Bus, scan: &Scan) {
    for info in &scan.subdevices {
        for warning in &info.warnings {
            bus.report(Event::SiiOddity { position: info.position, what: warning.to_string() });
        }
    }
    for duplicate in duplicate_aliases(&scan.subdevices) {
        bus.report(Event::DuplicateAlias { alias: duplicate.alias, first: duplicate.first, second: duplicate.second });
    }
    let position = |node: usize| scan.subdevices.get(node).map_or(Position(node as u16), |info| info.position);
    for finding in &scan.topology.findings {
        match *finding {
            Finding::UnconnectedPort0 { node } => bus.report(Event::UnconnectedPort0 { position: position(node) }),
            Finding::CrossedLine { node, entry_port } => {
                bus.report(Event::LineCrossed { position: Some(position(node)), entry_port: Some(entry_port) })
            }
            Finding::ForcedOpen { .. }
            | Finding::ClosedWithLink { .. }
            | Finding::LinkWithoutCommunication { .. }
            | Finding::Inconsistent { .. } => {
                bus.report(Event::CablingOddity { position: position(finding.node()), what: finding.to_string() });
            }
        }
    }
    // In a closed ring only branches on port 2 and crossed SubDevices work on the redundant copy (facts LC-04).
    let crossed_known = scan.topology.findings.iter().any(|finding| matches!(finding, Finding::CrossedLine { .. }));
    if bus.links() == LinkSet::Ring && bus.ring() == RingState::Closed && scan.redundant_count > 0 && !crossed_known {
        bus.report(Event::LineCrossed { position: None, entry_port: None });
    }
}
