//! Reads what a scan left out of the SIIs ([`SiiExtent`]): names and operation modes.
//!
//! On request at once; otherwise in the background, when all SubDevices are in their target states. A few SubDevices
//! are read at a time, and those of one type share what two of them have returned.

use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::register::{SiiConfiguration, map};

use super::scan::read_whole;
use super::services::ServiceError;
use super::shared_segment::SharedSegment;
use super::sii;
use crate::event::Notice;
use crate::info::{SiiExtent, SubDeviceInfo};
use crate::segment::member::Phase;
use crate::segment::{More, Observation, SubDeviceKey};
use crate::supervisor::Bus;

/// How long SubDevices are waited for that do not reach their target state, before it reads the others.
const PATIENCE: Duration = Duration::from_secs(5);
/// Attempts in the background: a SubDevice may be absent for a while.
const ATTEMPTS: u32 = 3;
/// Pause between two attempts.
const AGAIN: Duration = Duration::from_secs(5);

/// What to do with an EEPROM that is assigned to the PDI.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum OfPdi {
    /// It is read, and assigned to the PDI again.
    Read,
    /// It is left alone: the application of the SubDevice may be using it.
    Leave,
}

/// Reads the rest for an application that needs it now. SubDevices that are being configured are waited for: on the way
/// to PREOP the PDI holds the EEPROM.
///
/// # Errors
/// The error of the first SubDevice that could not be read; the others are read nevertheless.
pub(crate) async fn complete(bus: &Bus, segment: &SharedSegment) -> Result<Vec<SubDeviceInfo>, ServiceError> {
    settled(bus, segment).await;
    read_rest(bus, segment, OfPdi::Read).await.into_iter().try_for_each(|(_, read)| read)?;
    Ok(segment.view().found().map(|found| found.scan().subdevices).unwrap_or_default())
}

/// Reads the rest while the application runs.
pub(crate) async fn complete_in_background(bus: Bus, segment: SharedSegment) {
    settled(&bus, &segment).await;
    for attempt in 1..=ATTEMPTS {
        let read = read_rest(&bus, &segment, OfPdi::Leave).await;
        let failed = read.into_iter().filter_map(|(position, read)| Some((position, read.err()?)));
        let failed: Vec<(Position, ServiceError)> = failed.collect();
        if failed.is_empty() {
            return;
        }
        if attempt == ATTEMPTS {
            for (position, error) in failed {
                let what = alloc::format!("the rest of the SII, with its names, cannot be read: {error}");
                bus.notice(Notice::SiiWarning { position, what });
            }
            return;
        }
        bus.sleep(AGAIN).await;
    }
}

/// Waits until no SubDevice is being configured, if the SII of any is incomplete, or until the limit: the names of the
/// others are wanted nevertheless.
async fn settled(bus: &Bus, segment: &SharedSegment) {
    if incomplete(segment).is_empty() {
        return;
    }
    let settled = segment.until(|segment| {
        let is_settled = |phase: &Phase| matches!(phase, Phase::Settled(_) | Phase::Absent);
        segment.members().all(|member| is_settled(&member.phase)).then_some(())
    });
    let _ = bus.within(PATIENCE, settled).await;
}

/// A SubDevice of whose SII only a part is known: position, station address, and its key unless it has left.
type Incomplete = (Position, StationAddress, Option<SubDeviceKey>);

fn incomplete(segment: &SharedSegment) -> Vec<Incomplete> {
    let view = segment.view();
    let found = view.found().into_iter().flat_map(|found| &found.subdevices);
    let key = |station: StationAddress| view.subdevices().at(station).map(|it| it.key);
    let incomplete = found.filter(|info| info.extent < SiiExtent::Complete);
    incomplete.map(|info| (info.position, info.station, key(info.station))).collect()
}

/// Reads each SII of which only a part is known.
async fn read_rest(bus: &Bus, segment: &SharedSegment, of_pdi: OfPdi) -> Vec<(Position, Result<(), ServiceError>)> {
    let wanted = incomplete(segment);
    let read = |bus: Bus, incomplete: Incomplete| {
        let segment = segment.clone();
        async move { (incomplete.0, read_one(&bus, &segment, incomplete, of_pdi).await) }
    };
    match of_pdi {
        OfPdi::Read => bus.gather(wanted, read).await,
        OfPdi::Leave => bus.gather_in_turns(wanted, read).await,
    }
}

async fn read_one(
    bus: &Bus,
    segment: &SharedSegment,
    (position, station, key): Incomplete,
    of_pdi: OfPdi,
) -> Result<(), ServiceError> {
    let _turn = segment.eeproms.take(station).await;
    let before = SiiConfiguration::from_bits(bus.fprd_array::<1>(station, map::SII_CONFIGURATION).await?[0]);
    match (before.offer_pdi, of_pdi) {
        (true, OfPdi::Leave) => return Ok(()),
        (true, OfPdi::Read) => sii::claim(bus, station).await?,
        (false, OfPdi::Read | OfPdi::Leave) => {}
    }
    let alias_source = segment.view().alias_source();
    let read = read_whole(bus, (position, station), &segment.cache, alias_source).await;
    if before.offer_pdi {
        sii::assign(bus, station, true).await?;
    }
    let read = read?;
    if let Some(key) = key {
        segment.observe(Observation::MoreRead { key, more: More::Sii(&read) });
    }
    Ok(())
}
