//! Differences between two scans without an application.

use alloc::vec::Vec;

use ringcat_wire::address::{Position, StationAddress};

use crate::ring_status::LinkCounts;
use crate::segment::ascent::longest_ascent;
use crate::segment::scan::Found;

/// What a scan without an application has found to be different.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Differences {
    /// SubDevices on each link.
    pub counts: LinkCounts,
    /// SubDevices that have got an address.
    pub added: Vec<StationAddress>,
    /// SubDevices that do not answer any more.
    pub removed: Vec<StationAddress>,
    /// Those that are at another place among the others, with their positions before.
    pub moved: Vec<(StationAddress, Position)>,
}

impl Differences {
    /// Compares a scan with the scan before.
    pub(in crate::segment) fn between(before: &Found, now: &Found) -> Differences {
        let (before, stations) = (before.stations(), now.stations());
        let not_in = |all: &[StationAddress], others: &[StationAddress]| {
            all.iter().copied().filter(|station| !others.contains(station)).collect()
        };
        let place = |station: &StationAddress| before.iter().position(|other| other == station);
        let stayed = || stations.iter().filter_map(|station| Some((*station, place(station)?)));
        let places: Vec<usize> = stayed().map(|(_, place)| place).collect();
        let moved = stayed().zip(longest_ascent(&places)).filter(|(_, stays)| !stays);
        let moved = moved.map(|((station, place), _)| (station, Position(place as u16))).collect();
        let (added, removed) = (not_in(&stations, &before), not_in(&before, &stations));
        Differences { counts: now.counts(), added, removed, moved }
    }
}
