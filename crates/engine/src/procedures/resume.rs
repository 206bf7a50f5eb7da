//! Continues with the knowledge of another process about the segment, without a scan (decision 0061).
//!
//! First one round of reads, before anything is written: number of SubDevices, and of each its station address, its
//! controller, its ports, its AL status and its mailbox SyncManagers. Where all is as known, nothing else is read.
//! Where something differs, the segment is scanned again as after a change: SubDevices that kept their station
//! addresses stay as they are, only the others are read.

mod check;

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::al::AlState;
use ringcat_wire::register::map;

use self::check::{Check, Place, check};
use super::idle::scan_again;
use super::scan::{ScanError, ScanOptions};
use super::shared_segment::SharedSegment;
use super::sii;
use super::undeclared::unmap;
use crate::event::Notice;
use crate::info::SubDeviceInfo;
use crate::knowledge::{Handover, KnownMailbox, KnownProgress, KnownSubDevice};
use crate::mail::InUse;
use crate::ring_status::LinkCounts;
use crate::segment::effect::Shown;
use crate::segment::{Found, KeptState, Observation, UndeclaredObservation, UpkeepProgress};
use crate::supervisor::{Bus, BusError};

/// Pause between two rounds while the segment does not answer, or changes.
const PAUSE: Duration = Duration::from_millis(2);

/// Number of scans after which the segment may differ again, however long the scans take.
const SCANS: u32 = 3;

/// What another process knew.
pub(crate) struct Before {
    /// All SubDevices with a station address: those that the scan found, then others.
    pub all: Vec<Known>,
    /// The SubDevices that the scan found, with their connections.
    pub found: Found,
    pub handover: Handover,
}

/// What another process knew of a SubDevice.
pub(crate) struct Known {
    pub info: Rc<SubDeviceInfo>,
    target: AlState,
    progress: KnownProgress,
    mailbox: Option<KnownMailbox>,
}

impl From<KnownSubDevice> for Known {
    fn from(known: KnownSubDevice) -> Known {
        let KnownSubDevice { info, target, progress, mailbox } = known;
        Known { info: Rc::new(info), target, progress, mailbox }
    }
}

/// A SubDevice that another process has kept in its state, as its registers show it.
#[derive(Clone, Debug)]
struct Kept {
    station: StationAddress,
    target: AlState,
    progress: KnownProgress,
    /// Its mailbox, if it can be used without INIT.
    mailbox: Option<(InUse, KnownMailbox)>,
    /// What it shows instead of the state that it has left.
    has_left: Option<Shown>,
}

/// Goes on with the segment. Ends the stage of scanning in the model.
pub(crate) async fn resume(
    bus: &Bus,
    segment: &SharedSegment,
    options: &ScanOptions,
    before: Before,
) -> Result<(), ScanError> {
    let (found, places, differs) = verified(bus, segment, options, &before).await?;
    segment.observe(Observation::ScanEnded(Ok(found.scan())));
    let mut kept = Vec::new();
    for (place, info) in places.iter().zip(&found.subdevices) {
        let Some(known) = before.all.iter().find(|known| known.info.station == info.station) else { continue };
        kept.extend(keep(known, info, place, before.handover));
    }
    let reached = kept.iter().filter(|kept| kept.progress == KnownProgress::Reached);
    let (subdevices, in_state) = (found.subdevices.len(), reached.count());
    bus.notice(Notice::Resumed { subdevices, in_state, differs });
    if before.handover == Handover::Orderly {
        before.all.iter().for_each(|known| report_cut(bus, known, &found.subdevices));
    }
    go_on(bus, segment, &kept, before.handover);
    if before.handover == Handover::AfterCrash {
        let left = found.subdevices.iter().filter(|info| kept.iter().any(|kept| is_in_place(kept, info)));
        clear(bus, left.cloned().collect()).await;
    }
    Ok(())
}

/// Reports conversations with a mailbox that the hand-over has cut.
fn report_cut(bus: &Bus, known: &Known, found: &[Rc<SubDeviceInfo>]) {
    let position = found.iter().find(|info| info.station == known.info.station).map(|info| info.position);
    let protocols = known.mailbox.iter().flat_map(KnownMailbox::cut_protocols);
    for (protocol, position) in protocols.filter_map(|protocol| Some((protocol, position?))) {
        bus.notice(Notice::ConversationCut { position, protocol });
    }
}

/// Reports to the model which SubDevices go on as they are; sets the counters of their mailboxes.
fn go_on(bus: &Bus, segment: &SharedSegment, kept: &[Kept], handover: Handover) {
    let state = |kept: &Kept| KeptState {
        station: kept.station,
        target: kept.target,
        has_left: kept.has_left,
        progress: match kept.progress {
            KnownProgress::Reached => UpkeepProgress::Reached,
            KnownProgress::Left => UpkeepProgress::Left,
            KnownProgress::None | KnownProgress::Due => UpkeepProgress::Due(bus.now()),
        },
    };
    let states: Vec<KeptState> = kept.iter().map(state).collect();
    segment.observe_undeclared(UndeclaredObservation::HandedOver(&states));
    for kept in kept {
        let Some((in_use, known)) = &kept.mailbox else { continue };
        let key = segment.view().undeclared_at(kept.station);
        if let Some(mailbox) = key.and_then(|key| segment.undeclared.of(key)) {
            mailbox.adopt(*in_use, known, handover);
        }
    }
}

fn is_in_place(kept: &Kept, info: &SubDeviceInfo) -> bool {
    kept.station == info.station && kept.progress == KnownProgress::Reached
}

/// The segment as it is now, with what was read of each SubDevice, and whether it differs from what was known.
async fn verified(
    bus: &Bus,
    segment: &SharedSegment,
    options: &ScanOptions,
    before: &Before,
) -> Result<(Found, Vec<Place>, bool), ScanError> {
    let begun = bus.now();
    let mut found = before.found.clone();
    let (mut differs, mut is_released) = (false, before.handover == Handover::Orderly);
    let mut scans = 0;
    loop {
        let mut error = ScanError::NoAnswer;
        match check(bus, &found.subdevices, options.alias_source).await {
            Ok(Check::Same(places)) => return Ok((found, places, differs)),
            // A crashed owner may have left ports closed, behind which SubDevices are.
            Ok(Check::Different { .. }) if !is_released => is_released = release(bus).await.is_ok(),
            Ok(Check::Different { replaced, counts }) => {
                error = ScanError::Changed { before: counts_of(&found), after: counts };
                differs = true;
                let within = bus.now().since(begun);
                if scans >= SCANS && within >= options.patience {
                    return Err(ScanError::Unstable { scans, within });
                }
                let all = before.all.iter().map(|known| known.info.clone());
                let known: Vec<Rc<SubDeviceInfo>> = match found.subdevices.is_empty() {
                    true => all.collect(),
                    false => all.filter(|info| !replaced.contains(&info.station)).collect(),
                };
                match scan_again(bus, segment, options, (&known, &before.found)).await {
                    Ok(Some(now)) if !now.subdevices.is_empty() => {
                        found = now;
                        scans += 1;
                        continue;
                    }
                    Ok(_) => {}
                    Err(failed) => error = failed,
                }
            }
            Err(failed) if !matches!(failed, BusError::Lost { .. }) => error = failed.into(),
            Err(_) => {}
        }
        if bus.now().since(begun) >= options.patience {
            return Err(error);
        }
        bus.sleep(PAUSE).await;
    }
}

fn counts_of(found: &Found) -> LinkCounts {
    let redundant = found.subdevices.len().saturating_sub(found.main_count);
    LinkCounts { main: found.main_count as u16, redundant: redundant as u16 }
}

/// Ports open and close by themselves again.
async fn release(bus: &Bus) -> Result<(), BusError> {
    bus.bwr(map::DL_CONTROL.offset(1), &[0]).await?;
    bus.bwr(map::DL_CONTROL.offset(3), &[0]).await.map(drop)
}

/// Removes what a crashed owner may have left in SubDevices that stay in PREOP.
async fn clear(bus: &Bus, left: Vec<Rc<SubDeviceInfo>>) {
    // A failure shows when the SubDevice is configured.
    let _ = release(bus).await;
    let cleared = bus.gather(left, |bus, info| async move {
        sii::claim(&bus, info.station).await?;
        unmap(&bus, &info).await
    });
    cleared.await;
}

/// How a known SubDevice goes on.
fn keep(known: &Known, info: &SubDeviceInfo, place: &Place, handover: Handover) -> Option<Kept> {
    let is_handed = handover == Handover::Orderly;
    let target = if is_handed { known.target } else { AlState::PreOp };
    let is_there = !place.status.error && place.status.al_state() == Some(target);
    let has_mailbox = if target == AlState::Boot { info.bootstrap.is_some() } else { info.mailbox.is_some() };
    let has_mailbox = has_mailbox && target != AlState::Init;
    let in_use = place.in_use(info, target).filter(|_| is_there && has_mailbox);
    // Without its counters a mailbox can be used only as after a crash.
    let counters = if is_handed { known.mailbox.clone() } else { Some(known.mailbox.clone().unwrap_or_default()) };
    let mailbox = in_use.zip(counters);
    let is_usable = is_there && (!has_mailbox || mailbox.is_some());
    let progress = match (known.progress, handover) {
        (KnownProgress::None, Handover::Orderly) => return None,
        (KnownProgress::Left, Handover::Orderly) => KnownProgress::Left,
        (KnownProgress::Due, Handover::Orderly) => KnownProgress::Due,
        (KnownProgress::Reached, Handover::Orderly) | (_, Handover::AfterCrash) => match is_usable {
            true => KnownProgress::Reached,
            false => KnownProgress::Due,
        },
    };
    let mailbox = mailbox.filter(|_| progress != KnownProgress::Due);
    let has_left = known.progress == KnownProgress::Reached && progress == KnownProgress::Due;
    let has_left = has_left.then_some((place.status, place.code));
    Some(Kept { station: info.station, target, progress, mailbox, has_left })
}
