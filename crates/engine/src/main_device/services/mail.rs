//! Mailbox services of the MainDevice. Each starts a procedure; its result is fetched later.

use core::future::Future;

use ringcat_wire::al::AlState;

use crate::declared::{Address, SubDeviceId};
use crate::mail::{EmergencyRing, Mailbox};
use crate::main_device::MainDevice;
use crate::main_device::pending::Pending;
use crate::procedures::configure::ConfigureError;
use crate::procedures::request_state::request_state;
use crate::procedures::undeclared::request;
use crate::request::{RegisterRequest, RetryRequest, SdoRequest, SoeRequest, VoeHandler};
use crate::role::Function;
use crate::segment::Addressed;

impl MainDevice {
    /// Mailbox of a SubDevice. That of a SubDevice without a declaration is in use after
    /// [`MainDevice::start_state_request`] or idle operation has brought it to PREOP. `None` if there is no such
    /// SubDevice.
    pub fn mailbox(&self, subdevice: impl Into<Address>) -> Option<Mailbox> {
        let subdevice = self.segment.view().find(subdevice)?;
        self.segment.mailbox_of(subdevice)
    }

    /// Starts to bring one SubDevice to a state while all others continue.
    ///
    /// A declared one may be brought to any state, BOOT included. Its whole configuration is written again on the way
    /// up. The state is kept: a SubDevice that loses its power is brought back to it, an absent SubDevice is brought to
    /// it when it comes. If it refuses, it is brought back to the previous state. Without process data its working
    /// counters are not expected, and its inputs are not fresh.
    ///
    /// A state in which it is already changes nothing; start-up commands of a transition from a state to itself are
    /// sent then.
    ///
    /// One without a declaration goes through INIT: to PREOP or BOOT, where its mailbox can be used, to INIT, or to
    /// SAFEOP or OP with the defaults of its SII and without process data. With idle operation it is kept there.
    pub fn start_state_request(
        &mut self,
        subdevice: impl Into<Address>,
        state: AlState,
    ) -> Pending<Result<(), ConfigureError>> {
        if let Err(denied) = self.permit(Function::SubDeviceState) {
            return self.start(async move { Err(denied.into()) });
        }
        match self.find(subdevice) {
            Ok(Addressed::Member(index)) => {
                let requested = request_state(&self.segment, index, state);
                self.start(requested)
            }
            Ok(Addressed::Undeclared(key)) => {
                let requested = request(&self.segment, key, state);
                self.start(requested)
            }
            Err(_) => self.start(async { Err(ConfigureError::NoSetup) }),
        }
    }

    /// A request for objects of a SubDevice of up to `size` bytes, to be made from the cyclic thread once the
    /// MainDevice is active. It may be created before or after activation, and its address is resolved at each use; it
    /// ends when it is dropped.
    pub fn create_sdo_request(&mut self, subdevice: impl Into<Address>, size: usize) -> SdoRequest {
        let (request, served) = SdoRequest::new(subdevice.into(), size, self.requests.request_counter());
        self.requests.add(served);
        request
    }

    /// A request for registers of a SubDevice of up to `size` bytes; as [`MainDevice::create_sdo_request`].
    pub fn create_register_request(&mut self, subdevice: impl Into<Address>, size: usize) -> RegisterRequest {
        let (request, served) = RegisterRequest::new(subdevice.into(), size, self.requests.request_counter());
        self.requests.add(served);
        request
    }

    /// A request for IDNs of a SubDevice of up to `size` bytes; as [`MainDevice::create_sdo_request`].
    pub fn create_soe_request(&mut self, subdevice: impl Into<Address>, size: usize) -> SoeRequest {
        let (request, served) = SoeRequest::new(subdevice.into(), size, self.requests.request_counter());
        self.requests.add(served);
        request
    }

    /// A handler of vendor messages of a SubDevice of up to `size` bytes; as
    /// [`MainDevice::create_sdo_request`].
    pub fn create_voe_handler(&mut self, subdevice: impl Into<Address>, size: usize) -> VoeHandler {
        let (handler, served) = VoeHandler::new(subdevice.into(), size, self.requests.request_counter());
        self.requests.add(served);
        handler
    }

    /// A request for another attempt of failed configurations, while a declaration is active. [`MainDevice::retry`]
    /// needs the MainDevice itself.
    pub fn create_retry_request(&mut self) -> RetryRequest {
        self.requests.retry().clone()
    }

    /// The emergencies of a SubDevice, for any thread: by its index in the declaration, before or after activation, or
    /// by its position without a declaration. While a declaration is active, such a SubDevice has an open mailbox with
    /// idle operation only.
    ///
    /// A stop ends all ring buffers, a new scan those of positions: they keep what they hold, and get no further
    /// emergencies. The ring buffer of a position follows its SubDevice to another position; after a loss of power the
    /// next SubDevice at the position uses it.
    pub fn emergencies(&mut self, subdevice: impl Into<Address>) -> EmergencyRing {
        let subdevice = self.declared_or(subdevice);
        self.emergencies.borrow_mut().of(subdevice)
    }

    /// Keeps further emergencies of a SubDevice in a new ring of this size, at most [`EmergencyRing::MAX_SIZE`]. With
    /// a size of 0 they are only counted, and reported as events.
    pub fn create_emergency_ring(&mut self, subdevice: impl Into<Address>, size: usize) -> EmergencyRing {
        let subdevice = self.declared_or(subdevice);
        let ring = self.emergencies.borrow_mut().create(subdevice, size);
        if let Some(mailbox) = self.mailbox(subdevice) {
            mailbox.keep_emergencies_in(ring.clone());
        }
        ring
    }

    /// The index of a declared SubDevice, also if it is named by its position; otherwise the address as it is.
    fn declared_or(&self, subdevice: impl Into<Address>) -> Address {
        let subdevice = subdevice.into();
        match self.segment.view().find(subdevice) {
            Some(Addressed::Member(index)) => Address::Declared(SubDeviceId(index)),
            Some(Addressed::Undeclared(_)) | None => subdevice,
        }
    }

    /// A mailbox that is not in use yet, with the ring of its SubDevice.
    pub(in crate::main_device) fn new_mailbox(&mut self, subdevice: impl Into<Address>) -> Mailbox {
        let subdevice = subdevice.into();
        let mailbox = Mailbox::new(&self.supervisor.bus(), subdevice);
        mailbox.keep_emergencies_in(self.emergencies.borrow_mut().of(subdevice));
        mailbox
    }

    /// Starts a procedure of the application: any async function over a [`Mailbox`] or the bus.
    pub fn start<T: 'static>(&mut self, work: impl Future<Output = T> + 'static) -> Pending<T> {
        Pending::start(&self.supervisor.bus(), work)
    }
}
