//! Objects of SubDevices before activation: one in INIT is brought to PREOP first.

use ringcat_engine::mail::coe::SdoAddress;
use ringcat_wire::al::AlState;

use crate::error::Error;
use crate::limits::TransferLimits;
use crate::links::Links;
use crate::main_device::MainDevice;
use crate::services::Services;

impl<L: Links> MainDevice<L> {
    /// Reads an object of a scanned SubDevice; one in INIT is brought to PREOP before.
    ///
    /// # Errors
    /// The SubDevice does not reach PREOP, or the transfer fails.
    pub fn sdo_upload(
        &mut self,
        position: usize,
        object: SdoAddress,
        limits: TransferLimits,
    ) -> Result<Vec<u8>, Error> {
        self.visit(position)?;
        Services::sdo_upload(self, position, object, limits)
    }

    /// Writes an object of a scanned SubDevice; as [`MainDevice::sdo_upload`].
    ///
    /// # Errors
    /// As [`MainDevice::sdo_upload`].
    pub fn sdo_download(
        &mut self,
        position: usize,
        object: SdoAddress,
        data: &[u8],
        limits: TransferLimits,
    ) -> Result<(), Error> {
        self.visit(position)?;
        Services::sdo_download(self, position, object, data.to_vec(), limits)
    }

    fn visit(&mut self, position: usize) -> Result<(), Error> {
        if self.mailbox(position).is_some_and(|mailbox| mailbox.is_open()) {
            return Ok(());
        }
        self.bring_to(position, AlState::PreOp)
    }
}
