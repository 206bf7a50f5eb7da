//! Whether the process data of a SubDevice can be brought to what a file declares. PDOs are written where the SubDevice
//! has CoE and its SII permits it (protocol 4.2, 6.3); otherwise it keeps its own, and refuses SAFEOP if the length of
//! a SyncManager is another one. A controller without a processor (device emulation) accepts any length.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use ringcat_engine::config::{PdoMapping, SubDeviceConfig};
use ringcat_engine::info::SubDeviceInfo;
use ringcat_engine::{AreaPlan, plan};
use ringcat_wire::al::AlState;
use ringcat_wire::sii::Pdo;

use super::samples;
use super::written::Written;

/// Lengths of a SyncManager in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Lengths {
    /// The declared length.
    pub(super) declared: u16,
    /// The length that the SubDevice has.
    pub(super) own: u16,
    /// Reason of the difference.
    reason: Reason,
    /// Whether the length of the SubDevice is due to start-up commands of the file.
    pub(super) is_written: bool,
}

impl Lengths {
    /// Whether the file does not have the process data.
    pub(super) fn is_left_out(&self) -> bool {
        self.reason == Reason::LeftOut
    }
}

/// Why a SubDevice has another length than declared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reason {
    /// Its PDOs are fixed.
    Fixed,
    /// The start-up commands of the file write them.
    Written,
    /// An ENI has no commands that write them.
    Unwritten,
    /// The file does not have the SyncManager, or has it without a length.
    LeftOut,
}

impl fmt::Display for Lengths {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Lengths { declared, own, reason, .. } = self;
        let reason = match reason {
            Reason::Fixed => ": the PDOs of the SubDevice cannot be written",
            Reason::Written => " with the PDOs that the start-up commands leave",
            Reason::Unwritten => " with the PDOs of the SubDevice: the file does not write them",
            Reason::LeftOut => ": the file has no process data for it",
        };
        write!(f, "expected a length of {declared}, got {own}{reason}")
    }
}

/// The SyncManagers whose length remains different from the declared one.
pub(super) fn unfit(declared: &SubDeviceConfig, info: &SubDeviceInfo) -> BTreeMap<u8, Lengths> {
    if info.device_emulation || !matches!(declared.target, AlState::SafeOp | AlState::Op) {
        return BTreeMap::new();
    }
    let (Ok(wanted), Ok(own)) = (plan(declared, info), plan(&SubDeviceConfig::from_info(info), info)) else {
        return BTreeMap::new();
    };
    let has_dictionary = info.protocols.coe() && info.mailbox.is_some();
    let written = has_dictionary.then(|| Written::by(declared, info, &wanted.process_data));
    // The tables of a network file are written.
    let is_unwritten = declared.declared.is_some() && written.as_ref().is_some_and(|it| !it.is_refused());
    let of_file = |number: &u8| declared.pdos.iter().flatten().any(|it| it.sync_manager == *number);
    let is_exchanged =
        |area: &&AreaPlan| area.pdos.is_empty() || !area.pdos.iter().all(|pdo| is_virtual(pdo.index, info));
    let numbers = wanted.process_data.iter().map(|area| area.sync_manager);
    // What a network file leaves out is as in the SII; what an ENI leaves out is not set up.
    let compared: BTreeSet<u8> = match declared.declared {
        None => numbers.filter(of_file).collect(),
        Some(_) => {
            let own = own.process_data.iter().filter(is_exchanged).map(|area| area.sync_manager);
            numbers.chain(own).collect()
        }
    };
    let mut unfit = BTreeMap::new();
    for number in compared {
        let area = wanted.process_data.iter().find(|area| area.sync_manager == number);
        // The SII does not contain the lengths of operation modes, but each mode has process data.
        if samples::are_chosen(number, info) && area.is_some_and(|area| area.length > 0) {
            continue;
        }
        let fixed = own.process_data.iter().find(|area| area.sync_manager == number).map(|area| area.length);
        let (held, is_written) = match &written {
            Some(written) => written.bytes(number, fixed).unzip(),
            None => (fixed, None),
        };
        let length = area.map_or(0, |area| area.length);
        let reason = match is_written {
            _ if length == 0 && declared.declared.is_some() => Reason::LeftOut,
            Some(true) => Reason::Written,
            Some(false) if is_unwritten => Reason::Unwritten,
            _ => Reason::Fixed,
        };
        if let Some(own) = held.filter(|held| *held != length) {
            let is_written = is_written == Some(true);
            unfit.insert(number, Lengths { declared: length, own, reason, is_written });
        }
    }
    unfit
}

/// Whether a PDO is for tools only: the SII lists it, the SubDevice has no object for it (protocol ES-47). A
/// declaration that is made from a description does not contain it.
pub(super) fn is_virtual(index: u16, info: &SubDeviceInfo) -> bool {
    info.pdo(index).is_some_and(|pdo| pdo.flags & Pdo::VIRTUAL != 0)
}

/// All PDOs of a declaration, with their SyncManagers.
pub(super) fn pdos(declared: &SubDeviceConfig) -> impl Iterator<Item = (u8, &PdoMapping)> {
    let of_file = declared.declared.iter().flatten().flat_map(|it| it.pdos.iter().map(|pdo| (it.index, pdo)));
    let assigned = declared.pdos.iter().flatten().flat_map(|it| it.pdos.iter().map(|pdo| (it.sync_manager, pdo)));
    of_file.chain(assigned.filter(|_| declared.declared.is_none()))
}
