//! Assigns a temporary station address to each SubDevice without an assigned one, without writes to a position.
//!
//! Positions change when a cable is cut or plugged in, also while a frame is on the wire, and a write to a position may
//! then reach a SubDevice in OP. So positions are only read. A SubDevice gets its new address through its present one:
//! an address that only one SubDevice has is written; if several have the same, it is exchanged (FPRW): the first
//! SubDevice on a link takes the new address and returns its old one in the datagram, so that the SubDevices behind it
//! write the address that they have.

use alloc::vec::Vec;

use ringcat_wire::address::{Position, StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::map;

use super::super::scan::MAX_SUBDEVICES;
use super::super::shared_segment::SharedSegment;
use crate::segment::view::View;
use crate::segment::{Observation, TemporaryAddress};
use crate::supervisor::{Bus, BusError};

/// Addresses assigned in one round, before all others are scanned again.
const ROUND: usize = 64;
/// Working counter of a SubDevice that reads and writes.
const EXCHANGED: u16 = 3;

/// Reads all station addresses; `None` while the segment changes.
async fn read(bus: &Bus) -> Result<Option<View>, BusError> {
    let ring = |bus: &Bus| bus.board().map(|board| board.ring()).unwrap_or_default();
    let before = ring(bus);
    // Positions behind a break are counted from the redundant link (protocol CR-09).
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

/// Reads all station addresses twice; `None` if the results differ.
pub(in super::super) async fn view(bus: &Bus) -> Result<Option<View>, BusError> {
    let Some(first) = read(bus).await? else { return Ok(None) };
    Ok(read(bus).await?.filter(|second| *second == first))
}

/// A temporary address that no SubDevice has.
fn fresh(segment: &SharedSegment, present: &[StationAddress]) -> StationAddress {
    let address = segment.view().free_address(present);
    segment.observe(Observation::Offered(address));
    address
}

/// Gives each SubDevice with one of these addresses one of its own. Returns the new addresses, and whether none of the
/// old ones is left.
pub(in super::super) async fn give(
    bus: &Bus,
    segment: &SharedSegment,
    view: &View,
    old: &[StationAddress],
) -> Result<(Vec<TemporaryAddress>, bool), BusError> {
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
            given.extend(new.map(|(new, _)| TemporaryAddress { station: new, before: *station }));
            left = left.saturating_sub(taken.into_iter().filter(|taken| *taken).count());
        }
    }
    Ok((given, true))
}

/// Takes an address away from the SubDevice that has it, which gets a temporary one.
pub(in super::super) async fn take_away(
    bus: &Bus,
    segment: &SharedSegment,
    station: StationAddress,
) -> Result<(), BusError> {
    let new = [fresh(segment, &[]), fresh(segment, &[])];
    let result = exchange(bus, station, new, true).await;
    // Positions that were read before show a member here.
    segment.observe(Observation::Readdressing(&[station]));
    result.map(drop)
}

/// Gives the first SubDevice with an address on each link a new one. Returns the links on which a SubDevice took it.
///
/// The two links get different new addresses: the answers of a SubDevice on one link may be lost.
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
        // For controllers that cannot read and write at once (FEATURES bit 10).
        let target = Target::Station(station, map::STATION_ADDRESS);
        let reply = bus.transfer_once(Command::Fpwr, target, bytes(main)).await?;
        return Ok([reply.wkc() != Wkc(0), false]);
    }
    Ok(taken)
}
