//! SubDevices at other places than before: whether they are the ones that their station addresses name.
//!
//! Another program may write a station address. If the SubDevice that had this address leaves meanwhile, the address is
//! unique and known, but names another SubDevice. A SubDevice that is where it was is not read: counted from its link,
//! its address is at the same place as before.

use alloc::rc::Rc;
use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::{SiiConfiguration, map};
use ringcat_wire::sii::Identity;

use crate::info::SubDeviceInfo;
use crate::procedures::shared_segment::SharedSegment;
use crate::procedures::sii;
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
    let elsewhere = elsewhere(now, before);
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

/// Addresses that are unique and not at the place of the last scan, counted from the link that reaches them.
fn elsewhere(now: &View, before: &Found) -> Vec<StationAddress> {
    let (stations, main_count) = (before.stations(), usize::from(now.counts.0.0));
    let from_end = |all: &[StationAddress], at: usize| all.len().checked_sub(at + 1).map(|place| all[place]);
    let is_there = |at: usize, station: StationAddress| match at < main_count {
        true => stations.get(at) == Some(&station),
        false => from_end(&stations, now.stations.len() - 1 - at) == Some(station),
    };
    let all = now.stations.iter().copied().enumerate();
    let others = all.filter(|(at, station)| now.position(*station).is_some() && !is_there(*at, *station));
    others.map(|(_, station)| station).collect()
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

    fn elsewhere_of(main: &[u16], redundant: &[u16]) -> Vec<u16> {
        let stations = main.iter().chain(redundant).map(|station| StationAddress(*station)).collect();
        let counts = (Wkc(main.len() as u16), Wkc(redundant.len() as u16));
        let now = View { counts, ring: RingWord::default(), stations };
        elsewhere(&now, &before(&[1, 2, 3, 4])).into_iter().map(|station| station.0).collect()
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
}
