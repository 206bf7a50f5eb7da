//! PDOs of a SubDevice: assignment and mapping in its dictionary, and their data by mailbox.

use ringcat_engine::config::{PdoEntry, PdoMapping};
use ringcat_engine::mail::coe::{pdo, pdo_mail};

use super::{SubDevice, SubDeviceError};
use crate::services::Services;

impl<S: Services> SubDevice<S> {
    /// Reads the PDOs assigned to a SyncManager, with their mapping, from the objects of the SubDevice.
    pub fn pdo_assignment(self, sync_manager: u8) -> S::Outcome<Vec<PdoMapping>, SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { pdo::read_assignment(&mailbox, sync_manager, limits).await })
    }

    /// Reads the mapping of a PDO from the objects of the SubDevice.
    pub fn pdo_mapping(self, pdo: u16) -> S::Outcome<Vec<PdoEntry>, SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { pdo::read_mapping(&mailbox, pdo, limits).await })
    }

    /// Assigns PDOs to a SyncManager, and maps those with given entries. The SubDevice has to be in PREOP. The process
    /// data of a declaration follows its own assignment
    /// ([`SubDeviceConfig::assign`](crate::SubDeviceConfig::assign)).
    pub fn set_pdo_assignment(self, sync_manager: u8, pdos: Vec<PdoMapping>) -> S::Outcome<(), SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(
            move |mailbox| async move { pdo::write_assignment(&mailbox, sync_manager, &pdos, limits).await },
        )
    }

    /// Maps entries into a PDO that is not assigned. The SubDevice has to be in PREOP.
    pub fn set_pdo_mapping(self, pdo: u16, entries: Vec<PdoEntry>) -> S::Outcome<(), SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { pdo::write_mapping(&mailbox, pdo, &entries, limits).await })
    }

    /// Sends the data of an RxPDO by mailbox. It has no answer: a refusal is counted as an unclaimed error reply.
    pub fn pdo_send(self, pdo: u16, data: Vec<u8>) -> S::Outcome<(), SubDeviceError> {
        let limit = self.limits.request;
        self.ask_mailbox(move |mailbox| async move { pdo_mail::send(&mailbox, pdo, &data, limit).await })
    }

    /// Requests the data of a TxPDO by mailbox, or that of an RxPDO with its present value.
    pub fn pdo_receive(self, pdo: u16) -> S::Outcome<Vec<u8>, SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { pdo_mail::receive(&mailbox, pdo, limits).await })
    }
}
