//! A temporary station address for each SubDevice that has none of ours, without ever writing to a position.
//!
//! Positions move when a cable is cut or plugged in, also while a frame is on its way, and a write to a position may
//! then hit a SubDevice in OP. So positions are only read. Addresses are given through the address that a SubDevice
//! has: one that no other has is written, and where several have the same one it is exchanged (FPRW): the first
//! SubDevice on a link takes the new address and hands its old one on with the datagram, so that the others take what
//! they have.

use alloc::vec::Vec;
use core::ops::RangeInclusive;

use ringcat_wire::address::{Position, StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::map;

use super::super::scan::MAX_SUBDEVICES;
use super::super::shared_segment::SharedSegment;
use crate::segment::view::View;
use crate::supervisor::{Bus, BusError};

/// Temporary station addresses, taken in turn: one that was out of reach for a while must not be mistaken for another.
const TEMPORARY: RangeInclusive<u16> = 0xC000..=0xFFFE;
/// Addresses that are given in one round, before all others are looked at again.
const ROUND: usize = 64;
/// What a SubDevice adds to the working counter when it reads and writes.
const EXCHANGED: u16 = 3;

/// Reads all station addresses; `None` while the segment changes.
async fn read(bus: &Bus) -> Result<Option<View>, BusError> {
    let ring = |bus: &Bus| bus.board().map(|board| board.ring()).unwrap_or_default();
    let before = ring(bus);
    // Positions behind a break are counted from there (protocol CR-09).
    let counted = bus.brd(map::TYPE, 1).await?;
    let count = counted.wkc().0.min(MAX_SUBDEVICES);
    let read = bus.gather((0..count).map(Position), |bus, position| async move {
        let bytes = bus.aprd(position, map::STATION_ADDRESS, 2).await?;
        Ok::<_, BusError>(StationAddress(u16::from_le_bytes([bytes[0], bytes[1]])))
    });
    let stations = match read.await.into_iter().collect::<Result<Vec<_>, _>>() {
        Ok(stations) => stations,
        Err(BusError::Wkc { .. }) => return Ok(None),
        Err(error) => return Err(error),
    };
    let again = bus.brd(map::TYPE, 1).await?;
    let counts = (counted.main, counted.redundant);
    let steady = counts == (again.main, again.redundant) && before == ring(bus);
    Ok(steady.then_some(View { counts, ring: before, stations }))
}

/// Reads all station addresses twice; `None` where that is not the same.
pub(in super::super) async fn view(bus: &Bus) -> Result<Option<View>, BusError> {
    let Some(first) = read(bus).await? else { return Ok(None) };
    Ok(read(bus).await?.filter(|second| *second == first))
}

/// A temporary address that no SubDevice has.
fn fresh(segment: &SharedSegment, present: &[StationAddress]) -> StationAddress {
    let view = segment.view();
    let mut address = StationAddress(*TEMPORARY.start());
    for _ in TEMPORARY {
        address = StationAddress(TEMPORARY.start() + segment.next_temporary() % TEMPORARY.len() as u16);
        let is_taken = present.contains(&address)
            || view.cabling.stations.contains(&address)
            || view.member_of(address).is_some()
            || view.unassigned(address).is_some();
        if !is_taken {
            break;
        }
    }
    address
}

/// Gives each SubDevice that has one of these addresses one of its own. Returns what was given, and whether none is
/// left.
pub(super) async fn give(
    bus: &Bus,
    segment: &SharedSegment,
    view: &View,
    old: &[StationAddress],
) -> Result<(Vec<StationAddress>, bool), BusError> {
    let mut given = Vec::new();
    for station in old {
        let mut left = view.positions(*station).count();
        while left > 0 {
            if given.len() >= ROUND {
                return Ok((given, false));
            }
            let new = [fresh(segment, &view.stations), fresh(segment, &view.stations)];
            let taken = exchange(bus, *station, new, left == 1).await?;
            if taken == [false; 2] {
                return Ok((given, false));
            }
            let new = new.into_iter().zip(taken).filter(|(_, taken)| *taken);
            given.extend(new.map(|(station, _)| station));
            left = left.saturating_sub(taken.into_iter().filter(|taken| *taken).count());
        }
    }
    Ok((given, true))
}

/// Takes an address from the SubDevice that has it. It is found with another one.
pub(in super::super) async fn take_away(
    bus: &Bus,
    segment: &SharedSegment,
    station: StationAddress,
) -> Result<(), BusError> {
    let new = [fresh(segment, &[]), fresh(segment, &[])];
    exchange(bus, station, new, true).await.map(drop)
}

/// Gives the first SubDevice on each link that has an address a new one. Returns on which links one took it.
///
/// The two links get different ones: there may be one on the other link whose answers do not arrive.
async fn exchange(
    bus: &Bus,
    station: StationAddress,
    [main, redundant]: [StationAddress; 2],
    single: bool,
) -> Result<[bool; 2], BusError> {
    let bytes = |station: StationAddress| station.0.to_le_bytes().to_vec();
    let reply = bus.exchange(station, map::STATION_ADDRESS, bytes(main), bytes(redundant)).await?;
    let taken = [reply.main.0 >= EXCHANGED, reply.redundant.0 >= EXCHANGED];
    if single && taken == [false; 2] {
        // Controllers that cannot read and write at once (FEATURES bit 10).
        let target = Target::Station(station, map::STATION_ADDRESS);
        let reply = bus.transfer_once(Command::Fpwr, target, bytes(main)).await?;
        return Ok([reply.wkc() != Wkc(0), false]);
    }
    Ok(taken)
}
