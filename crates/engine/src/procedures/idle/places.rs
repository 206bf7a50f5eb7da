//! SubDevices at other places than before: whether they are the ones that their station addresses name.
//!
//! Another program may write a station address. If the SubDevice that had this address leaves meanwhile, the address is
//! unique and known, but names another SubDevice. The same happens when a part of the segment comes that was isolated
//! during the last scan and kept addresses of an earlier one. A SubDevice that is where it was is not read: counted
//! from its link, its address is at the same place as before, and no SubDevice upstream of it has opened or closed a
//! port since.

use alloc::rc::Rc;
use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::{DlStatus, SiiConfiguration, map};
use ringcat_wire::sii::Identity;

use crate::info::SubDeviceInfo;
use crate::link::LinkSet;
use crate::procedures::shared_segment::SharedSegment;
use crate::procedures::sii;
use crate::ring::RingState;
use crate::segment::Found;
use crate::segment::view::View;
use crate::supervisor::{Bus, BusError};

/// Addresses of known SubDevices that other SubDevices have. `before`: the places of the last scan.
pub(super) async fn wrong_addresses(
    bus: &Bus,
    segment: &SharedSegment,
    (now, before): (&View, &Found),
    known: &[Rc<SubDeviceInfo>],
) -> Result<Vec<StationAddress>, BusError> {
    let are_as_before = ports_as_before(bus, now, before).await;
    // The frames of the acyclic half show it: without an application there are no others.
    let is_closed = bus.links() == LinkSet::Ring && bus.ring() == RingState::Closed;
    let elsewhere = elsewhere(now, before, &are_as_before, is_closed);
    let doubtful = known.iter().filter(|info| elsewhere.contains(&info.station) && !info.is_blank());
    let doubtful: Vec<(StationAddress, Identity)> = doubtful.map(|info| (info.station, info.identity)).collect();
    let read = bus.gather(doubtful, |bus, (station, expected)| {
        let segment = segment.clone();
        async move {
            let is_it = has_identity(&bus, &segment, station, expected).await?;
            Ok::<_, BusError>((!is_it).then_some(station))
        }
    });
    read.await.into_iter().filter_map(Result::transpose).collect()
}

/// For each position, counted from the link that reaches it, whether the SubDevice there has the ports open that were
/// open in the last scan.
async fn ports_as_before(bus: &Bus, now: &View, before: &Found) -> Vec<bool> {
    let read = bus.gather(now.stations.clone(), |bus, station| async move {
        // Where several SubDevices have the address, the answer does not count.
        Some(DlStatus::decode(&bus.fprd_array(station, map::DL_STATUS).await.ok()?))
    });
    let open = |status: DlStatus| status.ports.map(|port| port.communication);
    let read: Vec<Option<DlStatus>> = read.await;
    let all = read.into_iter().enumerate();
    all.map(|(at, status)| {
        let was = place_before(at, now, before).map(|place| before.subdevices[place].dl_status);
        status.zip(was).is_some_and(|(status, was)| open(status) == open(was))
    })
    .collect()
}

/// The position in the last scan that has the same distance from the link that reaches this position now.
fn place_before(at: usize, now: &View, before: &Found) -> Option<usize> {
    let is_main = at < usize::from(now.counts.0.0);
    let place = if is_main { Some(at) } else { (before.subdevices.len() + at).checked_sub(now.stations.len()) };
    place.filter(|place| *place < before.subdevices.len())
}

/// Addresses that are unique, and not at the place of the last scan behind ports that are as before. `is_closed`: the
/// ring of both links is closed.
fn elsewhere(now: &View, before: &Found, are_as_before: &[bool], is_closed: bool) -> Vec<StationAddress> {
    let (count, main_count) = (now.stations.len(), usize::from(now.counts.0.0));
    // In a closed ring a SubDevice whose path from one end is as before has not been replaced.
    let is_closed = is_closed && count == before.subdevices.len();
    let (from_main, from_redundant) = unchanged_parts(are_as_before, main_count, is_closed);
    let is_there = |at: usize, station: StationAddress| {
        let place = place_before(at, now, before);
        let is_as_before = at < from_main || at >= from_redundant;
        is_as_before && place.is_some_and(|place| before.subdevices[place].station == station)
    };
    let all = now.stations.iter().copied().enumerate();
    let others = all.filter(|(at, station)| now.position(*station).is_some() && !is_there(*at, *station));
    others.map(|(_, station)| station).collect()
}

/// The end of the part that the main link reaches through ports that are as before, and the beginning of that of the
/// redundant link.
fn unchanged_parts(are_as_before: &[bool], main_count: usize, is_closed: bool) -> (usize, usize) {
    let count = are_as_before.len();
    let main = are_as_before.iter().take(main_count).take_while(|as_before| **as_before).count();
    let reached = if is_closed { count } else { count.saturating_sub(main_count) };
    let redundant = are_as_before.iter().rev().take(reached).take_while(|as_before| **as_before).count();
    // The first SubDevice with other ports is upstream of the change: it is at the same place as before.
    ((main + 1).min(main_count), count - (redundant + 1).min(reached))
}

/// Whether the SubDevice with a station address has an identity; if its EEPROM cannot be read, true.
async fn has_identity(
    bus: &Bus,
    segment: &SharedSegment,
    station: StationAddress,
    expected: Identity,
) -> Result<bool, BusError> {
    let _turn = segment.eeproms.take(station).await;
    let before = SiiConfiguration::from_bits(bus.fprd_array::<1>(station, map::SII_CONFIGURATION).await?[0]);
    if before.offer_pdi {
        sii::claim(bus, station).await?;
    }
    let read = sii::identity(bus, station, &segment.cache).await;
    if before.offer_pdi {
        sii::assign(bus, station, true).await?;
    }
    let facts = |identity: Identity| (identity.vendor_id, identity.product_code, identity.serial);
    Ok(read.map_or(true, |identity| facts(identity) == facts(expected)))
}

#[cfg(test)]
mod tests {
    use ringcat_wire::address::Wkc;

    use super::*;
    use crate::board::RingWord;
    use crate::topology::Topology;

    fn before(stations: &[u16]) -> Found {
        let info = |station: &u16| SubDeviceInfo { station: StationAddress(*station), ..SubDeviceInfo::default() };
        let subdevices = stations.iter().map(|station| Rc::new(info(station))).collect();
        Found { subdevices, topology: Topology::default(), main_count: stations.len() }
    }

    fn elsewhere_behind(main: &[u16], redundant: &[u16], changed: &[usize], is_closed: bool) -> Vec<u16> {
        let stations: Vec<StationAddress> =
            main.iter().chain(redundant).map(|station| StationAddress(*station)).collect();
        let counts = (Wkc(main.len() as u16), Wkc(redundant.len() as u16));
        let are_as_before: Vec<bool> = (0..stations.len()).map(|at| !changed.contains(&at)).collect();
        let now = View { counts, ring: RingWord::default(), stations };
        elsewhere(&now, &before(&[1, 2, 3, 4]), &are_as_before, is_closed)
            .into_iter()
            .map(|station| station.0)
            .collect()
    }

    fn elsewhere_of(main: &[u16], redundant: &[u16]) -> Vec<u16> {
        elsewhere_behind(main, redundant, &[], false)
    }

    // covers: states
    #[test]
    fn addresses_at_their_places_are_trusted_and_others_are_read() {
        let nothing: Vec<u16> = Vec::new();
        assert_eq!(elsewhere_of(&[1, 2, 3, 4], &[]), nothing);
        assert_eq!(elsewhere_of(&[1, 2], &[]), nothing, "the end of a line has left");
        assert_eq!(elsewhere_of(&[1], &[3, 4]), nothing, "one of a ring has left");
        assert_eq!(elsewhere_of(&[], &[2, 3, 4]), nothing);
        assert_eq!(elsewhere_of(&[1, 2, 3, 4, 9], &[]), [9], "one was added");
        assert_eq!(elsewhere_of(&[1, 3], &[4]), [3], "2 has got the address of 3, which has left");
        assert_eq!(elsewhere_of(&[1], &[2, 4]), [2], "3 has got the address of 2, which has left");
        assert_eq!(elsewhere_of(&[1, 3, 2, 4], &[]), [3, 2], "two have changed places");
        assert_eq!(elsewhere_of(&[2], &[]), [2]);
        assert_eq!(elsewhere_of(&[1, 3, 3, 4], &[]), nothing, "doubled addresses are taken away in any case");
    }

    // covers: states
    #[test]
    fn addresses_behind_ports_that_have_changed_are_read() {
        let open =
            |main: &[u16], redundant: &[u16], changed: &[usize]| elsewhere_behind(main, redundant, changed, false);
        let nothing: Vec<u16> = Vec::new();
        assert_eq!(open(&[1, 2, 3, 4], &[], &[1]), [3, 4], "a part came behind 2");
        assert_eq!(open(&[1, 2], &[], &[1]), nothing, "the end of a line has left");
        assert_eq!(open(&[1, 2], &[3, 4], &[1, 2]), nothing, "a ring has opened");
        assert_eq!(open(&[1], &[2, 3, 4], &[2]), [2], "a part came behind 3");
        let closed = |changed: &[usize]| elsewhere_behind(&[1, 2, 3, 4], &[], changed, true);
        assert_eq!(closed(&[1, 2]), nothing, "a ring was closed");
        assert_eq!(closed(&[0, 3]), [2, 3], "a part of a ring came back");
    }
}
