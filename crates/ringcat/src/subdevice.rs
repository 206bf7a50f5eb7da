//! Services of one SubDevice.
//!
//! One of four values creates a [`SubDevice`], and determines the form of all its methods (see [`Services`]):
//!
//! | created by | form | a method returns |
//! |---|---|---|
//! | [`MainDevice::subdevice`] | before activation, by position; waits for the end | `Result<T, Error>` |
//! | [`SupervisorThread::subdevice`] | from any thread; waits for the end | `Result<T, Error>` |
//! | [`Background::subdevice`] | from any thread, without waiting | [`Job`](crate::Job): a future |
//! | [`Application::subdevice`] in one thread | runs while cycles run | [`Pending`](crate::Pending): polled |
//!
//! A [`SubDevice`] of a supervisor thread can be copied and used repeatedly. In one thread it borrows the application,
//! so create it for each use: `application.subdevice(drive).sdo_read::<u32>(0x6064, 0)`.

mod bus;
mod emergencies;
mod error;
mod ethernet;
mod files;
mod mail;
mod name;
mod objects;
mod pdos;
mod protocols;
mod resolve;
mod start;

use std::future::Future;
use std::time::Duration;

use ringcat_engine::mail::Mailbox;
use ringcat_engine::mail::coe::ObjectDictionary;
use ringcat_engine::mail::coe::information::InformationError;
use ringcat_engine::main_device::{Address, MainDevice as Engine, SubDeviceId};
use ringcat_wire::address::Position;

pub use error::{SubDeviceError, SubDeviceFailure};
pub use mail::MailboxStatus;
pub use name::SubDeviceName;
pub use objects::ListLengths;
use start::{start, start_with_mailbox};

use crate::acyclic::Inline;
use crate::application::Application;
use crate::limits::TransferLimits;
use crate::links::Links;
use crate::main_device::MainDevice;
use crate::services::key::EngineKey;
use crate::services::{Background, Services};
use crate::supervisor_thread::SupervisorThread;

/// One SubDevice: its objects, files, registers, states. `S` determines how a method returns its result.
///
/// ```
/// use ringcat::{Error, SubDeviceId, SupervisorThread};
///
/// /// Both at once: the second is read while the first is on its way.
/// fn actual_values(supervisor: &SupervisorThread, drive: SubDeviceId) -> Result<(i32, i32), Error> {
///     let velocity = supervisor.background().subdevice(drive).sdo_read::<i32>(0x606C, 0);
///     let position = supervisor.subdevice(drive).sdo_read::<i32>(0x6064, 0)?;
///     Ok((position, velocity.finish()?))
/// }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct SubDevice<S> {
    services: S,
    address: Address,
    limits: TransferLimits,
    within: Option<Duration>,
}

impl<S: Services> SubDevice<S> {
    /// The services of a SubDevice, in the form of `services`.
    pub fn new(services: S, address: impl Into<Address>) -> SubDevice<S> {
        SubDevice { services, address: address.into(), limits: TransferLimits::default(), within: None }
    }

    /// Sets the limits for the messages of a transfer.
    #[must_use]
    pub fn limits(mut self, limits: TransferLimits) -> SubDevice<S> {
        self.limits = limits;
        self
    }

    /// Sets a limit for a whole service. At the limit the service is cancelled, also at the SubDevice if the protocol
    /// permits it. Without this limit only single messages have limits.
    #[must_use]
    pub fn within(mut self, limit: Duration) -> SubDevice<S> {
        self.within = Some(limit);
        self
    }

    /// The address with which it was created.
    pub fn address(&self) -> Address {
        self.address
    }

    /// The address and the services.
    pub(crate) fn into_parts(self) -> (Address, S) {
        (self.address, self.services)
    }

    /// Starts a service in the engine.
    fn ask<T, E, W>(
        self,
        work: impl FnOnce(&mut Engine, Address) -> W + Send + 'static,
    ) -> S::Outcome<T, SubDeviceError>
    where
        T: Send + 'static,
        SubDeviceFailure: From<E>,
        W: Future<Output = Result<T, E>> + 'static,
    {
        let SubDevice { services, address, within, .. } = self;
        services.call(EngineKey, move |engine| start(engine, address, within, move |engine| work(engine, address)))
    }

    /// Starts a service of the SubDevice's mailbox. Before activation, a SubDevice in INIT is brought to PREOP.
    fn ask_mailbox<T, E, W>(self, work: impl FnOnce(Mailbox) -> W + Send + 'static) -> S::Outcome<T, SubDeviceError>
    where
        T: Send + 'static,
        SubDeviceFailure: From<E>,
        W: Future<Output = Result<T, E>> + 'static,
    {
        let SubDevice { services, address, within, .. } = self;
        services.call(EngineKey, move |engine| start_with_mailbox(engine, address, within, work))
    }

    /// Starts a service of the SubDevice's object dictionary.
    fn ask_dictionary<T, W>(
        self,
        work: impl FnOnce(ObjectDictionary) -> W + Send + 'static,
    ) -> S::Outcome<T, SubDeviceError>
    where
        T: Send + 'static,
        W: Future<Output = Result<T, InformationError>> + 'static,
    {
        let SubDevice { services, address, within, .. } = self;
        services.call(EngineKey, move |engine| {
            let (known, identity) = (engine.dictionaries(), engine.identity(address));
            start_with_mailbox(engine, address, within, move |mailbox| work(known.of(&mailbox, identity)))
        })
    }
}

impl<L: Links> MainDevice<L> {
    /// A SubDevice of the scan, by its position. One in INIT is brought to PREOP before its mailbox is used.
    pub fn subdevice(&mut self, position: Position) -> SubDevice<&mut MainDevice<L>> {
        SubDevice::new(self, position)
    }
}

impl<L: Links> Application<L, Inline> {
    /// A declared SubDevice; its services run while cycles run.
    pub fn subdevice(&mut self, subdevice: SubDeviceId) -> SubDevice<&mut Application<L, Inline>> {
        SubDevice::new(self, subdevice)
    }
}

impl SupervisorThread {
    /// A SubDevice: by its [`SubDeviceId`] in the declaration, before activation by its [`Position`].
    pub fn subdevice(&self, address: impl Into<Address>) -> SubDevice<&SupervisorThread> {
        SubDevice::new(self, address)
    }
}

impl<'a> Background<'a> {
    /// A SubDevice with services that do not wait; as [`SupervisorThread::subdevice`].
    pub fn subdevice(self, address: impl Into<Address>) -> SubDevice<Background<'a>> {
        SubDevice::new(self, address)
    }
}
