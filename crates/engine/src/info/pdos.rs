//! SyncManagers for process data, and whether their PDOs are known.

use ringcat_wire::sii::{SiiSyncManager, SyncManagerKind};

use super::subdevice::SubDeviceInfo;
use crate::direction::Direction;

impl SubDeviceInfo {
    /// SyncManagers for process data, with their directions.
    pub(crate) fn process_data(&self) -> impl Iterator<Item = (u8, Direction)> {
        (0..).zip(&self.sync_managers).filter_map(|(number, sync_manager)| match sync_manager.kind {
            SyncManagerKind::Outputs => Some((number, Direction::Outputs)),
            SyncManagerKind::Inputs => Some((number, Direction::Inputs)),
            SyncManagerKind::Unused
            | SyncManagerKind::MailboxOut
            | SyncManagerKind::MailboxIn
            | SyncManagerKind::Other(_) => None,
        })
    }

    /// Whether it has a dictionary with PDOs that can be read.
    pub(crate) fn has_dictionary_of_pdos(&self) -> bool {
        self.mailbox.is_some() && self.protocols.coe() && self.process_data().next().is_some()
    }

    /// Whether the SII assigns no PDO to a SyncManager that is in use. A SyncManager without a length beside others
    /// with PDOs is not in use.
    pub(crate) fn lacks_pdos(&self) -> bool {
        let in_use = |sii: &SiiSyncManager| self.pdos.is_empty() || (sii.is_enabled() && sii.length > 0);
        self.process_data().any(|(number, _)| {
            let is_in_use = self.sync_managers.get(usize::from(number)).is_some_and(in_use);
            is_in_use && self.assigned_pdos(number).next().is_none()
        })
    }
}
