//! PDO assignment and mapping from the object dictionaries, if the SII has none or another one (protocol 4.5, 6.3).
//!
//! After a scan, SubDevices with CoE are brought to PREOP, read, and sent back to INIT. The dictionary has priority
//! over the SII.

use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::sdo::AbortCode;
use ringcat_wire::sii::{CategoryKind, SiiSyncManager, SyncManagerKind};

use super::scan::Scan;
use super::visit::visit;
use crate::config::{PdoEntry, PdoMapping};
use crate::event::Notice;
use crate::info::{Direction, InfoWarning, PdoEntryInfo, PdoInfo, SiiProblem, SubDeviceInfo};
use crate::mail::coe::{SdoFailure, pdo};
use crate::mail::{Limits, Mailbox};
use crate::supervisor::Bus;

/// Time limit for reading all PDOs of one SubDevice.
const LIMIT: Duration = Duration::from_secs(3);
/// Time limits of one request.
const LIMITS: Limits = Limits::new(Duration::from_millis(100), Duration::from_secs(1));

/// Dictionaries that are read for PDOs after a scan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum ReadPdos {
    /// None.
    Never,
    /// Those of SubDevices whose SII assigns no PDO to a SyncManager for process data that is in use.
    #[default]
    Missing,
    /// Those of all SubDevices with CoE. Each is brought to PREOP and back.
    Always,
}

/// Reads the dictionaries, and updates the scan.
pub(super) async fn complete(bus: &Bus, scan: &mut Scan, which: ReadPdos) {
    let wanted: Vec<SubDeviceInfo> = scan.subdevices.iter().filter(|info| is_wanted(info, which)).cloned().collect();
    let read = bus.gather(wanted, |bus, info| async move {
        let mailbox = Mailbox::new(&bus, info.position);
        let result = bus.within(LIMIT, assignments(&bus, &info, &mailbox)).await;
        let result = result.unwrap_or_else(|_| Err("it takes too long".to_string()));
        // A SubDevice that refuses is handled when it is configured.
        let _ = visit(&bus, &info, &mailbox, AlState::Init).await;
        (info.position, result)
    });
    for (position, result) in read.await {
        let Some(info) = scan.subdevices.iter_mut().find(|info| info.position == position) else { continue };
        match result {
            Ok(assignments) => {
                for assignment in assignments {
                    let Some(warning) = merge(info, assignment) else { continue };
                    bus.notice(Notice::SiiOddity { position, what: warning.to_string() });
                    info.warnings.push(warning);
                }
            }
            Err(reason) => {
                let what = alloc::format!("the PDOs in its dictionary cannot be read: {reason}");
                bus.notice(Notice::SiiOddity { position, what });
            }
        }
    }
}

fn is_wanted(info: &SubDeviceInfo, which: ReadPdos) -> bool {
    let speaks = info.mailbox.is_some() && info.protocols.coe();
    let mut sync_managers = process_data(info);
    speaks
        && match which {
            ReadPdos::Never => false,
            ReadPdos::Missing => sync_managers.any(|(number, _)| is_missing(info, number)),
            ReadPdos::Always => sync_managers.next().is_some(),
        }
}

/// Whether the SII assigns no PDO to a SyncManager that is in use. A SyncManager without a length beside others with
/// PDOs is not in use.
fn is_missing(info: &SubDeviceInfo, number: u8) -> bool {
    let in_use = |sii: &SiiSyncManager| info.pdos.is_empty() || (sii.is_enabled() && sii.length > 0);
    info.assigned_pdos(number).next().is_none() && info.sync_managers.get(usize::from(number)).is_some_and(in_use)
}

/// SyncManagers for process data, with their directions.
fn process_data(info: &SubDeviceInfo) -> impl Iterator<Item = (u8, Direction)> {
    (0..).zip(&info.sync_managers).filter_map(|(number, sync_manager)| match sync_manager.kind {
        SyncManagerKind::Outputs => Some((number, Direction::Outputs)),
        SyncManagerKind::Inputs => Some((number, Direction::Inputs)),
        SyncManagerKind::Unused
        | SyncManagerKind::MailboxOut
        | SyncManagerKind::MailboxIn
        | SyncManagerKind::Other(_) => None,
    })
}

/// PDOs assigned to a SyncManager.
struct Assignment {
    sync_manager: u8,
    direction: Direction,
    pdos: Vec<PdoMapping>,
}

async fn assignments(bus: &Bus, info: &SubDeviceInfo, mailbox: &Mailbox) -> Result<Vec<Assignment>, String> {
    visit(bus, info, mailbox, AlState::PreOp).await.map_err(|error| error.to_string())?;
    let mut all = Vec::new();
    for (sync_manager, direction) in process_data(info) {
        match pdo::read_assignment(mailbox, sync_manager, LIMITS).await {
            Ok(pdos) => all.push(Assignment { sync_manager, direction, pdos }),
            // There is no such object: only the SII counts.
            Err(error) if error.cause == SdoFailure::Aborted(AbortCode::OBJECT_DOES_NOT_EXIST) => {}
            Err(error) => return Err(error.to_string()),
        }
    }
    Ok(all)
}

/// Takes an assignment over. The warning reports that the SII has another one.
fn merge(info: &mut SubDeviceInfo, assignment: Assignment) -> Option<InfoWarning> {
    let Assignment { sync_manager, direction, pdos } = assignment;
    let before: Vec<PdoInfo> = info.assigned_pdos(sync_manager).cloned().collect();
    let known: Vec<PdoInfo> = pdos.iter().filter_map(|pdo| info.pdo(pdo.index).cloned()).collect();
    let now: Vec<PdoInfo> = pdos.iter().map(|pdo| describe(pdo, sync_manager, direction, &known)).collect();
    // First the PDOs, then the entries of each.
    let mapped = |pdos: &[PdoInfo]| -> Vec<(u16, u16, u8, u8)> {
        let entries = |pdo: &PdoInfo| {
            let of = pdo.index;
            let entry = move |entry: &PdoEntryInfo| (of, entry.index, entry.sub_index, entry.bit_length);
            pdo.entries.iter().map(entry).collect::<Vec<_>>()
        };
        let indices = pdos.iter().map(|pdo| (pdo.index, 0, 0, 0));
        indices.chain(pdos.iter().flat_map(entries)).collect()
    };
    let differs = mapped(&before) != mapped(&now);
    let bits = |pdos: &[PdoInfo]| pdos.iter().map(PdoInfo::bit_length).sum();
    let problem = SiiProblem::Dictionary { sync_manager, sii: bits(&before), dictionary: bits(&now) };
    let warned = differs && !before.is_empty();
    info.read_online.push(sync_manager);
    info.pdos.retain(|pdo| pdos.iter().all(|read| read.index != pdo.index));
    info.pdos.iter_mut().filter(|pdo| pdo.sync_manager == Some(sync_manager)).for_each(|pdo| pdo.sync_manager = None);
    info.pdos.extend(now);
    let category = match direction {
        Direction::Outputs => CategoryKind::RxPdo,
        Direction::Inputs => CategoryKind::TxPdo,
    };
    warned.then_some(InfoWarning { category: Some(category), offset: None, problem })
}

/// A PDO according to the dictionary, with the names of the SII.
fn describe(read: &PdoMapping, sync_manager: u8, direction: Direction, known: &[PdoInfo]) -> PdoInfo {
    let known = known.iter().find(|pdo| pdo.index == read.index);
    let entry = |entry: &PdoEntry| {
        let PdoEntry { index, sub_index, bit_length } = *entry;
        let named = known.into_iter().flat_map(|pdo| &pdo.entries);
        let mut same = named.filter(|named| (named.index, named.sub_index) == (index, sub_index));
        PdoEntryInfo { index, sub_index, bit_length, ..same.next().cloned().unwrap_or_default() }
    };
    PdoInfo {
        index: read.index,
        direction,
        sync_manager: Some(sync_manager),
        name: known.map(|pdo| pdo.name.clone()).unwrap_or_default(),
        flags: known.map_or(0, |pdo| pdo.flags),
        entries: read.entries.iter().flatten().map(entry).collect(),
    }
}
