//! Station addresses that several SubDevices had: determines which of them is the member.
//!
//! A SubDevice of an earlier session, or of another MainDevice, may have a member's address and its identity too. The
//! FMMUs distinguish them: each session has its own logical addresses (decision 0023), so only the member has FMMUs
//! with the addresses written to it. If nothing was mapped, position and identity decide. SubDevices that are not the
//! member keep their temporary address, and are unassigned.

use alloc::vec::Vec;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::register::map;

use crate::procedures::shared_segment::SharedSegment;
use crate::procedures::sii;
use crate::segment::Owners;
use crate::segment::view::View;
use crate::supervisor::{Bus, BusError};

/// Evidence whether a SubDevice is a member.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) enum MappingEvidence {
    /// It holds the FMMUs that were written to the member.
    Held,
    /// It does not hold the FMMUs that were written to the member.
    Missing,
    /// No process data is mapped for the member at present.
    Unmapped,
    /// The member has no FMMUs.
    None,
}

/// Whether the SubDevice at a station address holds the mapping of a member.
pub(in super::super) async fn mapping_evidence(
    bus: &Bus,
    segment: &SharedSegment,
    index: usize,
    station: StationAddress,
) -> Result<MappingEvidence, BusError> {
    let (expected, is_mapped) = {
        let access = segment.view();
        let Some(member) = access.member(index) else { return Ok(MappingEvidence::None) };
        let registers = member.setup.as_ref().map(|setup| setup.fmmu_registers());
        (registers.unwrap_or_default(), member.configured)
    };
    match (expected.is_empty(), is_mapped) {
        (true, _) => return Ok(MappingEvidence::None),
        (false, false) => return Ok(MappingEvidence::Unmapped),
        (false, true) => {}
    }
    match bus.fprd(station, map::FMMU_BASE, expected.len()).await {
        Ok(got) => Ok(if got == expected { MappingEvidence::Held } else { MappingEvidence::Missing }),
        // It has fewer FMMUs than the member.
        Err(BusError::Wkc { got: Wkc(0), .. }) => Ok(MappingEvidence::Missing),
        Err(error) => Err(error),
    }
}

/// Whether the SubDevice at a station address has the identity and serial number of a member; if it cannot be read,
/// true.
pub(in super::super) async fn has_identity(
    bus: &Bus,
    segment: &SharedSegment,
    index: usize,
    station: StationAddress,
) -> bool {
    let known = {
        let view = segment.view();
        let Some(member) = view.member(index) else { return false };
        member.info.map(|info| info.identity)
    };
    let Some(known) = known else { return true };
    if sii::claim(bus, station).await.is_err() {
        return true;
    }
    match sii::identity(bus, station, &segment.cache).await {
        Ok(now) => (now.vendor_id, now.product_code, now.serial) == (known.vendor_id, known.product_code, known.serial),
        Err(_) => true,
    }
}

/// Gives each member its address back if several SubDevices had it. `before` is the view then, `after` the view now
/// that each of them has an address of its own, `owners` the member at each place by order.
pub(super) async fn restore(
    bus: &Bus,
    segment: &SharedSegment,
    owners: &Owners,
    before: &View,
    after: &mut View,
) -> Result<(), BusError> {
    let doubled = doubled(segment, before);
    for (index, station) in doubled {
        if after.positions(station).next().is_some() {
            continue;
        }
        let Some(keeper) = keeper(bus, segment, owners, before, after, index, station).await? else { continue };
        bus.fpwr(keeper, map::STATION_ADDRESS, &station.0.to_le_bytes()).await?;
        after.stations.iter_mut().filter(|it| **it == keeper).for_each(|it| *it = station);
    }
    Ok(())
}

/// Members whose addresses several SubDevices have.
fn doubled(segment: &SharedSegment, view: &View) -> Vec<(usize, StationAddress)> {
    let access = segment.view();
    let members = access.members().enumerate().map(|(index, member)| (index, member.station));
    members.filter(|(_, station)| view.positions(*station).count() > 1).collect()
}

/// The present address of the member, if it is known which SubDevice it is.
async fn keeper(
    bus: &Bus,
    segment: &SharedSegment,
    owners: &Owners,
    before: &View,
    after: &View,
    index: usize,
    station: StationAddress,
) -> Result<Option<StationAddress>, BusError> {
    let has_moved = before.counts != after.counts;
    let known: Vec<StationAddress> = segment.view().members().map(|member| member.station).collect();
    // If positions have changed meanwhile, any SubDevice without an assigned address may be one of them.
    let is_candidate = |at: &usize| match before.stations.get(*at) {
        Some(then) if !has_moved => *then == station,
        _ => !known.contains(&after.stations[*at]),
    };
    let mut holders = Vec::new();
    for at in (0..after.stations.len()).filter(is_candidate) {
        let now = after.stations[at];
        match mapping_evidence(bus, segment, index, now).await? {
            MappingEvidence::Held => holders.push(now),
            MappingEvidence::Missing => {}
            MappingEvidence::Unmapped | MappingEvidence::None => {
                return by_place(bus, segment, owners, before, after, index).await;
            }
        }
    }
    // If several hold the mapping, one was configured in place of another before.
    Ok(if let [only] = holders[..] { Some(only) } else { None })
}

/// The member by position and identity only.
async fn by_place(
    bus: &Bus,
    segment: &SharedSegment,
    owners: &Owners,
    before: &View,
    after: &View,
    index: usize,
) -> Result<Option<StationAddress>, BusError> {
    if before.counts != after.counts {
        return Ok(None);
    }
    let Some(at) = owners.all().iter().position(|owner| *owner == Some(index)) else { return Ok(None) };
    let now = after.stations[at];
    if after.position(now).is_none() {
        return Ok(None);
    }
    Ok(has_identity(bus, segment, index, now).await.then_some(now))
}
