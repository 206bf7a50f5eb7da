//! Mailbox services of a MainDevice whose acyclic half has a thread of its own, from any thread, before and during
//! process data: objects, files, and whatever else the engine's async functions do.

use std::future::Future;

use ringcat_engine::mail::Limits;
use ringcat_engine::mail::coe::SdoAddress;
use ringcat_engine::main_device::{MainDevice as Engine, Pending};
use ringcat_engine::request::{RegisterRequest, SdoRequest, SoeRequest, VoeHandler};
use ringcat_wire::al::AlState;

use crate::error::Error;
use crate::supervisor_thread::SupervisorThread;

impl SupervisorThread {
    /// Runs an async function of the engine in the thread and waits for its end: `make` gets the engine, whose mailboxes
    /// it may take. SubDevices are named by their index in the declaration, before activation by their position.
    ///
    /// # Errors
    /// The thread is gone, or the MainDevice was stopped meanwhile.
    pub fn run<T, W>(&self, make: impl FnOnce(&mut Engine) -> W + Send + 'static) -> Result<T, Error>
    where
        T: Send + 'static,
        W: Future<Output = T> + 'static,
    {
        self.wait_for(move |engine| {
            let work = make(engine);
            engine.start(work)
        })
    }

    /// Starts work in the thread, where it stays, and waits for its end.
    pub(crate) fn wait_for<T: Send + 'static>(
        &self,
        start: impl FnOnce(&mut Engine) -> Pending<T> + Send + 'static,
    ) -> Result<T, Error> {
        let ticket = self.with(move |engine| {
            let pending = start(engine);
            engine.park(pending)
        })?;
        self.ask(move |engine, _| engine.collect(&ticket))?.ok_or(Error::Gone)
    }

    /// Reads an object of at most `limit` bytes. The time limits are: until the mailbox takes a message, until its answer
    /// is there.
    ///
    /// # Errors
    /// The transfer fails, or as [`SupervisorThread::run`].
    pub fn sdo_upload(
        &self,
        subdevice: usize,
        object: SdoAddress,
        limits: Limits,
        limit: usize,
    ) -> Result<Vec<u8>, Error> {
        Ok(self.wait_for(move |engine| engine.start_sdo_upload(subdevice, object, limits, limit))??)
    }

    /// Writes an object; as [`SupervisorThread::sdo_upload`].
    ///
    /// # Errors
    /// As [`SupervisorThread::sdo_upload`].
    pub fn sdo_download(
        &self,
        subdevice: usize,
        object: SdoAddress,
        data: Vec<u8>,
        limits: Limits,
    ) -> Result<(), Error> {
        Ok(self.wait_for(move |engine| engine.start_sdo_download(subdevice, object, data, limits))??)
    }

    /// Before activation: brings a scanned SubDevice to PREOP, BOOT or back to INIT; in PREOP and BOOT its mailbox may be
    /// used.
    ///
    /// # Errors
    /// It has no mailbox for that state, refuses, or does not answer; or as [`SupervisorThread::run`].
    pub fn bring_to(&self, position: usize, state: AlState) -> Result<(), Error> {
        Ok(self.wait_for(move |engine| engine.start_visit(position, state))??)
    }

    /// A request for objects of a declared SubDevice of up to `size` bytes, to be made from the cyclic thread. It may be
    /// created before or after activation.
    ///
    /// # Errors
    /// The thread is gone.
    pub fn create_sdo_request(&self, subdevice: usize, size: usize) -> Result<SdoRequest, Error> {
        self.with(move |engine| engine.create_sdo_request(subdevice, size))
    }

    /// A request for registers of a declared SubDevice; as [`SupervisorThread::create_sdo_request`].
    ///
    /// # Errors
    /// The thread is gone.
    pub fn create_register_request(&self, subdevice: usize, size: usize) -> Result<RegisterRequest, Error> {
        self.with(move |engine| engine.create_register_request(subdevice, size))
    }

    /// A request for IDNs of a declared SubDevice; as [`SupervisorThread::create_sdo_request`].
    ///
    /// # Errors
    /// The thread is gone.
    pub fn create_soe_request(&self, subdevice: usize, size: usize) -> Result<SoeRequest, Error> {
        self.with(move |engine| engine.create_soe_request(subdevice, size))
    }

    /// A handler of vendor messages of a declared SubDevice; as [`SupervisorThread::create_sdo_request`].
    ///
    /// # Errors
    /// The thread is gone.
    pub fn create_voe_handler(&self, subdevice: usize, size: usize) -> Result<VoeHandler, Error> {
        self.with(move |engine| engine.create_voe_handler(subdevice, size))
    }
}
