//! The station addresses of all positions, in the order in which frames pass them.

use alloc::vec::Vec;

use ringcat_wire::address::{StationAddress, Wkc};

use crate::board::RingWord;

/// The station address at each position.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct View {
    /// SubDevices on the main and on the redundant link.
    pub counts: (Wkc, Wkc),
    /// The state of the ring at that time.
    pub ring: RingWord,
    /// Station addresses by position.
    pub stations: Vec<StationAddress>,
}

impl View {
    /// The positions at which a station address answers.
    pub fn positions(&self, station: StationAddress) -> impl Iterator<Item = usize> + '_ {
        positions(&self.stations, station)
    }

    /// The position of a station address that only one SubDevice has.
    pub fn position(&self, station: StationAddress) -> Option<usize> {
        position(&self.stations, station)
    }
}

/// The positions of a station address.
fn positions(stations: &[StationAddress], station: StationAddress) -> impl Iterator<Item = usize> + '_ {
    stations.iter().enumerate().filter(move |(_, at)| **at == station).map(|(position, _)| position)
}

/// The position of a station address that only one SubDevice has.
pub(super) fn position(stations: &[StationAddress], station: StationAddress) -> Option<usize> {
    let mut positions = positions(stations, station);
    let first = positions.next()?;
    positions.next().is_none().then_some(first)
}
