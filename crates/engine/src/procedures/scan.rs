//! Scans for all SubDevices (protocol 5.6): count, common initial state, station addresses, identity, topology.
//!
//! All SubDevices are read in parallel, one task each; their datagrams share frames.

mod cabling;
mod count;
mod end;
mod error;
mod identification;
mod options;
mod power_on;
mod scanned;
mod stations;

use alloc::format;
use alloc::rc::Rc;
use alloc::string::ToString;
use alloc::vec;
use alloc::vec::Vec;
use core::cell::Cell;
use core::future::{Future, poll_fn};
use core::pin::pin;
use core::task::Poll;
use core::time::Duration;

use ringcat_wire::address::{Position, RegisterAddress, StationAddress, Wkc};
use ringcat_wire::al::{AlControl, AlState, AlStatus};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{DcReceiveTimes, DlStatus, EcatEvent, Fmmu, Information, SyncManager, map};
use ringcat_wire::sii::SiiHeader;

pub(crate) use self::cabling::cabling_findings;
use self::cabling::locate_crossings;
use self::count::Count;
pub(crate) use self::end::{end_scan, unless_another};
pub use self::error::ScanError;
pub use self::options::ScanOptions;
use self::power_on::PowerOns;
use self::scanned::Scanned;
pub use self::stations::{FIRST_STATION, MAX_SUBDEVICES, station_at};
use super::al_state;
use super::dictionary::complete;
use super::frame_limit::probe;
use super::junction::{Reached, learn};
use super::services::ServiceError;
use super::shared_segment::SharedSegment;
use super::sii::program::SiiProgramError;
use super::sii::{self, ChainEnd, SiiCache, SiiContents};
use crate::config::duplicate_aliases;
use crate::event::{Notice, Subject};
use crate::info::{AliasSource, InfoWarning, PdoSource, Readout, SiiExtent, SiiProblem, SubDeviceInfo};
use crate::junction::JunctionMode;
use crate::ring::RingState;
use crate::ring_status::LinkCounts;
pub use crate::segment::Scan;
use crate::segment::findings::ScanFinding;
use crate::supervisor::{Bus, BusError, Reply};
use crate::topology::{Closing, NodeStatus, Topology, rings_shown};

/// Most SyncManagers and FMMUs that a controller can have.
const MAX_CHANNELS: usize = 16;
/// Interval of the check whether all are in INIT.
const INIT_PAUSE: Duration = Duration::from_millis(1);
/// How long SubDevices may take to get to INIT before they are addressed one by one.
const INIT_LIMIT: Duration = Duration::from_millis(100);
/// Attempts of a scan: a cable may be cut or plugged in during it.
const ATTEMPTS: u8 = 3;
/// Steps in which progress is reported.
const PROGRESS_STEPS: usize = 10;

/// Byte address in the SII of the EEPROM's size.
const SIZE_AT: usize = 2 * 0x3E;

/// Scans the segment. All SubDevices are in INIT afterwards. A scan is restarted if the segment changes during it.
///
/// While the count settles, present SubDevices are read already. Each SubDevice that appears later restarts the scan
/// until the count has settled.
pub async fn scan(bus: &Bus, segment: &SharedSegment, options: &ScanOptions) -> Result<Scanned, ScanError> {
    let begin = bus.now();
    let mut attempts = 1;
    bus.step(Subject::Scan, || "scan begins: SubDevices are counted".to_string());
    let mut expected = count::first(bus, options, begin).await?;
    let mut power_ons = PowerOns::default();
    loop {
        bus.step(Subject::Scan, || {
            let LinkCounts { main, redundant } = expected.by_link();
            format!("scan: {main} SubDevices on MAIN, {redundant} on REDUNDANT; they go to INIT and get addresses")
        });
        expected = match attempt((bus, segment), options, expected, &mut power_ons).await {
            Ok(mut scanned) => {
                complete(bus, &mut scanned.scan, (options.pdos, options.sii_assignment)).await;
                return Ok(scanned);
            }
            Err(Failure::Unsettled(now)) => {
                bus.step(Subject::Scan, || "scan: the count has changed, the scan begins again".to_string());
                // A changed count is an unstable segment; a count that falls to 0 is another error.
                if now.is_none_or(|now| now.total() == 0) {
                    explain(bus).await?;
                }
                if bus.now().since(begin) >= options.patience {
                    let total = |count: Option<Count>| count.map_or(0, |count| count.total() as u16);
                    return Err(ScanError::Unsettled { counts: [total(Some(expected)), total(now)] });
                }
                match now.filter(|now| now.total() > 0) {
                    Some(now) => now,
                    None => count::first(bus, options, begin).await?,
                }
            }
            Err(Failure::Scan(error)) => {
                bus.step(Subject::Scan, || format!("scan: attempt {attempts} failed: {error}"));
                explain(bus).await?;
                if !error.is_passing() || attempts >= ATTEMPTS {
                    return Err(error);
                }
                attempts += 1;
                count::first(bus, options, bus.now()).await?
            }
        }
    }
}

/// A frame that did not return may hold too many datagrams for this segment.
pub(super) async fn explain(bus: &Bus) -> Result<(), ScanError> {
    probe(bus).await.map_or(Ok(()), |limit| Err(ScanError::FrameLimit(limit)))
}

/// Why an attempt to scan failed.
enum Failure {
    /// The count changed before it had settled.
    Unsettled(Option<Count>),
    Scan(ScanError),
}

impl<E: Into<ScanError>> From<E> for Failure {
    fn from(error: E) -> Failure {
        Failure::Scan(error.into())
    }
}

async fn attempt(
    (bus, segment): (&Bus, &SharedSegment),
    options: &ScanOptions,
    expected: Count,
    power_ons: &mut PowerOns,
) -> Result<Scanned, Failure> {
    let total = expected.total();
    if total > u32::from(MAX_SUBDEVICES) {
        return Err(ScanError::TooMany { count: total }.into());
    }
    let contents = read_while_settling(bus, options, &expected, power_ons).await?;
    bus.bwr(map::DC_RECEIVE_TIME, &[0; 4]).await?;
    let (stations, alias_source) = ((0..total as u16).map(Position).zip(contents), options.alias_source);
    let describing = bus.gather(stations, move |bus, (position, contents)| async move {
        let registers = read_registers(&bus, (position, station_at(position)), alias_source).await;
        registers.map(|registers| describe(registers, &contents))
    });
    let (subdevices, counted) = bus.both(describing, bus.brd(map::TYPE, 1)).await;
    let subdevices: Vec<SubDeviceInfo> = subdevices.into_iter().collect::<Result<_, _>>()?;
    let counted = counted?;
    if (counted.main, counted.redundant) != (expected.main, expected.redundant) {
        let after = LinkCounts { main: counted.main.0, redundant: counted.redundant.0 };
        return Err(ScanError::Changed { before: expected.by_link(), after }.into());
    }
    let (main_count, redundant_count) = (usize::from(expected.main.0), usize::from(expected.redundant.0));
    let Learned { topology, closings, not_learned } =
        connect((bus, segment), options.junctions, &subdevices, main_count).await?;
    let mut scan = Scan { subdevices, topology, main_count, redundant_count };
    let mut findings = findings_of(&scan);
    // Declared connections are not known yet.
    if options.junctions != JunctionMode::Strict {
        let exact = options.enhanced_line_crossed && locate_crossings(bus, segment, &mut scan).await;
        findings.push(ScanFinding::Cabling(cabling_findings(bus, &scan, exact)));
    }
    findings.extend(closings.into_iter().map(ScanFinding::JunctionLearned));
    if not_learned > 0 {
        findings.push(ScanFinding::JunctionsNotLearned(not_learned));
    }
    Ok(Scanned { scan, findings })
}

/// Reads the data of the counted SubDevices while the count settles. A changed count ends the attempt at once,
/// regardless of the reading: also later, because slow EEPROMs may take long.
async fn read_while_settling(
    bus: &Bus,
    options: &ScanOptions,
    expected: &Count,
    power_ons: &mut PowerOns,
) -> Result<Vec<Identified>, Failure> {
    let mut reading = pin!(identify(bus, expected.total() as u16, options, power_ons));
    let mut read = None;
    let mut settling = pin!(count::settle(bus, expected, options.settle));
    poll_fn(|context| {
        if read.is_none()
            && let Poll::Ready(result) = reading.as_mut().poll(context)
        {
            read = Some(result);
        }
        settling.as_mut().poll(context).map_err(Failure::Unsettled)
    })
    .await?;
    if let Some(read) = read {
        return read.map_err(Failure::from);
    }
    let mut changed = pin!(count::until_changed(bus, expected));
    poll_fn(|context| match reading.as_mut().poll(context) {
        Poll::Ready(result) => Poll::Ready(result.map_err(Failure::from)),
        Poll::Pending => changed.as_mut().poll(context).map(|after| {
            let before = expected.by_link();
            Err(ScanError::Changed { before, after }.into())
        }),
    })
    .await
}

/// How the SubDevices are connected.
pub(super) struct Learned {
    pub topology: Topology,
    /// Closing cables of the rings behind junctions that were learned.
    closings: Vec<Closing>,
    /// Detected rings behind junctions that could not be learned.
    not_learned: usize,
}

/// Determines the connections. The main copy passed the first `main_count` SubDevices.
pub(super) async fn connect(
    (bus, segment): (&Bus, &SharedSegment),
    junctions: JunctionMode,
    subdevices: &[SubDeviceInfo],
    main_count: usize,
) -> Result<Learned, BusError> {
    let statuses: Vec<NodeStatus> = subdevices.iter().map(node_status).collect();
    let stations: Vec<StationAddress> = subdevices.iter().map(|info| info.station).collect();
    let closings = match junctions {
        JunctionMode::Automatic => {
            let reached = Reached { nodes: &statuses, stations: &stations };
            learn((bus, segment), reached, main_count, bus.ring() == RingState::Closed).await?
        }
        JunctionMode::Disabled | JunctionMode::Strict => Vec::new(),
    };
    // With rings that were not learned, receive times would show crossed lines that do not exist.
    let is_closed = bus.ring() == RingState::Closed;
    let not_learned = match junctions {
        JunctionMode::Automatic => rings_shown(&statuses, is_closed).saturating_sub(closings.len()),
        JunctionMode::Disabled | JunctionMode::Strict => 0,
    };
    let untimed = |node: &NodeStatus| NodeStatus { receive_times: None, ..*node };
    let statuses = if not_learned > 0 { statuses.iter().map(untimed).collect() } else { statuses };
    let topology = Topology::with_local_rings(&statuses, main_count, &closings);
    Ok(Learned { topology, closings, not_learned })
}

/// Data of one SubDevice.
pub(super) struct Identified {
    /// Its SII.
    pub contents: SiiContents,
    /// Its explicit device identification.
    pub identification: Option<u16>,
    /// Whether its dictionary may have been written since power-on.
    pub pdo_source: PdoSource,
}

/// Sets the common initial state and station addresses, and reads each SubDevice.
async fn identify(
    bus: &Bus,
    count: u16,
    options: &ScanOptions,
    power_ons: &mut PowerOns,
) -> Result<Vec<Identified>, ScanError> {
    let (levelled, sources) = bus.both(level(bus), power_ons.read(bus, count)).await;
    levelled?;
    let are_clean = to_init(bus, count).await?;
    assign_addresses(bus, count).await?;
    if !are_clean {
        clear_errors(bus, count).await?;
    }
    let mut all = read_all(bus, count, options).await?;
    all.iter_mut().zip(sources).for_each(|(identified, source)| identified.pdo_source = source);
    Ok(all)
}

pub(crate) fn node_status(info: &SubDeviceInfo) -> NodeStatus {
    NodeStatus::from(info)
}

/// Sets the same initial state in all: loops automatic, aliases off, event mask, no FMMU, no SyncManager, no clock
/// activity, EEPROM to EtherCAT, error counters clear.
async fn level(bus: &Bus) -> Result<(), BusError> {
    let init = AlControl::with_acknowledge(AlState::Init).encode();
    let write = |register, data: &[u8]| (Command::Bwr, Target::Broadcast(register), data.to_vec());
    let first = [
        write(map::DL_CONTROL.offset(1), &[0]),
        write(map::DL_CONTROL.offset(3), &[0]),
        write(map::AL_CONTROL, &init),
        write(map::ECAT_EVENT_MASK, &event_mask().encode()),
        write(map::RX_ERROR_COUNTER, &[0; 8]),
        write(map::SII_CONFIGURATION, &sii::FORCE),
    ];
    let second = [
        write(map::FMMU_BASE, &[0; Fmmu::LEN * MAX_CHANNELS]),
        write(map::SYNC_MANAGER_BASE, &[0; SyncManager::LEN * MAX_CHANNELS]),
        write(map::DC_ACTIVATION, &[0]),
        write(map::SII_CONFIGURATION, &sii::ETHERCAT),
    ];
    bus.transfer_all(first, None).await?;
    bus.transfer_all(second, None).await.map(drop)
}

/// ECAT events that SubDevices report in every datagram: a port changed.
pub(super) fn event_mask() -> EcatEvent {
    EcatEvent { dl_status: true, ..EcatEvent::default() }
}

/// Waits until all are in INIT, according to the OR of their AL status; false if the time limit passes. Devices that
/// copy AL control into AL status show the acknowledge bit as an error: the state is written to them without it.
async fn to_init(bus: &Bus, count: u16) -> Result<bool, BusError> {
    let until = bus.now() + INIT_LIMIT;
    loop {
        let reply = bus.brd(map::AL_STATUS, AlStatus::LEN).await?;
        let status = AlStatus::decode(&[reply.data[0], reply.data[1]]);
        if reply.wkc() == Wkc(count) && status.state == AlState::Init.code() {
            if !status.error {
                return Ok(true);
            }
            bus.bwr(map::AL_CONTROL, &AlControl::new(AlState::Init).encode()).await?;
        }
        if bus.now() >= until {
            return Ok(false);
        }
        bus.sleep(INIT_PAUSE).await;
    }
}

/// Clears remaining errors, SubDevice by SubDevice. A SubDevice that stays outside INIT would hide the state of the
/// others in the OR; its error is handled when it is configured.
async fn clear_errors(bus: &Bus, count: u16) -> Result<(), BusError> {
    let cleared = bus.gather((0..count).map(Position), |bus, position| async move {
        let station = station_at(position);
        match al_state::read_status(&bus, station).await {
            Ok((status, _)) if status.error => al_state::ask(&bus, station, AlState::Init, true).await,
            Ok(_) => Ok(()),
            Err(error) => Err(error),
        }
    });
    cleared.await.into_iter().collect()
}

async fn assign_addresses(bus: &Bus, count: u16) -> Result<(), BusError> {
    let written = bus.gather((0..count).map(Position), |bus, position| async move {
        bus.apwr(position, map::STATION_ADDRESS, &station_at(position).0.to_le_bytes()).await
    });
    written.await.into_iter().collect()
}

async fn read_all(bus: &Bus, count: u16, options: &ScanOptions) -> Result<Vec<Identified>, ScanError> {
    let total = usize::from(count);
    let step = total.div_ceil(PROGRESS_STEPS).max(1);
    let done = Rc::new(Cell::new(0_usize));
    let read = bus.gather((0..count).map(Position), |bus, position| {
        let (done, cache, extent) = (done.clone(), options.cache.clone(), options.extent);
        async move {
            let result = ask(&bus, position, station_at(position), &cache, extent).await;
            done.set(done.get() + 1);
            if done.get().is_multiple_of(step) || done.get() == total {
                bus.notice(Notice::ScanProgress { done: done.get(), total });
            }
            result
        }
    });
    read.await.into_iter().collect()
}

pub(super) async fn ask(
    bus: &Bus,
    position: Position,
    station: StationAddress,
    cache: &SiiCache,
    extent: SiiExtent,
) -> Result<Identified, ScanError> {
    let read = sii::read(bus, station, cache, extent).await;
    bus.step(Subject::Scan, || match &read {
        Ok(_) => format!("position {position}: SII read, station address {station}"),
        Err(error) => format!("position {position}: SII not read: {error}"),
    });
    let contents = match read {
        Ok(contents) => contents,
        Err(error) if error.is_passing() => return Err(ScanError::Sii { position, error }),
        // A broken EEPROM fails only its own SubDevice.
        Err(error) => {
            bus.notice(Notice::SiiWarning { position, what: error.to_string() });
            let contents = SiiContents::unreadable();
            return Ok(Identified { contents, identification: None, pdo_source: PdoSource::Outdated });
        }
    };
    let identification = identification::read(bus, station, &contents).await?;
    Ok(Identified { contents, identification, pdo_source: PdoSource::Outdated })
}

/// Reads one SubDevice: SII, controller, ports, alias, receive times.
pub(super) async fn read_one(
    bus: &Bus,
    (position, station): (Position, StationAddress),
    cache: &SiiCache,
    alias_source: AliasSource,
) -> Result<SubDeviceInfo, ScanError> {
    let contents = ask(bus, position, station, cache, SiiExtent::Complete).await?;
    Ok(describe(read_registers(bus, (position, station), alias_source).await?, &contents))
}

/// Reads the SII of a SubDevice that a scan has described, in any state; its identification, which follows a request,
/// is not read again.
pub(super) async fn read_whole(
    bus: &Bus,
    (position, station): (Position, StationAddress),
    cache: &SiiCache,
    alias_source: AliasSource,
) -> Result<SubDeviceInfo, ServiceError> {
    let contents = sii::read(bus, station, cache, SiiExtent::Complete).await.map_err(SiiProgramError::Read)?;
    let identified = Identified { contents, identification: None, pdo_source: PdoSource::Outdated };
    Ok(describe(read_registers(bus, (position, station), alias_source).await?, &identified))
}

/// Reads controller, ports, alias and receive times.
pub(super) async fn read_registers(
    bus: &Bus,
    (position, station): (Position, StationAddress),
    alias_source: AliasSource,
) -> Result<Readout, BusError> {
    let registers = [
        (map::TYPE, Information::LEN),
        (map::DL_STATUS, DlStatus::LEN),
        (map::STATION_ALIAS, 2),
        (map::DC_RECEIVE_TIME, DcReceiveTimes::LEN),
    ];
    let read = registers.map(|(register, length)| (Command::Fprd, Target::Station(station, register), vec![0; length]));
    let replies = bus.transfer_all(read, Some(Wkc(1))).await?;
    let information = Information::decode(answered(&replies, station, registers, 0)?);
    let dl_status = DlStatus::decode(answered(&replies, station, registers, 1)?);
    let alias = u16::from_le_bytes(*answered(&replies, station, registers, 2)?);
    // A SubDevice without a clock does not increment the WKC.
    let receive_times = if information.features.dc {
        let times = DcReceiveTimes::decode(answered(&replies, station, registers, 3)?);
        Some(times.ports.map(|time| time.0))
    } else {
        None
    };
    Ok(Readout { position, station, alias, alias_source, information, dl_status, receive_times })
}

/// One of several replies, which exactly one SubDevice must have processed.
fn answered<const N: usize, const M: usize>(
    replies: &[Reply],
    station: StationAddress,
    registers: [(RegisterAddress, usize); M],
    number: usize,
) -> Result<&[u8; N], BusError> {
    let (expected, target) = (Wkc(1), Target::Station(station, registers[number].0));
    let got = replies.get(number).map_or(Wkc(0), Reply::wkc);
    let data = replies.get(number).filter(|_| got == expected).and_then(|reply| reply.data.first_chunk());
    data.ok_or(BusError::Wkc { target, expected, got })
}

pub(super) fn describe(readout: Readout, identified: &Identified) -> SubDeviceInfo {
    let Identified { contents, .. } = identified;
    let mut info = SubDeviceInfo::from_parts(readout, &contents.header, contents.categories());
    (info.identification, info.pdo_source) = (identified.identification, identified.pdo_source);
    info.limit_to(contents.extent);
    let (category, offset, problem) = match contents.end {
        ChainEnd::Unreadable => {
            info.warnings.clear();
            (None, None, SiiProblem::Unreadable)
        }
        // A blank EEPROM has no categories.
        _ if info.is_blank() => return info,
        ChainEnd::Sound { .. } if contents.categories.is_empty() && !contents.has_more => {
            (None, Some(SiiHeader::LEN), SiiProblem::NoCategories)
        }
        ChainEnd::Sound { .. } => return info,
        ChainEnd::BehindSize { at } => {
            let size = contents.header.size_bytes();
            (None, Some(SIZE_AT), SiiProblem::Size { size, end: at })
        }
        ChainEnd::Open { at } => (None, Some(at), SiiProblem::NoEndMarker),
        ChainEnd::Beyond { kind, at, announced, left } => {
            (Some(kind), Some(at), SiiProblem::Beyond { announced, left })
        }
    };
    info.warnings.push(InfoWarning { category, offset, problem });
    info
}

fn findings_of(scan: &Scan) -> Vec<ScanFinding> {
    let of_sii = |info: &SubDeviceInfo| {
        let position = info.position;
        let finding = |warning: &InfoWarning| ScanFinding::Sii { position, warning: *warning };
        info.warnings.iter().map(finding).collect::<Vec<_>>()
    };
    let duplicates = duplicate_aliases(&scan.subdevices).into_iter().map(ScanFinding::DuplicateAlias);
    scan.subdevices.iter().flat_map(of_sii).chain(duplicates).collect()
}
