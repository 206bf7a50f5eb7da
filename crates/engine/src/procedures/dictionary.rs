//! PDO assignment and mapping from the object dictionaries (protocol 4.5, 6.3): they have priority over the SII, whole
//! or not at all.

use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::coe::pdo_objects::ASSIGNMENT_BASE;

use super::scan::Scan;
use super::visit::visit;
use crate::config::PdoAssignment;
use crate::event::Notice;
use crate::info::{SiiAssignment, SubDeviceInfo};
use crate::mail::coe::SdoError;
use crate::mail::coe::pdo::Lists;
use crate::mail::{Limits, Mailbox};
use crate::segment::ReadPdos;
use crate::supervisor::Bus;

/// Time limit for reading all PDOs of one SubDevice.
const LIMIT: Duration = Duration::from_secs(3);
/// Time limits of one request.
const LIMITS: Limits = Limits::new(Duration::from_millis(100), Duration::from_secs(1));

/// What a dictionary holds.
#[derive(Debug)]
pub(crate) enum Dictionary {
    /// The PDOs of all SyncManagers for process data.
    Held(Vec<PdoAssignment>),
    /// It has no objects of PDOs: those of the SII are used.
    None,
    /// It cannot be read; the reason. The PDOs of the SII are used.
    Unreadable(String),
    /// Frames were lost, or the mailbox was closed: nothing is known of it.
    Interrupted,
}

/// Reads the PDOs of a SubDevice whose mailbox is in use.
pub(super) async fn read(bus: &Bus, info: &SubDeviceInfo, mailbox: &Mailbox) -> Dictionary {
    let read = bus.within(LIMIT, assignments(info, mailbox)).await;
    match read {
        Ok(Ok(dictionary)) => dictionary,
        Ok(Err(error)) if error.is_interrupted() => Dictionary::Interrupted,
        Ok(Err(error)) => Dictionary::Unreadable(error.to_string()),
        Err(_) => Dictionary::Unreadable("it takes too long".to_string()),
    }
}

async fn assignments(info: &SubDeviceInfo, mailbox: &Mailbox) -> Result<Dictionary, SdoError> {
    let (mut held, mut missing) = (Vec::new(), Vec::new());
    let mut lists = Lists::new(mailbox, LIMITS).with_complete_access(info.coe.complete_access());
    let assignment = |sync_manager: u8| ASSIGNMENT_BASE + u16::from(sync_manager);
    for (sync_manager, direction) in info.process_data() {
        match lists.assignment(sync_manager).await {
            Ok(pdos) => held.push(PdoAssignment::new(sync_manager, direction, pdos)),
            // A mapping that is missing is a fault.
            Err(error) if error.is_missing_object() && error.object.index == assignment(sync_manager) => {
                missing.push(error);
            }
            Err(error) => return Err(error),
        }
    }
    match missing.pop() {
        None => Ok(Dictionary::Held(held)),
        Some(_) if held.is_empty() => Ok(Dictionary::None),
        Some(error) => Err(error),
    }
}

/// Says why a dictionary cannot be read.
pub(super) fn report_unreadable(bus: &Bus, info: &SubDeviceInfo, reason: &str) {
    let what = alloc::format!("the PDOs in its dictionary cannot be read: {reason}");
    bus.notice(Notice::SiiWarning { position: info.position, what });
}

/// Reads dictionaries after a scan, and updates it. Each SubDevice is brought to PREOP, and back to INIT.
pub(super) async fn complete(bus: &Bus, scan: &mut Scan, (which, assignment): (ReadPdos, SiiAssignment)) {
    let wanted = scan.subdevices.iter().filter(|info| is_wanted(info, which)).cloned();
    let read = bus.gather(wanted.collect::<Vec<_>>(), |bus, info| async move {
        let mailbox = Mailbox::new(&bus, info.position);
        let result = match visit(&bus, &info, &mailbox, AlState::PreOp, assignment).await {
            Ok(()) => read(&bus, &info, &mailbox).await,
            Err(error) => Dictionary::Unreadable(error.to_string()),
        };
        // A SubDevice that refuses is handled when it is configured.
        let _ = visit(&bus, &info, &mailbox, AlState::Init, assignment).await;
        (info.position, result)
    });
    for (position, result) in read.await {
        let Some(info) = scan.subdevices.iter_mut().find(|info| info.position == position) else { continue };
        match result {
            Dictionary::Held(held) => {
                for warning in info.take_dictionary(&held) {
                    bus.notice(Notice::SiiWarning { position, what: warning.to_string() });
                }
            }
            Dictionary::Unreadable(reason) => report_unreadable(bus, info, &reason),
            Dictionary::Interrupted => report_unreadable(bus, info, "frames were lost"),
            Dictionary::None => {}
        }
    }
}

/// Whether the dictionary of a SubDevice in INIT is to be read after a scan.
fn is_wanted(info: &SubDeviceInfo, which: ReadPdos) -> bool {
    info.has_dictionary_of_pdos()
        && match which {
            ReadPdos::Never => false,
            ReadPdos::Missing => info.lacks_pdos(),
            ReadPdos::Always => true,
        }
}
