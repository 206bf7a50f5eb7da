//! PDOs of each SyncManager by the rules of the description (protocol ES-40, ES-44, ES-47, ES-48, ES-50).

use std::collections::{HashMap, HashSet};

use super::candidates::{Candidate, candidates};
use super::mapping;
use super::work::Work;
use crate::esi::error::EsiError;
use crate::esi::model::{Pdo, SlotIndex, SyncManager, SyncManagerRole};
use crate::esi::selection::SelectedSyncManager;

/// Copies of a PDO by oversampling, at most: subindices of an assignment.
const MAX_SAMPLES: u32 = 255;
/// Places of the PDOs that an operation mode does not list: behind those that it lists, in document order.
const UNLISTED: usize = 0x1_0000;
/// Bytes of a SyncManager.
const MAX_BYTES: u32 = 0xFFFF;
/// Entries of a PDO with its copies, at most: more than bits in a SyncManager.
const MAX_SAMPLED: u64 = 8 << 16;

/// A PDO in a SyncManager: number of the candidate, number of the SyncManager, place in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Assigned {
    sync_manager: u8,
    rank: usize,
    candidate: usize,
}

/// SyncManagers with process data and their PDOs.
pub(super) fn sync_managers<'a>(work: &mut Work<'a>) -> Result<Vec<SelectedSyncManager<'a>>, EsiError> {
    let candidates = candidates(work)?;
    let by_index: HashMap<u16, usize> =
        candidates.iter().enumerate().map(|(number, it)| (it.pdo.index.index, number)).collect();
    let by_default = by_default(work, &candidates, &by_index);
    let mut assigned = by_default.clone();
    without(work, &candidates, &by_index, &mut assigned)?;
    with(work, &candidates, &by_index, &mut assigned)?;
    drop_virtual(work, &candidates, &mut assigned);
    assigned.sort_unstable();
    for one in &assigned {
        place(work, &candidates[one.candidate], one.sync_manager)?;
    }
    excluded(work, &candidates, &by_index, &assigned)?;
    mandatory(work, &candidates, &by_index, &assigned)?;
    changeable(work, &candidates, &by_default, &assigned)?;
    for index in work.choices.mappings.iter().map(|it| it.index).chain(work.choices.samples.iter().map(|it| it.index)) {
        let candidate = known(work, &candidates, &by_index, index)?;
        if !assigned.iter().any(|it| it.candidate == candidate) {
            return Err(candidates[candidate].error(work, "it is not assigned, so its entries cannot be chosen"));
        }
    }
    let device = work.device;
    let factors = factors_of_mode(work);
    let mut selected = Vec::new();
    for (number, definition) in (0..=u8::MAX).zip(&device.sync_managers) {
        let outputs = definition.role == SyncManagerRole::Outputs;
        if definition.is_virtual || !(outputs || definition.role == SyncManagerRole::Inputs) {
            continue;
        }
        let mut pdos = Vec::new();
        let mut mapped = Vec::new();
        for one in assigned.iter().filter(|it| it.sync_manager == number) {
            let candidate = &candidates[one.candidate];
            let pdo = mapping::mapped(work, candidate)?;
            if pdo.entries != candidate.pdo.entries {
                mapped.push(pdo.index.index);
            }
            pdos.extend(samples(work, &factors, candidate, pdo)?);
        }
        let of = SelectedSyncManager { number, outputs, definition, pdos, mapped };
        let is_chosen = assigned != by_default || !work.choices.mappings.is_empty();
        size(work, definition, &of, is_chosen)?;
        selected.push(of);
    }
    Ok(selected)
}

/// The assignment by default: PDOs with a SyncManager in document order, in the SyncManagers that the operation mode
/// names those that it lists.
fn by_default(work: &Work<'_>, candidates: &[Candidate], by_index: &HashMap<u16, usize>) -> Vec<Assigned> {
    let of_mode = work.mode.map(|mode| &mode.sync_managers[..]).unwrap_or_default();
    let listed: HashSet<u8> = of_mode.iter().filter(|sm| !sm.pdos.is_empty()).map(|sm| sm.number).collect();
    let mut assigned = Vec::new();
    for sm in of_mode {
        for (rank, (index, _)) in sm.pdos.iter().enumerate() {
            if let Some(candidate) = by_index.get(index) {
                assigned.push(Assigned { sync_manager: sm.number, rank, candidate: *candidate });
            }
        }
    }
    for (candidate, it) in candidates.iter().enumerate() {
        if let Some(sync_manager) = it.pdo.sync_manager
            && (it.slot.is_some() || !listed.contains(&sync_manager))
        {
            assigned.push(Assigned { sync_manager, rank: UNLISTED + candidate, candidate });
        }
    }
    assigned.sort_unstable();
    let mut seen = HashSet::new();
    assigned.retain(|one| seen.insert(one.candidate));
    assigned
}

fn known(
    work: &Work<'_>,
    candidates: &[Candidate],
    by_index: &HashMap<u16, usize>,
    index: u16,
) -> Result<usize, EsiError> {
    /// PDOs that are named.
    const NAMED: usize = 16;
    by_index.get(&index).copied().ok_or_else(|| {
        let names: Vec<String> =
            candidates.iter().take(NAMED).map(|it| format!("{:#06x}", it.pdo.index.index)).collect();
        let more = if candidates.len() > NAMED { ", ..." } else { "" };
        let expected =
            if names.is_empty() { "it has none".to_owned() } else { format!("expected {}", names.join(", ")) };
        work.error(work.device.line, format!("there is no PDO {index:#06x}: {expected}{more}"))
    })
}

fn without(
    work: &Work<'_>,
    candidates: &[Candidate],
    by_index: &HashMap<u16, usize>,
    assigned: &mut Vec<Assigned>,
) -> Result<(), EsiError> {
    for index in &work.choices.without {
        let candidate = known(work, candidates, by_index, *index)?;
        let before = assigned.len();
        assigned.retain(|it| it.candidate != candidate);
        if assigned.len() == before {
            return Err(candidates[candidate].error(work, "it is not assigned by default, so it cannot be left out"));
        }
    }
    Ok(())
}

fn with(
    work: &Work<'_>,
    candidates: &[Candidate],
    by_index: &HashMap<u16, usize>,
    assigned: &mut Vec<Assigned>,
) -> Result<(), EsiError> {
    for choice in &work.choices.with {
        let candidate = known(work, candidates, by_index, choice.index)?;
        let it = &candidates[candidate];
        if it.pdo.is_virtual {
            return Err(it.error(work, "it is virtual: the device has no object for it, so it cannot be assigned"));
        }
        let sync_manager = match choice.sync_manager.or(it.pdo.sync_manager) {
            Some(number) => number,
            None => only_one(work, it)?,
        };
        place(work, it, sync_manager)?;
        assigned.retain(|other| other.candidate != candidate);
        assigned.push(Assigned { sync_manager, rank: UNLISTED + candidate, candidate });
    }
    Ok(())
}

/// The only SyncManager of a PDO's direction.
fn only_one(work: &Work<'_>, of: &Candidate) -> Result<u8, EsiError> {
    let role = if of.outputs { SyncManagerRole::Outputs } else { SyncManagerRole::Inputs };
    let fits = |(_, sm): &(u8, &SyncManager)| sm.role == role && !sm.is_virtual;
    let fitting: Vec<u8> =
        (0..=u8::MAX).zip(&work.device.sync_managers).filter(fits).map(|(number, _)| number).collect();
    match fitting[..] {
        [only] => Ok(only),
        [] => Err(of.error(work, "no SyncManager of the device has its direction")),
        _ => Err(of.error(work, format!("it can be in the SyncManagers {fitting:?}: choose one"))),
    }
}

/// Virtual PDOs and those of virtual SyncManagers are information for tools.
fn drop_virtual(work: &mut Work<'_>, candidates: &[Candidate], assigned: &mut Vec<Assigned>) {
    assigned.retain(|one| {
        let it = &candidates[one.candidate];
        let sm = work.device.sync_managers.get(usize::from(one.sync_manager));
        let in_virtual = sm.is_some_and(|sm| sm.is_virtual);
        if it.pdo.is_virtual || in_virtual {
            let text = if in_virtual { "its SyncManager is virtual" } else { "it is virtual" };
            let (label, line) = (it.label(), it.pdo.line);
            work.note(line, format!("{label}: {text}: not exchanged"));
        }
        !it.pdo.is_virtual && !in_virtual
    });
}

/// Whether a PDO can be in a SyncManager.
fn place(work: &Work<'_>, of: &Candidate, number: u8) -> Result<(), EsiError> {
    let Some(sm) = work.device.sync_managers.get(usize::from(number)) else {
        let count = work.device.sync_managers.len();
        return Err(of.error(work, format!("SyncManager {number} does not exist: the device has {count}")));
    };
    let wanted = if of.outputs { SyncManagerRole::Outputs } else { SyncManagerRole::Inputs };
    if sm.role != wanted {
        let (kind, line) = (if of.outputs { "an RxPdo" } else { "a TxPdo" }, sm.line);
        return Err(of.error(work, format!("it is {kind}, SyncManager {number} (line {line}) is {:?}", sm.role)));
    }
    if sm.is_virtual {
        return Err(of.error(work, format!("SyncManager {number} (line {}) is virtual: it has no memory", sm.line)));
    }
    if of.pdo.excluded_sync_managers.contains(&number) {
        return Err(of.error(work, format!("it must not be in SyncManager {number} (ExcludedSm)")));
    }
    Ok(())
}

fn excluded(
    work: &Work<'_>,
    candidates: &[Candidate],
    by_index: &HashMap<u16, usize>,
    assigned: &[Assigned],
) -> Result<(), EsiError> {
    let there: HashSet<usize> = assigned.iter().map(|it| it.candidate).collect();
    for one in assigned {
        let it = &candidates[one.candidate];
        let other = it.pdo.excludes.iter().filter_map(|exclude| by_index.get(&exclude.index));
        if let Some(other) = other.copied().find(|other| *other != one.candidate && there.contains(other)) {
            let other = &candidates[other];
            let reason = format!("it excludes {} (line {}): leave one of them out", other.label(), other.pdo.line);
            return Err(it.error(work, reason));
        }
    }
    Ok(())
}

/// Mandatory PDOs are assigned, unless one that is assigned excludes them.
fn mandatory(
    work: &Work<'_>,
    candidates: &[Candidate],
    by_index: &HashMap<u16, usize>,
    assigned: &[Assigned],
) -> Result<(), EsiError> {
    let there: HashSet<usize> = assigned.iter().map(|it| it.candidate).collect();
    let mut excluded: HashSet<usize> = HashSet::new();
    for it in assigned.iter().map(|it| &candidates[it.candidate]) {
        excluded.extend(it.pdo.excludes.iter().filter_map(|exclude| by_index.get(&exclude.index)));
    }
    for (number, it) in candidates.iter().enumerate() {
        let excludes_one =
            || it.pdo.excludes.iter().filter_map(|other| by_index.get(&other.index)).any(|other| there.contains(other));
        if it.pdo.is_mandatory
            && !it.pdo.is_virtual
            && !there.contains(&number)
            && !excluded.contains(&number)
            && !excludes_one()
            && !in_virtual(work, &it.pdo)
        {
            return Err(it.error(work, "it is mandatory: it has to be assigned"));
        }
    }
    Ok(())
}

fn in_virtual(work: &Work<'_>, pdo: &Pdo) -> bool {
    let sm = pdo.sync_manager.and_then(|number| work.device.sync_managers.get(usize::from(number)));
    sm.is_some_and(|sm| sm.is_virtual)
}

/// Another assignment than by default needs a device that takes one.
fn changeable(
    work: &Work<'_>,
    candidates: &[Candidate],
    by_default: &[Assigned],
    assigned: &[Assigned],
) -> Result<(), EsiError> {
    let list = |of: &[Assigned], number: u8| -> Vec<usize> {
        of.iter().filter(|it| it.sync_manager == number).map(|it| it.candidate).collect()
    };
    let coe = work.device.mailbox.as_ref().and_then(|mailbox| mailbox.coe.as_ref());
    for (number, sm) in (0..=u8::MAX).zip(&work.device.sync_managers).filter(|(_, sm)| !sm.is_virtual) {
        let default: Vec<usize> =
            list(by_default, number).into_iter().filter(|it| !candidates[*it].pdo.is_virtual).collect();
        if list(assigned, number) == default {
            continue;
        }
        if sm.fixed_assignment {
            let reason = format!("the PDOs of SyncManager {number} are fixed (FixedAssignment)");
            return Err(work.error(sm.line, reason));
        }
        if coe.is_some_and(|coe| !coe.pdo_assign) {
            let line = work.device.mailbox.as_ref().map_or(sm.line, |mailbox| mailbox.line);
            let reason = format!("the PDOs of SyncManager {number} cannot be chosen: CoE has no PdoAssign");
            return Err(work.error(line, reason));
        }
    }
    Ok(())
}

/// Oversampling factors that the operation mode lists.
fn factors_of_mode(work: &Work<'_>) -> HashMap<u16, u32> {
    let listed = work.mode.iter().flat_map(|mode| &mode.sync_managers).flat_map(|sm| &sm.pdos);
    listed.filter_map(|(index, factor)| Some((*index, (*factor)?))).collect()
}

/// A PDO, and its copies by oversampling.
fn samples(work: &Work<'_>, factors: &HashMap<u16, u32>, of: &Candidate, pdo: Pdo) -> Result<Vec<Pdo>, EsiError> {
    let index = pdo.index.index;
    let chosen = work.choices.samples.iter().find(|it| it.index == index).map(|it| it.factor);
    let Some([default, least, most, distance]) = pdo.oversampling else {
        return match chosen.filter(|factor| *factor != 1) {
            Some(_) => Err(of.error(work, "it has no oversampling (OSFac)")),
            None => Ok(vec![pdo]),
        };
    };
    let factor = chosen.or(factors.get(&index).copied()).unwrap_or(default).max(1);
    if chosen.is_some() && !(least..=most.min(MAX_SAMPLES)).contains(&factor) {
        let reason = format!("an oversampling factor of {factor}: expected {least} to {}", most.min(MAX_SAMPLES));
        return Err(of.error(work, reason));
    }
    if pdo.entries.len() as u64 * u64::from(factor.min(MAX_SAMPLES)) > MAX_SAMPLED {
        return Err(of.error(work, format!("{} entries {factor} times, which no SyncManager has", pdo.entries.len())));
    }
    let copy = |number: u32| {
        let index = u64::from(index) + u64::from(number) * u64::from(distance);
        let index =
            u16::try_from(index).map_err(|_| of.error(work, format!("copy {number} has an index above 0xffff")))?;
        Ok(Pdo { index: SlotIndex { index, ..pdo.index }, ..pdo.clone() })
    };
    (0..factor.min(MAX_SAMPLES)).map(copy).collect()
}

/// Bytes within what the description allows; sizes by default are as they are.
fn size(work: &Work<'_>, sm: &SyncManager, of: &SelectedSyncManager<'_>, is_chosen: bool) -> Result<(), EsiError> {
    let bytes = of.bytes();
    let start = u32::from(sm.start.unwrap_or(0));
    if bytes > MAX_BYTES || start + bytes > MAX_BYTES + 1 {
        let reason = format!("SyncManager {}: {bytes} bytes at {start:#06x}, which do not fit 64 KiB", of.number);
        return Err(work.error(sm.line, reason));
    }
    let (least, most) = (sm.min_size.unwrap_or(0), sm.max_size.filter(|most| *most > 0).unwrap_or(u16::MAX));
    if is_chosen && bytes > 0 && !(u32::from(least)..=u32::from(most)).contains(&bytes) {
        let reason = format!("SyncManager {}: {bytes} bytes, expected {least} to {most}", of.number);
        return Err(work.error(sm.line, reason));
    }
    Ok(())
}
