//! The last measurement of the clocks as bytes. Positions, ports and times are checked when it is decoded: sums of
//! times must not overflow.

use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;

use super::code::{Code, Input, fields};
use super::error::KnowledgeError;
use crate::clocks::{Delays, KnownCable, KnownClocks, Measured, Passage, Unknown, Wiring};
use crate::topology::PortOf;

/// Largest magnitude of a time with fraction: 0.27 s, much longer than a frame takes through any segment.
const MOST_TIME: i64 = 1 << 36;
/// Largest magnitude of a drift in parts per billion.
const MOST_DRIFT: i64 = 1_000_000_000;
/// Most cables of one measured time.
const MOST_CABLES: usize = 1_024;
/// Ports of a controller.
const PORTS: u8 = 4;

fields!(Passage { processed: i64, forwarded: i64 });
fields!(Unknown { node: usize, fork: Option<usize>, range: Option<(i64, i64)> });
fields!(Wiring { far: Vec<[Option<PortOf>; 4]>, entries: [Option<PortOf>; 2] });
fields!(KnownCable { ends: Vec<((StationAddress, u8), (StationAddress, u8))>, time: i64, is_old: bool });
fields!(KnownClocks { measured: Measured, cables: Vec<KnownCable>, backwards: Vec<StationAddress> });
fields!(Delays {
    units: Vec<Option<i64>>,
    unknown: Vec<Unknown>,
    trees: Vec<usize>,
    is_guessed: bool,
    is_shared: bool,
    is_contradictory: bool,
    is_implausible: bool,
});
fields!(Measured {
    stations: Vec<StationAddress>,
    delays: Delays,
    drift_ppb: Vec<Option<i64>>,
    passages: Vec<Passage>,
    wiring: Wiring,
    port_times: Vec<Option<[u32; 4]>>,
});

/// Takes what is known of the clocks.
pub(super) fn take_checked(input: &mut Input<'_>) -> Result<Option<KnownClocks>, KnowledgeError> {
    let positions = input.expected("a measurement of as many clocks as it has station addresses");
    let times = input.expected("times and drifts of clocks that are possible");
    let Some(known) = <Option<KnownClocks> as Code>::take(input)? else { return Ok(None) };
    if !are_positions_valid(&known.measured) {
        return Err(positions);
    }
    if are_times_valid(&known) { Ok(Some(known)) } else { Err(times) }
}

/// Whether all lists have an element for each SubDevice, and all positions and ports exist.
fn are_positions_valid(measured: &Measured) -> bool {
    let Measured { stations, delays, drift_ppb, passages, wiring, port_times } = measured;
    let count = stations.len();
    let lengths = [delays.units.len(), delays.trees.len(), drift_ppb.len(), passages.len(), port_times.len()];
    let mut ports = wiring.far.iter().flatten().chain(&wiring.entries).flatten();
    let is_position = |unknown: &Unknown| unknown.node < count && unknown.fork.is_none_or(|fork| fork < count);
    lengths.iter().all(|length| *length == count)
        && wiring.far.len() == count
        && ports.all(|at| at.node < count && at.port < PORTS)
        && delays.trees.iter().all(|tree| *tree < wiring.entries.len())
        && delays.unknown.iter().all(is_position)
}

fn are_times_valid(known: &KnownClocks) -> bool {
    let Measured { delays, drift_ppb, passages, .. } = &known.measured;
    let ranges = delays.unknown.iter().filter_map(|unknown| unknown.range).flat_map(|(least, most)| [least, most]);
    let passages = passages.iter().flat_map(|passage| [passage.processed, passage.forwarded]);
    let cables = known.cables.iter().map(|cable| cable.time);
    let mut times = delays.units.iter().flatten().copied().chain(ranges).chain(passages).chain(cables);
    times.all(|time| (-MOST_TIME..=MOST_TIME).contains(&time))
        && drift_ppb.iter().flatten().all(|drift| (-MOST_DRIFT..=MOST_DRIFT).contains(drift))
        && known.cables.iter().all(|cable| (1..=MOST_CABLES).contains(&cable.ends.len()))
}
