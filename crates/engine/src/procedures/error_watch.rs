//! Reads the error counters of all ports in the background, and reports cables whose errors rise.
//!
//! Once a second, a few SubDevices at a time. A cut damages the frame that is on the wire: only many errors at once, or
//! errors in consecutive seconds, are reported.

use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::{ErrorCounters, map};

use super::shared_segment::SharedSegment;
use crate::event::Event;
use crate::ring_status::{Cable, CableErrors, port_errors};
use crate::segment::Observation;
use crate::segment::member::Phase;
use crate::supervisor::{Bus, BusError};
use crate::time::Instant;
use crate::topology::PortOf;

/// Interval of the readings.
const PAUSE: Duration = Duration::from_secs(1);
/// Damaged frames between two readings that are reported at once; fewer if there were some at the previous reading too.
const MANY: u64 = 3;
/// Minimum time between two reports of the same cable.
const AGAIN: Duration = Duration::from_secs(10);
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
        let now = bus.now();
        let (fresh, events): (Vec<CableErrors>, Vec<Option<Event>>) =
            watched.iter_mut().map(|watched| watched.close(now)).unzip();
        let rising = events.into_iter().flatten().collect();
        segment.observe(Observation::CableErrors { versions, fresh: &fresh, rising });
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

/// A cable and the recent errors at its ends.
struct Watched {
    cable: Cable,
    /// Since the last reading.
    fresh: CableErrors,
    /// Since its last report.
    unreported: CableErrors,
    /// There were damaged frames at the previous reading too.
    continues: bool,
    reported_at: Option<Instant>,
}

impl Watched {
    fn new(cable: Cable) -> Watched {
        let (fresh, unreported) = Default::default();
        Watched { cable, fresh, unreported, continues: false, reported_at: None }
    }

    /// Adds the counters of a SubDevice, if it is at one of the ends.
    fn take(&mut self, node: usize, before: Option<&ErrorCounters>, now: &ErrorCounters) {
        let ends = [self.cable.near, self.cable.far];
        for PortOf { port, .. } in ends.into_iter().flatten().filter(|end| end.node == node) {
            let before = before.map(|counters| port_errors(counters, port)).unwrap_or_default();
            self.fresh = self.fresh.plus(rise(before, port_errors(now, port)));
        }
    }

    /// Ends a reading: returns the new errors, and an event if they are to be reported.
    fn close(&mut self, now: Instant) -> (CableErrors, Option<Event>) {
        let fresh = core::mem::take(&mut self.fresh);
        self.unreported = self.unreported.plus(fresh);
        let came = fresh.invalid_frames;
        let is_worth_it = came >= MANY || (came > 0 && self.continues);
        self.continues = came > 0;
        if !is_worth_it || self.reported_at.is_some_and(|at| now.since(at) < AGAIN) {
            return (fresh, None);
        }
        self.reported_at = Some(now);
        let errors = core::mem::take(&mut self.unreported);
        (fresh, Some(Event::CableErrors { cable: self.cable, errors }))
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
    fn one_damaged_frame_is_not_reported_but_many_or_repeated_ones_are() {
        let mut watched = Watched::new(CABLE);
        let mut events = Vec::new();
        for (second, count) in [0, 1, 1, 2, 3, 3, 9, 250, 2, 2].into_iter().enumerate() {
            let before = events.len();
            let last = if second == 0 { 0 } else { [0, 1, 1, 2, 3, 3, 9, 250, 2, 2][second - 1] };
            watched.take(5, Some(&counters(last)), &counters(count));
            watched.take(3, Some(&counters(last)), &counters(count));
            let (_, event) = watched.close(Instant(0) + Duration::from_secs(second as u64));
            events.extend(event);
            assert_eq!(events.len() - before, usize::from(second == 4), "second {second}");
        }
        let errors = CableErrors { invalid_frames: 3, lost_links: 0 };
        assert_eq!(events, [Event::CableErrors { cable: CABLE, errors }]);
        watched.take(5, Some(&counters(0)), &counters(100));
        let (fresh, event) = watched.close(Instant(0) + Duration::from_secs(14));
        assert_eq!(fresh.invalid_frames, 100);
        // 6 and 241 that were counted within ten seconds after the first event, 2 after the counters were cleared, and
        // these.
        let errors = CableErrors { invalid_frames: 349, lost_links: 0 };
        assert_eq!(event, Some(Event::CableErrors { cable: CABLE, errors }));
    }
}
