//! Scans the whole segment while process data continues: the position of each SubDevice, and which have moved or are
//! missing (Master Redundancy 10.8).
//!
//! It reads positions and no process data: no working counter changes. Supervision finds and reads SubDevices without
//! an assigned station address; the rescan waits for this.

use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::{Position, StationAddress, Wkc};
use ringcat_wire::register::{DlStatus, map};
use ringcat_wire::sii::Identity;

use super::address::view;
use crate::declared::{Move, SubDeviceId};
use crate::procedures::services::ServiceError;
use crate::procedures::shared_segment::SharedSegment;
use crate::ring::RingState;
use crate::ring_status::LinkCounts;
use crate::segment::disturbance::Disturbance;
use crate::segment::view::View;
use crate::segment::{Observation, Seen, SubDevice, Versions, longest_ascent, retrace};
use crate::supervisor::{Bus, BusError};
use crate::topology::Topology;

/// Pause between two scans.
const PAUSE: Duration = Duration::from_millis(10);
/// Shortest wait for the end of other disturbances; otherwise a scan waits as long as its limit lasts.
const LIMIT: Duration = Duration::from_millis(100);

/// Maximum time for the segment to become stable after a group has joined or left.
const FOLLOW_LIMIT: Duration = Duration::from_millis(200);
/// Pause before the cabling is scanned again if it could not be taken over; doubled each time.
const AGAIN: Duration = Duration::from_millis(50);
/// The longest of these pauses.
const LONGEST: Duration = Duration::from_secs(2);

/// The identity of a SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Identified {
    /// A declared one, by its index in the declaration.
    Declared(SubDeviceId),
    /// An undeclared one. It is left alone, or, with idle operation, kept in its state.
    Undeclared(Identity),
    /// Not identified in time.
    Unknown,
}

/// A SubDevice at its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Found {
    /// Its place now.
    pub position: Position,
    /// Its station address.
    pub station: StationAddress,
    /// Its identity.
    pub identified: Identified,
    /// Its position in the previous cabling, if this move changes the order of the declared SubDevices.
    pub moved_from: Option<Position>,
}

/// Result of a scan of the whole segment.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Rescan {
    /// SubDevices on each link.
    pub counts: LinkCounts,
    /// All that answer, by position.
    pub subdevices: Vec<Found>,
    /// Declared SubDevices that do not answer, by their index in the declaration.
    pub missing: Vec<SubDeviceId>,
    /// Without an application: SubDevices that the scan before did not find. They have got these station addresses.
    pub added: Vec<StationAddress>,
    /// Without an application: SubDevices of the scan before that do not answer, by their station addresses.
    pub removed: Vec<StationAddress>,
    /// Present cabling according to the ports, with the known rings behind junctions.
    pub topology: Topology,
}

impl Rescan {
    /// All are identified.
    pub fn is_complete(&self) -> bool {
        self.subdevices.iter().all(|found| found.identified != Identified::Unknown)
    }

    /// Declared SubDevices that have moved.
    pub fn moved(&self) -> impl Iterator<Item = Move> + '_ {
        self.subdevices.iter().filter_map(|found| match found.identified {
            Identified::Declared(subdevice) => Some(Move { subdevice, from: found.moved_from?, to: found.position }),
            Identified::Undeclared(_) | Identified::Unknown => None,
        })
    }
}

/// Scans until the segment is stable and all are identified, or until the limit; then returns the last result. Moves
/// are reported.
pub(crate) async fn rescan(bus: &Bus, segment: &SharedSegment, limit: Duration) -> Result<Rescan, ServiceError> {
    let (rescan, versions, _) = scan_until(bus, segment, limit).await?;
    observe_moved(segment, versions, &rescan);
    Ok(rescan)
}

/// Takes over the cabling after hot connect groups have joined or left, as soon as no break is open whose place would
/// be lost.
pub(in crate::procedures) async fn follow_groups(bus: Bus, segment: SharedSegment) {
    let mut pause = AGAIN;
    loop {
        let changes = segment.view().group_changes();
        if follow_segment(&bus, &segment, FOLLOW_LIMIT).await {
            return segment.observe(Observation::GroupsFollowed(changes));
        }
        bus.sleep(pause).await;
        let is_same = segment.view().group_changes() == changes;
        pause = if is_same { (2 * pause).min(LONGEST) } else { AGAIN };
    }
}

/// A rescan without a request, because the segment is known to have changed. True if the cabling was taken over; if it
/// cannot be, nothing is sent or reported.
async fn follow_segment(bus: &Bus, segment: &SharedSegment, limit: Duration) -> bool {
    if !segment.view().is_whole(&segment.words()) {
        return false;
    }
    let Ok((rescan, versions, true)) = scan_until(bus, segment, limit).await else { return false };
    observe_moved(segment, versions, &rescan);
    true
}

fn observe_moved(segment: &SharedSegment, versions: Versions, rescan: &Rescan) {
    segment.observe(Observation::Moved { versions, moved: rescan.moved().collect() });
}

/// Also returns the versions at its beginning, and whether the cabling was taken over.
async fn scan_until(
    bus: &Bus,
    segment: &SharedSegment,
    limit: Duration,
) -> Result<(Rescan, Versions, bool), ServiceError> {
    let until = bus.now() + limit;
    segment.observe(Observation::RoundWanted);
    loop {
        // A disturbance puts SubDevices out of reach or changes their addresses, which would falsify the scan.
        let turn = segment.disturb(Disturbance::Rescan, LIMIT.max(until.since(bus.now()))).await;
        let versions = segment.view().versions();
        let scanned = if turn.is_some() { scan_once(bus, segment).await } else { Ok(None) };
        drop(turn);
        // This scan has cleared the ECAT events of ports that changed before.
        segment.observe(Observation::RoundWanted);
        let is_last = bus.now() >= until;
        match scanned {
            Ok(Some(rescan)) if is_last || (rescan.is_complete() && segment.view().are_places_valid(versions)) => {
                let is_adopted = rescan.is_complete() && adopt(segment, versions, &rescan);
                return Ok((rescan, versions, is_adopted));
            }
            Ok(None) if is_last => return Err(ServiceError::Unsteady),
            Err(error) if is_last => return Err(error.into()),
            Ok(_) | Err(_) => bus.sleep(PAUSE).await,
        }
    }
}

/// Passes a complete scan to the model. True if its cabling is taken over.
fn adopt(segment: &SharedSegment, versions: Versions, rescan: &Rescan) -> bool {
    let stations: Vec<StationAddress> = rescan.subdevices.iter().map(|found| found.station).collect();
    let member = |found: &Found| if let Identified::Declared(index) = found.identified { Some(index.0) } else { None };
    let members: Vec<Option<usize>> = rescan.subdevices.iter().map(member).collect();
    let seen = Seen { topology: &rescan.topology, stations: &stations, members: &members };
    let before = segment.view().adoptions();
    segment.observe(Observation::Rescanned { versions, seen, words: segment.words() });
    segment.view().adoptions() != before
}

/// One scan; `None` while the segment changes.
async fn scan_once(bus: &Bus, segment: &SharedSegment) -> Result<Option<Rescan>, BusError> {
    let Some(seen) = view(bus).await? else { return Ok(None) };
    let Some(ports) = ports_of(bus, &seen).await? else { return Ok(None) };
    let access = segment.view();
    let owners = access.owners(&seen.stations);
    let mut subdevices = Vec::new();
    let nodes = access.nodes(&seen, &ports);
    for (at, station) in seen.stations.iter().enumerate() {
        let unassigned = access.subdevices().at(*station).and_then(SubDevice::as_unassigned);
        // Until it is reported as undeclared it may be a missing member.
        let undeclared = unassigned.filter(|it| it.reported).and_then(|it| it.knowledge.info());
        let identified = match (owners.at(at), undeclared) {
            (Some(index), _) => Identified::Declared(SubDeviceId(index)),
            (None, Some(info)) => Identified::Undeclared(info.identity),
            (None, None) => Identified::Unknown,
        };
        subdevices.push(Found { position: Position(at as u16), station: *station, identified, moved_from: None });
    }
    let place_at_scan = |index: usize| access.member(index)?.node;
    // If a ring is open at another place than at the scan, or was open then and has branches, frames pass its
    // SubDevices in another order (CR-09): not a move.
    let scanned = &access.cabling().topology;
    let was_open = scanned.redundant_head.is_some();
    let is_comparable = match bus.ring() {
        RingState::Open => was_open && usize::from(seen.counts.0.0) == scanned.main_count,
        RingState::Closed | RingState::Unknown => !was_open,
    };
    let is_one_line = seen.counts.1 == Wkc(0);
    if is_comparable || is_one_line {
        mark_moved(&mut subdevices, place_at_scan);
    }
    let is_found = |it: &SubDeviceId| subdevices.iter().any(|found| found.identified == Identified::Declared(*it));
    let missing = (0..access.subdevices().member_count()).map(SubDeviceId).filter(|it| !is_found(it)).collect();
    let topology = retrace::cabling(access.cabling(), &seen.stations, &nodes, usize::from(seen.counts.0.0));
    let counts = LinkCounts { main: seen.counts.0.0, redundant: seen.counts.1.0 };
    Ok(Some(Rescan { counts, subdevices, missing, added: Vec::new(), removed: Vec::new(), topology }))
}

/// The ports of all SubDevices; `None` if the segment has changed since: port states of two cablings would be mixed.
pub(super) async fn ports_of(bus: &Bus, seen: &View) -> Result<Option<Vec<DlStatus>>, BusError> {
    let ports = bus.gather((0..seen.stations.len() as u16).map(Position), |bus, position| async move {
        let bytes = bus.aprd(position, map::DL_STATUS, DlStatus::LEN).await?;
        Ok::<_, BusError>(DlStatus::decode(&[bytes[0], bytes[1]]))
    });
    let ports: Vec<DlStatus> = match ports.await.into_iter().collect() {
        Ok(ports) => ports,
        Err(BusError::Wkc { .. }) => return Ok(None),
        Err(error) => return Err(error),
    };
    Ok((view(bus).await?.as_ref() == Some(seen)).then_some(ports))
}

/// Marks the fewest SubDevices without which the others are in the order of the scan: these have moved.
fn mark_moved(subdevices: &mut [Found], place_at_scan: impl Fn(usize) -> Option<usize>) {
    let mut placed = Vec::new();
    for (at, found) in subdevices.iter().enumerate() {
        if let Identified::Declared(index) = found.identified
            && let Some(place) = place_at_scan(index.0)
        {
            placed.push((at, place));
        }
    }
    let places: Vec<usize> = placed.iter().map(|(_, place)| *place).collect();
    for ((at, place), stays) in placed.into_iter().zip(longest_ascent(&places)) {
        if !stays {
            subdevices[at].moved_from = Some(Position(place as u16));
        }
    }
}
