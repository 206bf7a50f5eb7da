//! Which SubDevices have had no station address since power-on: no MainDevice has written their dictionaries since.

use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::address::{Position, StationAddress, Wkc};
use ringcat_wire::register::map;

use super::stations::station_at;
use crate::info::PdoSource;
use crate::supervisor::Bus;

/// Where the PDOs of SubDevices are known from, by position. A scan that begins again gives the same addresses again:
/// they were given after power-on, too.
#[derive(Debug, Default)]
pub(super) struct PowerOns {
    given: Vec<StationAddress>,
}

impl PowerOns {
    /// Reads the station addresses before others are given. What cannot be read counts as written.
    pub async fn read(&mut self, bus: &Bus, count: u16) -> Vec<PdoSource> {
        let sources = match all_are_fresh(bus, count).await {
            true => vec![PdoSource::Sii; count.into()],
            false => self.read_each(bus, count).await,
        };
        let fresh = (0..).zip(&sources).filter(|(_, source)| source.is_of_power_on());
        self.given = fresh.map(|(position, _)| station_at(Position(position))).collect();
        sources
    }

    async fn read_each(&self, bus: &Bus, count: u16) -> Vec<PdoSource> {
        let read = bus.gather((0..count).map(Position), |bus, position| async move {
            let bytes = bus.aprd(position, map::STATION_ADDRESS, 2).await.ok()?;
            Some(StationAddress(u16::from_le_bytes([*bytes.first()?, *bytes.get(1)?])))
        });
        let stations: Vec<Option<StationAddress>> = read.await;
        let is_unique = |station| stations.iter().filter(|other| **other == Some(station)).count() == 1;
        let source = |station: &Option<StationAddress>| match *station {
            Some(StationAddress(0)) => PdoSource::Sii,
            Some(station) if self.given.contains(&station) && is_unique(station) => PdoSource::Sii,
            Some(_) | None => PdoSource::Outdated,
        };
        stations.iter().map(source).collect()
    }
}

/// Whether the addresses of all SubDevices are 0, which one datagram shows: most scans follow power-on.
async fn all_are_fresh(bus: &Bus, count: u16) -> bool {
    let ored = bus.brd(map::STATION_ADDRESS, 2).await;
    ored.is_ok_and(|ored| ored.wkc() == Wkc(count) && ored.data.iter().all(|byte| *byte == 0))
}
