//! Whether the process data of a SubDevice can be brought to what a file declares. PDOs are written where the
//! SubDevice has CoE and its SII permits it (protocol 4.2, 6.3); otherwise it keeps its own, and refuses SAFEOP if the
//! length of a SyncManager is another one.

use std::collections::BTreeMap;
use std::fmt;

use ringcat_engine::config::{PdoMapping, SdoDownload, StartupAction, SubDeviceConfig};
use ringcat_engine::info::SubDeviceInfo;
use ringcat_engine::plan;
use ringcat_wire::mailbox::coe::pdo_objects::is_of_pdos;

/// Lengths of a SyncManager in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Lengths {
    /// As declared.
    pub(super) declared: u16,
    /// The one that the SubDevice has.
    pub(super) own: u16,
}

impl fmt::Display for Lengths {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Lengths { declared, own } = self;
        write!(f, "expected a length of {declared}, got {own}: the PDOs of the SubDevice cannot be written")
    }
}

/// The SyncManagers whose length stays another one than declared.
pub(super) fn unfit(declared: &SubDeviceConfig, info: &SubDeviceInfo) -> BTreeMap<u8, Lengths> {
    let has_dictionary = info.protocols.coe() && info.mailbox.is_some();
    // What start-up commands write is not known from here.
    if has_dictionary && declared.startup.iter().any(|command| writes_pdos(&command.action)) {
        return BTreeMap::new();
    }
    let (Ok(wanted), Ok(own)) = (plan(declared, info), plan(&SubDeviceConfig::from_info(info), info)) else {
        return BTreeMap::new();
    };
    let of_file = |number: u8| declared.pdos.iter().flatten().find(|it| it.sync_manager == number);
    let mut unfit = BTreeMap::new();
    for area in &wanted.process_data {
        let number = area.sync_manager;
        if declared.declared.is_none() && of_file(number).is_none() {
            continue;
        }
        let fixed = own.process_data.iter().find(|it| it.sync_manager == number).map(|it| it.length);
        let held = if has_dictionary && declared.declared.is_none() {
            let wanted: Vec<(u16, u32)> = area
                .pdos
                .iter()
                .map(|pdo| (pdo.index, pdo.entries.iter().map(|entry| u32::from(entry.bit_length)).sum()))
                .collect();
            let is_fixed = |pdo: u16| {
                let mut pdos = of_file(number).into_iter().flat_map(|it| &it.pdos);
                pdos.any(|it| it.index == pdo && it.fixed)
            };
            held_bytes(&wanted, info, (number, fixed), is_fixed)
        } else {
            fixed
        };
        if let Some(own) = held.filter(|held| *held != area.length) {
            unfit.insert(number, Lengths { declared: area.length, own });
        }
    }
    unfit
}

/// The length with the PDOs and mappings that a SubDevice with CoE permits; `None` where it is not known.
fn held_bytes(
    wanted: &[(u16, u32)],
    info: &SubDeviceInfo,
    (sync_manager, fixed): (u8, Option<u16>),
    is_fixed: impl Fn(u16) -> bool,
) -> Option<u16> {
    // An SII without CoE details contains no information about them.
    let (can_assign, can_map) = match info.coe {
        details if details.0 == 0 => (true, true),
        details => (details.pdo_assign(), details.pdo_configuration()),
    };
    let mapped = |index: u16| {
        let of_file =
            wanted.iter().find(|(pdo, _)| can_map && *pdo == index && !is_fixed(index)).map(|(_, bits)| *bits);
        of_file.or_else(|| info.pdo(index).map(|pdo| pdo.bit_length()))
    };
    let assigned: Vec<u16> = if can_assign {
        wanted.iter().map(|(index, _)| *index).collect()
    } else {
        info.assigned_pdos(sync_manager).map(|pdo| pdo.index).collect()
    };
    if assigned.is_empty() && !can_assign {
        return fixed;
    }
    let bits = assigned.into_iter().map(mapped).sum::<Option<u32>>()?;
    u16::try_from(bits.div_ceil(8)).ok()
}

/// Whether a start-up command writes an assignment or a mapping.
pub(super) fn writes_pdos(action: &StartupAction) -> bool {
    let StartupAction::Sdo(SdoDownload { index, .. }) = action else { return false };
    is_of_pdos(*index)
}

/// All PDOs of a declaration, with their SyncManagers.
pub(super) fn pdos(declared: &SubDeviceConfig) -> impl Iterator<Item = (u8, &PdoMapping)> {
    let of_file = declared.declared.iter().flatten().flat_map(|it| it.pdos.iter().map(|pdo| (it.index, pdo)));
    let assigned = declared.pdos.iter().flatten().flat_map(|it| it.pdos.iter().map(|pdo| (it.sync_manager, pdo)));
    of_file.chain(assigned.filter(|_| declared.declared.is_none()))
}
