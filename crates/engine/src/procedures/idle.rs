//! Operation without an application: passes links, number and states of the SubDevices to the model, scans after
//! changes.
//!
//! One broadcast read of AL status per period shows how many SubDevices are on each link, the OR of their states, and
//! whether a port has changed. Other datagrams are sent only after a change, and once a second.

mod changes;
mod places;
mod rescue;

use alloc::format;
use alloc::rc::Rc;
use alloc::string::ToString;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::Wkc;
use ringcat_wire::al::AlStatus;
use ringcat_wire::register::{DlStatus, map};

pub(crate) use changes::{nothing, scan_again};
pub(crate) use rescue::rescue;

use super::inspect::read_subdevice;
use super::scan::{ScanError, ScanOptions, end_scan, scan};
use super::shared_segment::{SharedSegment, until_active};
use crate::board::{RingWord, Supervision};
use crate::event::Subject;
use crate::segment::{Change, Found, IdleObservation, Observation, StateRead, Words};
use crate::supervisor::Bus;

/// Interval of the broadcast: a change is detected within it.
const PERIOD: Duration = Duration::from_millis(20);

/// Watches the segment until an application is activated, or the MainDevice stops.
pub(crate) async fn watch(bus: Bus, segment: SharedSegment) {
    until_active(&segment, async {
        segment.observe_idle(IdleObservation::Watched(bus.carriers(), bus.ring()));
        let mut number = 0;
        loop {
            broadcast(&bus, &segment, number).await;
            segment.until(|model| (!model.is_idle_busy()).then_some(())).await;
            bus.sleep(PERIOD).await;
            number = number.wrapping_add(1);
        }
    })
    .await;
}

/// The links and the ring, without the answer to a broadcast.
fn words(bus: &Bus) -> Words {
    let ring = RingWord { state: bus.ring(), ..RingWord::default() };
    Words { links: bus.links(), carriers: bus.carriers(), ring, supervision: None, cycles: 0 }
}

/// One broadcast, unless a scan is under way or no link has a carrier.
async fn broadcast(bus: &Bus, segment: &SharedSegment, number: u32) {
    let before = words(bus);
    segment.observe(Observation::Words(before));
    if segment.view().is_scanning() {
        return;
    }
    if before.is_unplugged() {
        return segment.observe_idle(IdleObservation::Unanswered(before));
    }
    let reply = bus.brd(map::AL_STATUS, AlStatus::LEN).await;
    let now = Words { ring: words(bus).ring, ..before };
    let Ok(reply) = reply else { return segment.observe_idle(IdleObservation::Unanswered(now)) };
    let al_status = [reply.data.first().copied().unwrap_or_default(), 0];
    let (main, redundant, irq) = (reply.main, reply.redundant, reply.irq);
    let supervision = Supervision { main, redundant, al_status, irq, returned: false };
    segment.observe(Observation::Words(Words { supervision: Some((number, supervision)), ..now }));
}

/// The first scan, as soon as a SubDevice answers.
pub(super) async fn scan_segment(bus: Bus, segment: SharedSegment, options: ScanOptions) {
    until_active(&segment, async {
        let ended = scan(&bus, &options).await.map_err(|error| error.to_string());
        end_scan(&segment, ended);
        segment.observe_idle(IdleObservation::Scanned);
    })
    .await;
}

/// A scan after a change, or on request.
pub(super) async fn follow_change(bus: Bus, segment: SharedSegment, options: ScanOptions, change: Change) {
    until_active(&segment, async {
        let versions = segment.view().versions();
        let seen = match follow(&bus, &segment, &options, change).await {
            Ok(Some(found)) => IdleObservation::Followed { versions, found: Rc::new(found), wanted: change.wanted },
            Ok(None) => IdleObservation::NotFollowed(None),
            Err(error) => IdleObservation::NotFollowed(Some(error.to_string())),
        };
        segment.observe_idle(seen);
    })
    .await;
}

/// `None` if the segment has changed meanwhile.
async fn follow(
    bus: &Bus,
    segment: &SharedSegment,
    options: &ScanOptions,
    Change { counts, ports_changed, is_unplugged, .. }: Change,
) -> Result<Option<Found>, ScanError> {
    bus.step(Subject::Scan, || {
        let (main, redundant) = (Wkc(counts.main), Wkc(counts.redundant));
        format!("the segment has changed: {main} SubDevices on MAIN, {redundant} on REDUNDANT")
    });
    // Clears the ECAT events of the ports. Changes from now on set them again.
    if ports_changed && bus.brd(map::DL_STATUS, DlStatus::LEN).await.is_err() {
        return Ok(None);
    }
    if is_unplugged {
        return Ok(Some(nothing()));
    }
    let before = segment.view().found().cloned().unwrap_or_else(|| Rc::new(nothing()));
    scan_again(bus, segment, options, (&before.subdevices, &before)).await
}

/// Reads the state of each SubDevice, also of those that have failed: they may have lost their addresses.
pub(super) async fn read_states(bus: Bus, segment: SharedSegment) {
    until_active(&segment, async {
        let kept = segment.view().kept();
        let read = bus.gather(kept, |bus, (key, attempt)| async move {
            StateRead { key, attempt, reading: read_subdevice(&bus, key.station).await }
        });
        let read: Vec<StateRead> = read.await;
        segment.observe_idle(IdleObservation::StatesRead(&read));
    })
    .await;
}
