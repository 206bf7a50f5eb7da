//! Reads the error counters of all ports in the background, once a second, a few SubDevices at a time. The model
//! decides which rises are reported (`segment::cable_watch`).

use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::{ErrorCounters, map};

use super::shared_segment::SharedSegment;
use crate::ring_status::{Cable, CableErrors, port_errors};
use crate::segment::Observation;
use crate::segment::member::Phase;
use crate::supervisor::{Bus, BusError};
use crate::topology::PortOf;

/// Interval of the readings.
const PAUSE: Duration = Duration::from_secs(1);
/// Counters saturate at 255: from this value on they are cleared.
const FULL: u8 = 128;

/// Runs until the MainDevice stops.
pub(super) async fn watch_errors(bus: Bus, segment: SharedSegment) {
    segment.until_branches_are_open().await;
    let count = segment.view().subdevices().member_count();
    let mut last = vec![None; count];
    let mut versions = segment.view().versions();
    let mut watched = watch_all(&segment);
    let mut at_node = by_node(&watched);
    // Shifted by half a period against other procedures that run once a second.
    bus.sleep(PAUSE / 2).await;
    loop {
        bus.sleep(PAUSE).await;
        for (index, counters) in bus.gather_in_turns(present(&segment), read).await.into_iter().flatten() {
            if segment.view().versions().cabling != versions.cabling {
                versions = segment.view().versions();
                watched = watch_all(&segment);
                at_node = by_node(&watched);
            }
            let before = last[index].replace(counters);
            segment.statistics.note_reading(index, &counters);
            let Some(node) = segment.view().member(index).and_then(|member| member.node) else { continue };
            for at in at_node.get(node).into_iter().flatten() {
                watched[*at].take(node, before.as_ref(), &counters);
            }
            if is_full(&counters) && clear(&bus, &segment, index).await.is_ok() {
                last[index] = Some(ErrorCounters::default());
            }
        }
        // If the cabling was replaced just now, the next reading starts with the new one.
        if segment.view().versions().cabling != versions.cabling {
            continue;
        }
        let fresh: Vec<CableErrors> = watched.iter_mut().map(|it| core::mem::take(&mut it.fresh)).collect();
        segment.observe(Observation::CableErrors { versions, fresh: &fresh });
    }
}

fn watch_all(segment: &SharedSegment) -> Vec<Watched> {
    segment.view().cabling().cables.iter().map(|(cable, _)| Watched::new(*cable)).collect()
}

/// Cables at each SubDevice, by its position.
fn by_node(watched: &[Watched]) -> Vec<Vec<usize>> {
    let mut found: Vec<Vec<usize>> = Vec::new();
    for (at, watched) in watched.iter().enumerate() {
        for end in [watched.cable.near, watched.cable.far].into_iter().flatten() {
            if found.len() <= end.node {
                found.resize(end.node + 1, Vec::new());
            }
            found[end.node].push(at);
        }
    }
    found
}

/// Members that answer, by index.
fn present(segment: &SharedSegment) -> Vec<(usize, StationAddress)> {
    let access = segment.view();
    let members = access.members().enumerate().filter(|(_, member)| member.phase != Phase::Absent);
    members.map(|(index, member)| (index, member.station)).collect()
}

async fn read(bus: Bus, (index, station): (usize, StationAddress)) -> Option<(usize, ErrorCounters)> {
    let bytes = bus.fprd_array(station, map::RX_ERROR_COUNTER).await.ok()?;
    Some((index, ErrorCounters::decode(&bytes)))
}

fn is_full(counters: &ErrorCounters) -> bool {
    counters.rx.iter().map(|rx| rx.invalid_frames).chain(counters.lost_link).any(|count| count >= FULL)
}

async fn clear(bus: &Bus, segment: &SharedSegment, index: usize) -> Result<(), BusError> {
    let Some(station) = segment.view().member(index).map(|member| member.station) else { return Ok(()) };
    bus.fpwr(station, map::RX_ERROR_COUNTER, &[0]).await?;
    bus.fpwr(station, map::LOST_LINK_COUNTER, &[0]).await?;
    segment.statistics.cleared(index);
    Ok(())
}

/// A cable and the errors at its ends since the last reading.
struct Watched {
    cable: Cable,
    fresh: CableErrors,
}

impl Watched {
    fn new(cable: Cable) -> Watched {
        Watched { cable, fresh: CableErrors::default() }
    }

    /// Adds the counters of a SubDevice, if it is at one of the ends.
    fn take(&mut self, node: usize, before: Option<&ErrorCounters>, now: &ErrorCounters) {
        let ends = [self.cable.near, self.cable.far];
        for PortOf { port, .. } in ends.into_iter().flatten().filter(|end| end.node == node) {
            let before = before.map(|counters| port_errors(counters, port)).unwrap_or_default();
            self.fresh = self.fresh.plus(rise(before, port_errors(now, port)));
        }
    }
}

/// Counters that fell were cleared, or their SubDevice has lost its power.
fn rise(before: CableErrors, now: CableErrors) -> CableErrors {
    let rise = |before: u64, now: u64| if now >= before { now - before } else { now };
    CableErrors {
        invalid_frames: rise(before.invalid_frames, now.invalid_frames),
        lost_links: rise(before.lost_links, now.lost_links),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CABLE: Cable = Cable { near: Some(PortOf { node: 4, port: 1 }), far: Some(PortOf { node: 5, port: 0 }) };

    fn counters(invalid_frames: u8) -> ErrorCounters {
        let mut counters = ErrorCounters::default();
        counters.rx[0].invalid_frames = invalid_frames;
        counters
    }

    // covers: cable-errors
    #[test]
    fn errors_at_both_ends_count_for_a_cable_also_after_the_counters_were_cleared() {
        let mut watched = Watched::new(CABLE);
        let mut rises = Vec::new();
        let mut last = 0;
        for count in [0, 1, 1, 2, 3, 3, 9, 250, 2, 2, 100] {
            watched.take(5, Some(&counters(last)), &counters(count));
            watched.take(3, Some(&counters(last)), &counters(count));
            rises.push(core::mem::take(&mut watched.fresh).invalid_frames);
            last = count;
        }
        assert_eq!(rises, [0, 1, 0, 1, 1, 0, 6, 241, 2, 0, 98]);
        let mut at_port_1 = ErrorCounters::default();
        at_port_1.rx[1].invalid_frames = 4;
        watched.take(4, None, &at_port_1);
        assert_eq!(watched.fresh.invalid_frames, 4);
    }
}
