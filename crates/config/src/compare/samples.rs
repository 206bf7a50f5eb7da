//! Oversampling without a dictionary (protocol ES-47): the SII lists the PDOs of all operation modes for a SyncManager,
//! and one sample of each. It does not say which of them an operation mode has, and how many samples; the file does.

use ringcat_engine::config::PdoMapping;
use ringcat_engine::info::{PdoInfo, SubDeviceInfo};
use ringcat_wire::sii::Pdo;

/// Whether the file chooses the PDOs of a SyncManager among those that the SII lists.
pub(super) fn are_chosen(sync_manager: u8, info: &SubDeviceInfo) -> bool {
    of(sync_manager, info).next().is_some()
}

/// Whether a PDO that the SII does not list for the SyncManager is a further sample: one of the same length as a listed
/// PDO. With many samples, the indices overlap with those of another SyncManager.
pub(super) fn is_sample(pdo: &PdoMapping, sync_manager: u8, info: &SubDeviceInfo) -> bool {
    let Some(entries) = &pdo.entries else { return false };
    let length: u32 = entries.iter().map(|entry| u32::from(entry.bit_length)).sum();
    !is_listed(pdo, sync_manager, info) && of(sync_manager, info).any(|listed| listed.bit_length() == length)
}

/// Whether the SII lists a PDO for a SyncManager.
pub(super) fn is_listed(pdo: &PdoMapping, sync_manager: u8, info: &SubDeviceInfo) -> bool {
    info.pdo(pdo.index).is_some_and(|listed| listed.sync_manager == Some(sync_manager))
}

/// The PDOs of a SyncManager that have several samples.
fn of(sync_manager: u8, info: &SubDeviceInfo) -> impl Iterator<Item = &PdoInfo> {
    let has_dictionary = info.protocols.coe() && info.mailbox.is_some();
    let listed = info.pdos.iter().filter(move |_| !has_dictionary);
    listed.filter(move |pdo| pdo.sync_manager == Some(sync_manager) && pdo.flags & Pdo::OVERSAMPLING != 0)
}
