//! SubDevices that answer but have no assigned station address: they are found, read, and get the address of the
//! declared SubDevice that the model identifies (`segment::unassigned`).
//!
//! Each is read by its own procedure, so that a slow or broken EEPROM delays no other SubDevice.

mod address;
mod doubles;
mod quiet;
pub mod rescan;

use alloc::boxed::Box;
use alloc::rc::Rc;
use alloc::string::ToString;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::register::map;

pub(super) use self::address::give;
pub(super) use self::address::take_away;
pub(super) use self::address::view;
use self::doubles::restore;
pub(super) use self::doubles::{MappingEvidence, has_identity, mapping_evidence};
pub(super) use self::quiet::level;
use self::rescan::ports_of;
use super::data_words::read_declared;
use super::frame_limit;
use super::scan::{ScanError, read_one};
use super::shared_segment::SharedSegment;
use crate::info::SubDeviceInfo;
use crate::segment::disturbance::Disturbance;
use crate::segment::member::Phase;
use crate::segment::unassigned::{ByCables, Matches};
use crate::segment::{Observation, SubDeviceKey, Versions};
use crate::supervisor::{Bus, BusError};

/// Pause before a failed read of an SII is repeated; it doubles with every failure.
const FIRST_PAUSE: Duration = Duration::from_millis(100);
/// Longest pause.
const LONGEST_PAUSE: Duration = Duration::from_secs(5);
/// Maximum wait of a search for the end of another disturbance; then it is repeated.
const LIMIT: Duration = Duration::from_millis(20);
/// Consecutive failures of the bus before an event reports them.
const BUS_PATIENCE: u32 = 3;

/// Finds SubDevices without a known station address, assigns one to each and has them read. True if all SubDevices are
/// known.
pub(super) async fn search(bus: &Bus, segment: &SharedSegment) -> bool {
    let Some(turn) = segment.disturb(Disturbance::Readdress, LIMIT).await else { return false };
    let mut versions = segment.view().versions();
    let found = find(bus, segment, &mut versions).await;
    let result = match found {
        Ok(true) => Ok(()),
        Ok(false) => Err("SubDevices answer that cannot be distinguished".into()),
        Err(error) => Err(error.to_string()),
    };
    let is_complete = result.is_ok();
    segment.observe(Observation::Searched { versions, result });
    drop(turn);
    if segment.view().are_frames_doubtful() {
        frame_limit::explain(bus, segment).await;
    }
    is_complete
}

/// True if all SubDevices are known. The version is that of the addresses that it reads and assigns.
async fn find(bus: &Bus, segment: &SharedSegment, versions: &mut Versions) -> Result<bool, BusError> {
    let Some(before) = view(bus).await? else { return Ok(false) };
    let old = segment.view().unknown(&before);
    if old.is_empty() {
        segment.observe(Observation::Places { versions: *versions, view: &before });
        return Ok(true);
    }
    // A SubDevice with a new address is read again.
    segment.observe(Observation::Readdressing(&old));
    *versions = segment.view().versions();
    let (given, complete) = give(bus, segment, &before, &old).await?;
    let asked = segment.view().versions();
    let Some(mut after) = view(bus).await? else { return Ok(false) };
    let owners = segment.view().owners(&before.stations);
    let restored = restore(bus, segment, &owners, &before, &mut after).await;
    *versions = segment.view().versions();
    restored?;
    segment.observe(Observation::Places { versions: asked, view: &after });
    segment.observe(Observation::Given { versions: asked, view: &after, given: &given });
    *versions = segment.view().versions();
    let is_known = segment.view().unknown(&after).is_empty();
    Ok(complete && is_known)
}

/// Reads a SubDevice, repeatedly until it succeeds or the SubDevice is no longer unassigned.
pub(super) async fn read_unassigned(bus: Bus, segment: SharedSegment, key: SubDeviceKey) {
    let mut pause = FIRST_PAUSE;
    let mut bus_failures = 0;
    loop {
        let result = read_once(&bus, &segment, key).await;
        if segment.view().unassigned(key).is_none() {
            return;
        }
        let failed_on_bus = match &result {
            Err(ScanError::Bus(_)) => true,
            Err(ScanError::Sii { error, .. }) => error.is_passing(),
            Ok(_) | Err(_) => false,
        };
        bus_failures = if failed_on_bus { bus_failures + 1 } else { 0 };
        let is_patient = failed_on_bus && bus_failures < BUS_PATIENCE;
        let is_read = result.is_ok();
        let reason = |error: ScanError| (!is_patient).then(|| error.to_string());
        segment.observe(Observation::Read { key, read: result.map(Rc::new).map_err(reason) });
        if is_read {
            return;
        }
        bus.sleep(pause).await;
        pause = (pause * 2).min(LONGEST_PAUSE);
    }
}

async fn read_once(bus: &Bus, segment: &SharedSegment, key: SubDeviceKey) -> Result<SubDeviceInfo, ScanError> {
    let station = key.station;
    level(bus, station).await?;
    let position = segment.view().unassigned(key).map(|it| it.position);
    let alias_source = segment.view().alias_source();
    let mut info = read_one(bus, (position.unwrap_or_default(), station), &segment.cache, alias_source).await?;
    info.data_words = read_declared(bus, segment, station).await?;
    Ok(info)
}

/// Assigns their addresses to those that are absent members, and reports the others. To be called when it is known of
/// all members whether they are present: otherwise an unassigned SubDevice might be taken for another member of the
/// same type.
///
/// False if their positions could not be determined.
pub(super) async fn admit_all(bus: &Bus, segment: &SharedSegment) -> bool {
    let Some(by_cables) = find_places(bus, segment).await else { return false };
    let Matches { matched, held } = segment.view().match_all(&by_cables, bus.now());
    let attempts: Vec<u32> = segment.view().members().map(|member| member.attempt).collect();
    for (key, index) in held {
        segment.observe(Observation::Held { key, index, attempt: attempts[index] });
    }
    for (key, member) in matched {
        match member {
            Some(index) => admit(bus, segment, key, (index, attempts[index])).await,
            None => segment.observe(Observation::Unexpected(key)),
        }
    }
    true
}

/// Determines the positions again if a member is missing: the ring may have opened at another place since, and
/// SubDevices of the same type are distinguished by position only. Returns what the cables show; `None` while the
/// segment changes.
async fn find_places(bus: &Bus, segment: &SharedSegment) -> Option<ByCables> {
    let is_one_missed = {
        let view = segment.view();
        view.subdevices().unassigned().next().is_some() && view.members().any(|member| member.phase == Phase::Absent)
    };
    if !is_one_missed {
        return Some(ByCables::default());
    }
    let versions = segment.view().versions();
    let seen = view(bus).await.ok()??;
    // A SubDevice that was added since may be the first of several of the same type.
    if !segment.view().unknown(&seen).is_empty() {
        return None;
    }
    if !segment.view().are_places_valid(versions) {
        return None;
    }
    segment.observe(Observation::Places { versions, view: &seen });
    if !segment.view().needs_cables() {
        return Some(ByCables::default());
    }
    let ports = ports_of(bus, &seen).await.ok()??;
    let view = segment.view();
    view.are_places_valid(versions).then(|| view.identified_by_cables(&seen, &ports))
}

/// Makes an unassigned SubDevice the member that it is, unless its address cannot be written now.
async fn admit(bus: &Bus, segment: &SharedSegment, key: SubDeviceKey, (index, attempt): (usize, u32)) {
    // A mailbox message that has changed its PDOs is noted now: its mailbox is closed.
    let known = || {
        segment.observe_undeclared_pdos();
        segment.view().as_member(key, index)
    };
    let info = match known() {
        Some(Ok(info)) => info,
        Some(Err(reason)) => return segment.observe(Observation::Misfit { key, index, attempt, reason }),
        None => return,
    };
    let written = bus.fpwr(key.station, map::STATION_ADDRESS, &info.station.0.to_le_bytes()).await;
    // The reply to the first attempt may be lost; then the old address no longer answers.
    if written.is_err() && bus.fprd(info.station, map::STATION_ADDRESS, 2).await.is_err() {
        return;
    }
    let info = known().and_then(Result::ok).unwrap_or(info);
    segment.observe(Observation::Admitted { key, index, attempt, info: Box::new(info) });
}
