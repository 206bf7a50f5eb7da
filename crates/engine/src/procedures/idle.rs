//! Operation without an application: passes links, number and states of the SubDevices to the model, scans after
//! changes.
//!
//! One frame per period: a broadcast read of AL status shows how many SubDevices are on each link, the OR of their
//! states, and whether a port has changed. Reads of single SubDevices, in turn, show states that the OR hides, and
//! station addresses that another program has written. Other frames are sent only after a change.

mod changes;
mod pause;
mod places;
mod ports;
mod rescue;
mod state_turns;

use alloc::format;
use alloc::rc::Rc;
use alloc::string::ToString;
use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::Wkc;
use ringcat_wire::al::AlStatus;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{DlStatus, map};

pub(crate) use changes::{nothing, scan_again};
pub(crate) use pause::without_watch;
pub(crate) use ports::{are_ports_as_scanned, follow_ports};
pub(crate) use rescue::rescue;

use self::state_turns::StateTurns;
use super::read_state;
use super::scan::{ScanError, ScanOptions, end_scan, scan, unless_another};
use super::shared_segment::{SharedSegment, until_active};
use crate::board::{RingWord, Supervision};
use crate::event::Subject;
use crate::segment::{Change, Found, IdleObservation, Observation, StateRead, SubDeviceKey, Words};
use crate::supervisor::Bus;

/// Interval of the broadcast: a change is detected within it.
const PERIOD: Duration = Duration::from_millis(20);

/// Watches the segment until an application is activated, or the MainDevice stops; also while a procedure works on it.
pub(crate) async fn watch(bus: Bus, segment: SharedSegment) {
    until_active(&segment, async {
        segment.observe_idle(IdleObservation::Watched(bus.carriers(), bus.ring()));
        let (mut number, mut turns) = (0, StateTurns::default());
        loop {
            broadcast(&bus, &segment, number, &mut turns).await;
            bus.sleep(PERIOD).await;
            number = number.wrapping_add(1);
        }
    })
    .await;
}

/// The links and the ring, without the answer to a broadcast.
fn words(bus: &Bus) -> Words {
    Words::new(bus.links(), bus.carriers(), RingWord { state: bus.ring(), ..RingWord::default() })
}

/// One broadcast, unless no link has a carrier; in the same frame the states of some SubDevices. While a scan is under
/// way only the live status follows it.
async fn broadcast(bus: &Bus, segment: &SharedSegment, number: u32, turns: &mut StateTurns) {
    let before = words(bus);
    segment.observe(Observation::Words(before));
    segment.board.post_carriers(before.carriers());
    let is_unplugged = before.is_unplugged();
    if segment.view().is_measuring() {
        return;
    }
    let kept = turns.next(segment);
    let reply = if is_unplugged { None } else { ask(bus, &kept).await };
    let now = if is_unplugged { before } else { before.with_ring(&words(bus)) };
    let Some((supervision, read)) = reply else {
        segment.board.post_silence();
        if segment.view().is_scanning() {
            return;
        }
        return segment.observe_idle(IdleObservation::Unanswered(now));
    };
    segment.board.post_supervision(supervision.pack());
    if segment.view().is_scanning() {
        return;
    }
    segment.observe(Observation::Words(now.with_result(number, supervision)));
    segment.observe_idle(IdleObservation::SomeRead(&read));
}

/// One frame with a broadcast read of AL status and reads of single SubDevices; `None` if it is lost.
async fn ask(bus: &Bus, kept: &[(SubDeviceKey, Option<u32>)]) -> Option<(Supervision, Vec<StateRead>)> {
    let all = (Command::Brd, Target::Broadcast(map::AL_STATUS), vec![0; AlStatus::LEN]);
    let one = |(key, _): &(SubDeviceKey, Option<u32>)| {
        (Command::Fprd, Target::Station(key.station, map::AL_STATUS), vec![0; read_state::LEN])
    };
    let reads: Vec<_> = core::iter::once(all).chain(kept.iter().map(one)).collect();
    let replies = bus.transfer_all(reads, None).await.ok()?;
    let reply = replies.first()?;
    let al_status = [reply.data.first().copied().unwrap_or_default(), 0];
    let (main, redundant, irq) = (reply.main, reply.redundant, reply.irq);
    let supervision = Supervision { main, redundant, al_status, irq, returned: false };
    let read = kept.iter().zip(replies.get(1..)?).map(|((key, attempt), reply)| StateRead {
        key: *key,
        attempt: *attempt,
        shown: read_state::shown(reply),
    });
    Some((supervision, read.collect()))
}

/// The first scan, as soon as a SubDevice answers.
pub(super) async fn scan_segment(bus: Bus, segment: SharedSegment, options: ScanOptions, number: u32) {
    until_active(&segment, async {
        let scanned = unless_another(&segment, number, scan(&bus, &segment, &options)).await;
        if let Some(ended) = scanned {
            end_scan(&segment, ended.map_err(|error| error.to_string()));
        }
        segment.observe_idle(IdleObservation::Scanned);
    })
    .await;
}

/// A scan after a change, or on request.
pub(super) async fn follow_change(bus: Bus, segment: SharedSegment, options: ScanOptions, change: Change) {
    until_active(&segment, async {
        let (versions, number) = (segment.view().versions(), segment.view().scan_number());
        let followed = unless_another(&segment, number, follow(&bus, &segment, &options, change)).await;
        let seen = match followed.unwrap_or(Ok(None)) {
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
            StateRead { key, attempt, shown: read_state::read(&bus, key.station).await }
        });
        let read: Vec<StateRead> = read.await;
        segment.observe_idle(IdleObservation::StatesRead(&read));
    })
    .await;
}
