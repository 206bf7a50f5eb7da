//! The end of an application: all SubDevices go to PREOP with mailboxes, and the scan is kept (seed of IgH 2.2: back to
//! idle).

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::Wkc;
use ringcat_wire::al::{AlState, AlStatus};

use super::al_state::{StateError, read_status};
use super::configure::ConfigureError;
use super::idle::{nothing, scan_again};
use super::scan::ScanOptions;
use super::shared_segment::SharedSegment;
use super::stop::{StopError, ToStop, all_known, stop};
use super::undeclared::settle;
use crate::info::SubDeviceInfo;
use crate::segment::{Observation, Segment, SubDevice, UndeclaredObservation};
use crate::supervisor::{Bus, BusError};
use crate::time::Instant;

/// Pause before the segment is scanned again while it changes.
const PAUSE: Duration = Duration::from_millis(2);

/// Part of the limit in which the states of SubDevices that are late are read.
const REPORT: Duration = Duration::from_millis(10);

/// What was known of the SubDevices when the application ended.
pub(crate) struct Remainder {
    to_stop: Vec<ToStop>,
    known: Vec<Rc<SubDeviceInfo>>,
}

impl Remainder {
    /// To be called before the application ends in the model.
    pub(crate) fn of(segment: &Segment) -> Remainder {
        let mut known: Vec<Rc<SubDeviceInfo>> = segment.subdevices().all().iter().filter_map(addressed).collect();
        for info in segment.found().map(|found| found.subdevices.as_slice()).unwrap_or_default() {
            if !known.iter().any(|other| other.station == info.station) {
                known.push(info.clone());
            }
        }
        Remainder { to_stop: all_known(segment), known }
    }
}

/// What is known of a SubDevice, with its present station address.
fn addressed(subdevice: &SubDevice) -> Option<Rc<SubDeviceInfo>> {
    let (info, station) = (subdevice.knowledge.info()?, subdevice.key.station);
    Some(if info.station == station { info.clone() } else { Rc::new(SubDeviceInfo { station, ..(**info).clone() }) })
}

/// Brings all SubDevices to PREOP: declared ones from the states of their application, the others too. Those that do
/// not answer are left out.
pub(crate) async fn deactivate(
    bus: &Bus,
    segment: &SharedSegment,
    options: &ScanOptions,
    remainder: Remainder,
    limit: Duration,
) -> Result<(), StopError> {
    let begun = bus.now();
    let until = begun + limit;
    let Remainder { to_stop, known } = remainder;
    let declared = to_stop.clone();
    let unconfirmed = StopError::Unconfirmed { requested: AlState::PreOp, limit };
    // A SubDevice that does not leave its state, or lost frames, must not use up the time that the later steps need.
    let stopping = stop(bus, to_stop, AlState::PreOp, limit / 2);
    let stopped = bus.within(limit - limit / 4, stopping).await.unwrap_or(Err(unconfirmed));
    // A scan that loses frames must not take longer.
    let scanning = scan_until(bus, segment, options, &known, until);
    let _ = bus.within(until.since(bus.now()), scanning).await;
    segment.observe_undeclared(UndeclaredObservation::TakenOver);
    let settling = settle(bus, segment);
    let time = until.since(bus.now());
    // Reading the states of the late ones belongs to the limit.
    let is_settled = bus.within(time.saturating_sub(REPORT), settling).await;
    if segment.view().kept().is_empty() {
        // No SubDevice is known any more that could confirm PREOP.
        return if declared.is_empty() { Ok(()) } else { stopped };
    }
    if is_settled == Ok(true) || segment.view().unsettled().is_empty() {
        return Ok(());
    }
    // If all attempts have ended, a refusal is certain before the limit.
    let had = if is_settled.is_ok() { bus.now().since(begun) } else { limit };
    match bus.within(until.since(bus.now()), late(bus, segment, &declared, had)).await {
        Ok(Late::Others(late)) => Err(late),
        Ok(Late::Absent) => stopped,
        Ok(Late::Unknown) | Err(_) => stopped.and(Err(unconfirmed)),
    }
}

/// The scan as it is now, without an EEPROM of known SubDevices. If the segment does not become stable, the last scan
/// is kept.
async fn scan_until(
    bus: &Bus,
    segment: &SharedSegment,
    options: &ScanOptions,
    known: &[Rc<SubDeviceInfo>],
    until: Instant,
) {
    while bus.now() < until {
        let (versions, last) = (segment.view().versions(), segment.view().found().cloned());
        let last = last.unwrap_or_else(|| Rc::new(nothing()));
        if let Ok(Some(found)) = scan_again(bus, segment, options, (known, &last)).await {
            return segment.observe(Observation::FoundAgain { versions, found: Rc::new(found) });
        }
        bus.sleep(PAUSE).await;
    }
}

/// Result of reading the states of late SubDevices.
enum Late {
    /// SubDevices answer that are not in PREOP: the error.
    Others(StopError),
    /// No SubDevice answers.
    Absent,
    /// A state cannot be read, or is PREOP although the attempt has not ended.
    Unknown,
}

/// Reads the states of the SubDevices that have not reached their requested states.
async fn late(bus: &Bus, segment: &SharedSegment, declared: &[ToStop], limit: Duration) -> Late {
    let unsettled = segment.view().unsettled();
    let states = bus.gather(unsettled, |bus, it| async move { (it, read_status(&bus, it.0.station).await) }).await;
    let answers = states.iter().filter_map(|(it, read)| Some((*it, read.ok()?)));
    let mut others = answers.filter(|(_, (status, _))| *status != AlStatus::new(AlState::PreOp));
    let Some(((key, attempt), (status, code))) = others.next() else {
        let is_absent = |read: &Result<_, BusError>| matches!(read, Err(BusError::Wkc { got: Wkc(0), .. }));
        return if states.iter().all(|(_, read)| is_absent(read)) { Late::Absent } else { Late::Unknown };
    };
    let others = others.count();
    let (station, requested) = (key.station, AlState::PreOp);
    // The attempt has acknowledged the refusal, so AL status no longer shows its code.
    let code = match segment.undeclared.result(key, attempt) {
        Some(Err(ConfigureError::State(StateError::Refused { code, .. }))) => code,
        Some(_) | None => code,
    };
    let subdevice = declared.iter().find(|(_, other)| *other == station).and_then(|(subdevice, _)| *subdevice);
    Late::Others(StopError::NotReached { subdevice, station, requested, status, code, limit, others })
}
