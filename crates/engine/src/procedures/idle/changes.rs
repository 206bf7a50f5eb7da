//! Follows a change of the segment without an application: SubDevices that kept their station addresses stay as they
//! are, the others get addresses and are read.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::future::{Future, poll_fn};
use core::pin::pin;
use core::task::Poll;

use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::register::{DlStatus, map};

use super::places::wrong_addresses;
use super::ports::compare_ports;
use crate::info::{SiiExtent, SubDeviceInfo};
use crate::junction::JunctionMode;
use crate::procedures::dictionary::complete;
use crate::procedures::scan::{
    Identified, Learned, MAX_SUBDEVICES, Scan, ScanError, ScanOptions, ask, connect, describe, read_registers,
};
use crate::procedures::shared_segment::SharedSegment;
use crate::procedures::unassigned::{give, level, view};
use crate::segment::view::View;
use crate::segment::{Found, IdleObservation, TemporaryAddress};
use crate::supervisor::{Bus, BusError};
use crate::topology::Topology;

/// Scans the segment again; `None` while it changes. `known`: SubDevices with their station addresses; `last`: the
/// places of the last scan.
///
/// A SubDevice that lost its power has lost its station address, too. So an address that one SubDevice has shows which
/// one it is, unless another program has written it: at another place the identity is read as well.
pub(crate) async fn scan_again(
    bus: &Bus,
    segment: &SharedSegment,
    options: &ScanOptions,
    (known, last): (&[Rc<SubDeviceInfo>], &Found),
) -> Result<Option<Found>, ScanError> {
    let Some(before) = seen(bus).await? else { return Ok(None) };
    if before.stations.is_empty() {
        return Ok(Some(nothing()));
    }
    let mut others = unknown(&before, known);
    let lost = lost(&before, known);
    let wrong = while_reading(segment, &lost, wrong_addresses(bus, segment, (&before, last), known)).await;
    let Some(wrong) = wrong else { return Ok(None) };
    others.extend(wrong?);
    let readdressed = [others.clone(), lost].concat();
    let Some((given, now)) = give_all(bus, segment, before, others).await? else { return Ok(None) };
    bus.bwr(map::DC_RECEIVE_TIME, &[0; 4]).await?;
    let places: Vec<(Position, StationAddress)> = (0..).map(Position).zip(now.stations.iter().copied()).collect();
    let of = |station: StationAddress| given.iter().find(|given| given.station == station);
    let fresh = places.iter().filter_map(|(position, station)| Some((*position, *of(*station)?))).collect();
    let reading = while_reading(segment, &readdressed, read_new(bus, options, fresh));
    let Some(read) = reading.await else { return Ok(None) };
    let mut read = read?.into_iter();
    let alias_source = options.alias_source;
    let registers =
        bus.gather(places, move |bus, place| async move { read_registers(&bus, place, alias_source).await });
    let mut subdevices = Vec::with_capacity(now.stations.len());
    for registers in registers.await {
        let registers = registers?;
        let known = known.iter().find(|info| info.station == registers.station && of(info.station).is_none());
        subdevices.push(match known {
            Some(info) => info.seen_at(&registers),
            None => {
                let Some(info) = read.next() else { return Ok(None) };
                Rc::new(SubDeviceInfo { dl_status: registers.dl_status, position: registers.position, ..info })
            }
        });
    }
    let main_count = usize::from(now.counts.0.0);
    let infos: Vec<SubDeviceInfo> = subdevices.iter().map(|info| (**info).clone()).collect();
    let Learned { topology, .. } = connect((bus, segment), options.junctions, &infos, main_count).await?;
    if options.junctions == JunctionMode::Automatic {
        // The examination of rings has closed ports for a moment: their ECAT events would cause another scan, and that
        // another examination. A port that goes up and down repeatedly must not prevent a scan of new SubDevices.
        let read: Vec<(StationAddress, DlStatus)> = infos.iter().map(|info| (info.station, info.dl_status)).collect();
        compare_ports(bus, segment, &read).await?;
    }
    Ok((seen(bus).await?.as_ref() == Some(&now)).then_some(Found { subdevices, topology, main_count }))
}

/// Gives each SubDevice with one of these addresses one of its own, in as many rounds as that takes. `None` if no
/// address could be given in one of them.
async fn give_all(
    bus: &Bus,
    segment: &SharedSegment,
    mut now: View,
    mut old: Vec<StationAddress>,
) -> Result<Option<(Vec<TemporaryAddress>, View)>, BusError> {
    let mut given: Vec<TemporaryAddress> = Vec::new();
    while !old.is_empty() {
        let (more, is_complete) = give(bus, segment, &now, &old).await?;
        let is_stuck = more.is_empty() || given.len() > usize::from(MAX_SUBDEVICES);
        given.extend(more);
        let Some(view) = seen(bus).await?.filter(|_| is_complete || !is_stuck) else { return Ok(None) };
        now = view;
        if is_complete {
            break;
        }
        old.retain(|station| now.positions(*station).next().is_some());
    }
    Ok(Some((given, now)))
}

/// Runs a procedure that only reads, and may take long because of slow EEPROMs; `None` as soon as broadcasts show
/// another change. `readdressed`: addresses of which it is known that no SubDevice, or several, have them.
async fn while_reading<T>(
    segment: &SharedSegment,
    readdressed: &[StationAddress],
    procedure: impl Future<Output = T>,
) -> Option<T> {
    segment.observe_idle(IdleObservation::ReadingBegun(readdressed));
    let begun = segment.view().idle_changes();
    let mut procedure = pin!(procedure);
    let mut changed = pin!(segment.until(|model| (model.idle_changes() != begun).then_some(())));
    let result = poll_fn(|context| match procedure.as_mut().poll(context) {
        Poll::Ready(result) => Poll::Ready(Some(result)),
        Poll::Pending => changed.as_mut().poll(context).map(|()| None),
    });
    let result = result.await;
    segment.observe_idle(IdleObservation::ReadingEnded);
    result
}

/// A segment without SubDevices.
pub(crate) fn nothing() -> Found {
    Found { subdevices: Vec::new(), topology: Topology::default(), main_count: 0 }
}

/// All station addresses; none if no frame returns. `None` while the segment changes.
async fn seen(bus: &Bus) -> Result<Option<View>, BusError> {
    match view(bus).await {
        Err(BusError::Lost { .. }) => {
            Ok(Some(View { counts: Default::default(), ring: Default::default(), stations: Vec::new() }))
        }
        result => result,
    }
}

/// Addresses that belong to no known SubDevice, or to several SubDevices.
fn unknown(view: &View, known: &[Rc<SubDeviceInfo>]) -> Vec<StationAddress> {
    let mut unknown = Vec::new();
    for station in &view.stations {
        let is_known = known.iter().any(|info| info.station == *station) && view.position(*station).is_some();
        if !is_known && !unknown.contains(station) {
            unknown.push(*station);
        }
    }
    unknown
}

/// Addresses of known SubDevices that none has any more, or several have.
fn lost(view: &View, known: &[Rc<SubDeviceInfo>]) -> Vec<StationAddress> {
    let stations = known.iter().map(|info| info.station);
    stations.filter(|station| view.position(*station).is_none()).collect()
}

/// Reads SubDevices with new addresses; they are in INIT.
async fn read_new(
    bus: &Bus,
    options: &ScanOptions,
    fresh: Vec<(Position, TemporaryAddress)>,
) -> Result<Vec<SubDeviceInfo>, ScanError> {
    if fresh.is_empty() {
        return Ok(Vec::new());
    }
    let (cache, alias_source) = (options.cache.clone(), options.alias_source);
    let read = bus.gather(fresh, |bus, (position, given)| {
        let (cache, station) = (cache.clone(), given.station);
        async move {
            level(&bus, station).await?;
            let identified = ask(&bus, position, station, &cache, SiiExtent::Complete).await?;
            let identified = Identified { pdo_source: given.pdo_source(), ..identified };
            Ok::<_, ScanError>(describe(read_registers(&bus, (position, station), alias_source).await?, &identified))
        }
    });
    let subdevices = read.await.into_iter().collect::<Result<Vec<_>, _>>()?;
    let main_count = subdevices.len();
    let mut scan = Scan { subdevices, topology: Topology::default(), main_count, redundant_count: 0 };
    complete(bus, &mut scan, (options.pdos, options.sii_assignment)).await;
    Ok(scan.subdevices)
}
