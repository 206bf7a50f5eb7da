//! Mailbox services of the MainDevice, started and asked for their results later.

use alloc::vec::Vec;
use core::future::Future;

use super::MainDevice;
use super::pending::Pending;
use crate::mail::coe::{self, SdoAddress, SdoError, SdoFailure};
use crate::mail::{Limits, Mailbox, MailboxError};

impl MainDevice {
    /// Mailbox of a SubDevice: by its index in the declaration. `None` where there is no such one.
    pub fn mailbox(&self, subdevice: usize) -> Option<Mailbox> {
        self.fleet.as_ref()?.mailbox(subdevice)
    }

    /// Starts work of the application's own: any async function over a [`Mailbox`] or the bus.
    pub fn start<T: 'static>(&mut self, work: impl Future<Output = T> + 'static) -> Pending<T> {
        Pending::start(&self.supervisor.bus(), work)
    }

    /// Starts to read an object of at most `limit` bytes.
    pub fn start_sdo_upload(
        &mut self,
        subdevice: usize,
        object: SdoAddress,
        limits: Limits,
        limit: usize,
    ) -> Pending<Result<Vec<u8>, SdoError>> {
        let mailbox = self.mailbox(subdevice);
        self.start(async move {
            match mailbox {
                Some(mailbox) => coe::read(&mailbox, object, limits, limit).await,
                None => Err(closed(object)),
            }
        })
    }

    /// Starts to write an object.
    pub fn start_sdo_download(
        &mut self,
        subdevice: usize,
        object: SdoAddress,
        data: Vec<u8>,
        limits: Limits,
    ) -> Pending<Result<(), SdoError>> {
        let mailbox = self.mailbox(subdevice);
        self.start(async move {
            match mailbox {
                Some(mailbox) => coe::write(&mailbox, object, &data, limits).await,
                None => Err(closed(object)),
            }
        })
    }
}

fn closed(object: SdoAddress) -> SdoError {
    SdoError { object, cause: SdoFailure::Mailbox(MailboxError::Closed) }
}
