//! SubDevices that answer but have no station address of ours: found, looked at, and told which declared SubDevice they
//! are. One that is nobody's keeps a temporary address and is looked at again when a declared one is lost.

use alloc::rc::Rc;
use alloc::string::ToString;
use alloc::vec::Vec;
use core::ops::RangeInclusive;

use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::register::map;

use super::configure::Start;
use super::fleet::{Phase, Setup, SharedFleet};
use super::recover::start;
use super::scan::{MAX_SUBDEVICES, ScanError, event_mask, read_one};
use super::sii::claim;
use crate::config::ConfigAddress;
use crate::event::Event;
use crate::info::SubDeviceInfo;
use crate::supervisor::{Bus, BusError};

/// Temporary station addresses, taken in turn: one that was given to a SubDevice that vanished before anything was read
/// from it must not be given to another one soon.
const TEMPORARY: RangeInclusive<u16> = 0xC000..=0xFFFE;

/// A SubDevice that answers but is nobody's yet.
#[derive(Clone, Debug)]
pub struct Stranger {
    /// Who it is, with its temporary address.
    pub info: SubDeviceInfo,
    /// Index of the nearest member before it, and behind it, in the order of positions.
    pub between: (Option<usize>, Option<usize>),
    /// It was met by the copy on the main link.
    pub from_main: bool,
    /// It was reported as unexpected.
    pub reported: bool,
}

impl Stranger {
    /// A stranger among the owners of all positions, of which the main copy meets the first `main_count`.
    pub(crate) fn new(info: SubDeviceInfo, owners: &[Option<usize>], main_count: usize, reported: bool) -> Stranger {
        let at = usize::from(info.position.0);
        let before = owners.iter().take(at).rev().copied().flatten().next();
        let behind = owners.iter().skip(at + 1).copied().flatten().next();
        Stranger { info, between: (before, behind), from_main: at < main_count, reported }
    }
}

/// Finds SubDevices without a known station address.
pub(super) async fn find(bus: &Bus, fleet: &SharedFleet) -> Result<(), ScanError> {
    // Positions behind a break are counted from there (facts CR-09).
    let counted = bus.brd(map::TYPE, 1).await?;
    let count = counted.wkc().0.min(MAX_SUBDEVICES);
    let read = bus.gather((0..count).map(Position), |bus, position| async move {
        let bytes = bus.aprd(position, map::STATION_ADDRESS, 2).await?;
        Ok::<_, BusError>(StationAddress(u16::from_le_bytes([bytes[0], bytes[1]])))
    });
    let owners = read.await.into_iter().collect::<Result<Vec<_>, _>>()?;
    let known = owners_of(fleet, &owners);
    for (at, station) in owners.iter().enumerate() {
        if known[at].is_some() || is_stranger(fleet, *station) {
            continue;
        }
        let position = Position(at as u16);
        let temporary = next_temporary(fleet, &owners);
        bus.apwr(position, map::STATION_ADDRESS, &temporary.0.to_le_bytes()).await?;
        level(bus, temporary).await?;
        let cache = fleet.access().cache.clone();
        let info = read_one(bus, position, temporary, &cache).await?;
        fleet.access().strangers.push(Stranger::new(info, &known, usize::from(counted.main.0), false));
    }
    Ok(())
}

/// The member at each position. Where two SubDevices have the address of one member, the one at its place is it.
fn owners_of(fleet: &SharedFleet, owners: &[StationAddress]) -> Vec<Option<usize>> {
    let access = fleet.access();
    let member = |station: &StationAddress| access.members.iter().position(|member| member.station == *station);
    let mut known: Vec<Option<usize>> = owners.iter().map(member).collect();
    for at in 0..known.len() {
        let Some(index) = known[at] else { continue };
        let others = (at + 1..known.len()).filter(|other| known[*other] == Some(index)).collect::<Vec<_>>();
        let place = access.members[index].info.as_ref().map(|info| usize::from(info.position.0));
        let keep = others.iter().copied().find(|other| Some(*other) == place).unwrap_or(at);
        for other in others.into_iter().chain([at]).filter(|other| *other != keep) {
            known[other] = None;
        }
    }
    known
}

fn is_stranger(fleet: &SharedFleet, station: StationAddress) -> bool {
    fleet.access().strangers.iter().any(|stranger| stranger.info.station == station)
}

/// A temporary address that none of those present has.
fn next_temporary(fleet: &SharedFleet, present: &[StationAddress]) -> StationAddress {
    let count = TEMPORARY.end() - TEMPORARY.start() + 1;
    let mut address = StationAddress(*TEMPORARY.start());
    for _ in 0..count {
        let mut access = fleet.access();
        address = StationAddress(TEMPORARY.start() + access.next_temporary % count);
        access.next_temporary = access.next_temporary.wrapping_add(1);
        let taken = access.strangers.iter().any(|stranger| stranger.info.station == address);
        if !taken && !present.contains(&address) {
            break;
        }
    }
    address
}

/// The same starting point as after a scan, for one SubDevice; the rest comes with its configuration.
async fn level(bus: &Bus, station: StationAddress) -> Result<(), BusError> {
    bus.fpwr(station, map::DL_CONTROL.offset(1), &[0]).await?;
    bus.fpwr(station, map::DL_CONTROL.offset(3), &[0]).await?;
    bus.fpwr(station, map::ECAT_EVENT_MASK, &event_mask().encode()).await?;
    claim(bus, station).await
}

/// Tells strangers which absent members they are and starts their configuration. To be called when it is known of all
/// members whether they are there: one that is absent, but not known to be, may be the one that a stranger is.
pub(super) async fn admit_all(bus: &Bus, fleet: &SharedFleet) {
    let mut at = 0;
    while let Some(stranger) = { fleet.access().strangers.get(at).cloned() } {
        if admit(bus, fleet, &stranger).await {
            fleet.access().strangers.retain(|other| other.info.station != stranger.info.station);
        } else {
            at += 1;
        }
    }
}

/// Admits one stranger; true where it is one no longer.
async fn admit(bus: &Bus, fleet: &SharedFleet, stranger: &Stranger) -> bool {
    let temporary = stranger.info.station;
    let Some(index) = member_for(fleet, stranger) else {
        if note_reported(fleet, temporary) {
            let SubDeviceInfo { position, identity, .. } = stranger.info;
            bus.report(Event::Unexpected { position, identity });
        }
        return false;
    };
    let (info, setup) = {
        let access = fleet.access();
        let member = &access.members[index];
        let info = SubDeviceInfo { station: member.station, ..stranger.info.clone() };
        let setup = Setup::new(index, &member.config, &info, &access.layout);
        (info, setup)
    };
    let setup = match setup {
        Ok(setup) => setup,
        Err(error) => {
            if note_reported(fleet, temporary) {
                bus.report(Event::ConfigurationFailed { subdevice: index, reason: error.to_string() });
            }
            return false;
        }
    };
    if bus.fpwr(temporary, map::STATION_ADDRESS, &info.station.0.to_le_bytes()).await.is_err() {
        return false;
    }
    {
        let member = &mut fleet.access().members[index];
        member.setup = Some(Rc::new(setup));
        member.info = Some(info);
        member.configured = false;
    }
    bus.report(Event::Returned { subdevice: index });
    start(bus, fleet, index, Start::Unknown);
    true
}

/// Notes that a stranger was reported; false where it was before.
fn note_reported(fleet: &SharedFleet, station: StationAddress) -> bool {
    let mut access = fleet.access();
    let Some(stranger) = access.strangers.iter_mut().find(|stranger| stranger.info.station == station) else {
        return false;
    };
    !core::mem::replace(&mut stranger.reported, true)
}

/// The absent member that a stranger is. One with the same serial number wins; else, coming from the main link, the
/// first that fits between its neighbours, and coming from the redundant link the last: a SubDevice can only answer
/// through its neighbours.
fn member_for(fleet: &SharedFleet, stranger: &Stranger) -> Option<usize> {
    let access = fleet.access();
    let identity = &stranger.info.identity;
    let fits = |index: &usize| {
        let member = &access.members[*index];
        let same_product = member.info.as_ref().is_none_or(|info| {
            (info.identity.vendor_id, info.identity.product_code) == (identity.vendor_id, identity.product_code)
        });
        let same_alias = match member.config.address {
            ConfigAddress::Alias { alias, offset: 0 } if alias != 0 => alias == stranger.info.alias,
            _ => true,
        };
        member.phase == Phase::Absent
            && same_product
            && same_alias
            && member.config.expected.mismatch(identity).is_none()
    };
    let before = stranger.between.0.map_or(0, |index| index + 1);
    let behind = stranger.between.1.unwrap_or(access.members.len()).max(before);
    let candidates: Vec<usize> = (before..behind).filter(fits).collect();
    let same_serial = |index: &&usize| {
        let info = access.members[**index].info.as_ref();
        identity.serial != 0 && info.is_some_and(|info| info.identity.serial == identity.serial)
    };
    let by_serial = candidates.iter().find(same_serial);
    let by_place = if stranger.from_main { candidates.first() } else { candidates.last() };
    by_serial.or(by_place).copied()
}
