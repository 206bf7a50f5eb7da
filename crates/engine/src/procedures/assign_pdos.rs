//! PDOs in the dictionary of a SubDevice in PREOP: compared with what is planned, and written where they differ
//! (protocol 5.2, 6.3).
//!
//! A dictionary that is as at power-on is not read: what it holds is known from the scan.

use alloc::vec::Vec;

use crate::config::{PdoAssignment, PdoMapping, SdoDownload};
use crate::mail::coe::{self, SdoAddress, SdoError, pdo};
use crate::mail::{Limits, Mailbox};
use crate::plan::{HeldPdos, PdoPlan};

/// What is known of the dictionary of a SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Known {
    /// What it holds is known.
    Surely,
    /// It may hold anything: it is read first.
    Doubtfully,
}

/// What was done with an assignment.
#[derive(Debug)]
pub(super) enum Assigned {
    /// Nothing was written: it is as is known, or the SubDevice has no such object.
    AsKnown,
    /// The dictionary holds this from now on.
    Held(PdoAssignment),
}

/// Brings the dictionary to what is planned for a SyncManager. `before_writing` is called before the first download.
pub(super) async fn assign(
    mailbox: &Mailbox,
    plan: &PdoPlan,
    known: Known,
    limits: Limits,
    mut before_writing: impl FnMut(&SdoDownload),
) -> Result<Assigned, SdoError> {
    let read = match known {
        Known::Surely => None,
        Known::Doubtfully => Some(read(mailbox, plan, limits).await?),
    };
    let sdos = match &read {
        Some(Some(held)) => plan.downloads(held),
        // Without such an object a declaration that is as known is fulfilled.
        None | Some(None) => plan.sdos.clone(),
    };
    for sdo in &sdos {
        before_writing(sdo);
        let SdoDownload { index, sub_index, complete_access, ref data } = *sdo;
        coe::write(mailbox, SdoAddress { index, sub_index, complete_access }, data, limits).await?;
    }
    let is_known = sdos.is_empty() && !matches!(read, Some(Some(_)));
    Ok(if is_known { Assigned::AsKnown } else { Assigned::Held(held_now(plan, read.flatten(), &sdos)) })
}

/// What the dictionary holds after the downloads.
fn held_now(plan: &PdoPlan, before: Option<HeldPdos>, sdos: &[SdoDownload]) -> PdoAssignment {
    let PdoAssignment { sync_manager, direction, ref pdos } = plan.wanted;
    let before = before.unwrap_or_default();
    let mapping = |wanted: &PdoMapping| {
        let is_written = plan.can_map() && sdos.iter().any(|sdo| sdo.index == wanted.index);
        let held = before.mapped.iter().find(|held| held.index == wanted.index).filter(|_| !is_written);
        held.unwrap_or(wanted).clone()
    };
    let assigned: Vec<PdoMapping> = match before.assigned.filter(|_| !plan.can_assign()) {
        Some(assigned) => before.mapped.iter().filter(|held| assigned.contains(&held.index)).cloned().collect(),
        None => pdos.iter().map(mapping).collect(),
    };
    PdoAssignment::new(sync_manager, direction, assigned)
}

/// Reads what the dictionary holds of what is planned; `None` without such an object.
async fn read(mailbox: &Mailbox, plan: &PdoPlan, limits: Limits) -> Result<Option<HeldPdos>, SdoError> {
    let pdos = match pdo::read_assignment(mailbox, plan.wanted.sync_manager, limits).await {
        Ok(pdos) => pdos,
        Err(error) if error.is_missing_object() => return Ok(None),
        Err(error) => return Err(error),
    };
    let assigned = pdos.iter().map(|pdo| pdo.index).collect();
    let mut held = HeldPdos { assigned: Some(assigned), mapped: pdos };
    for wanted in &plan.wanted.pdos {
        if held.has_mapping(wanted.index) {
            continue;
        }
        match pdo::read_mapping(mailbox, wanted.index, limits).await {
            Ok(entries) => held.mapped.push(PdoMapping::of(wanted.index, entries)),
            // To be written, if the SubDevice permits it.
            Err(error) if error.is_missing_object() => {}
            Err(error) => return Err(error),
        }
    }
    Ok(Some(held))
}
