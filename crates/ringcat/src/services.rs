//! What can be asked of the acyclic half: objects, states, registers, EEPROMs, ports, error counters, a look at the
//! segment.
//!
//! Each service is written once, as a method of [`Services`], and works in four forms:
//!
//! | called on | form | the method returns |
//! |---|---|---|
//! | [`MainDevice`] | before activation; receives and sends until the end | `Result<T, Error>` |
//! | [`SupervisorThread`] | from any thread, before and during process data; waits for the end | `Result<T, Error>` |
//! | [`SupervisorThread::background`] | the same, without waiting | [`Job`]: to wait for or poll, a future |
//! | [`Application`] in one thread | goes on while cycles go on | [`Pending`]: polled |
//!
//! SubDevices are named by their index in the declaration, before activation by their position in the scan.

use std::time::Duration;

use ringcat_engine::mail::coe::{self, SdoAddress};
use ringcat_engine::main_device::{MainDevice as Engine, Pending, RawDatagram};
use ringcat_engine::procedures::configure::ConfigureError;
use ringcat_engine::procedures::services::ServiceError;
use ringcat_engine::procedures::services::ports::BlockedPort;
use ringcat_engine::procedures::services::statistics::Statistics;
use ringcat_engine::procedures::sii::program::SiiWritten;
use ringcat_engine::procedures::unassigned::rescan::Rescan;
use ringcat_engine::request::{RegisterRequest, SdoRequest, SoeRequest, VoeHandler};
use ringcat_engine::supervisor::{BusError, Reply};
use ringcat_wire::address::RegisterAddress;
use ringcat_wire::al::AlState;
use ringcat_wire::register::LoopControl;

use crate::acyclic::Inline;
use crate::application::Application;
use crate::error::Error;
use crate::job::Job;
use crate::limits::TransferLimits;
use crate::links::Links;
use crate::main_device::MainDevice;
use crate::subdevice::{Address, Opening, SubDeviceError, start_with_mailbox};
use crate::supervisor_thread::SupervisorThread;

/// The services of the acyclic half, wherever it runs.
///
/// ```
/// use ringcat::{Error, SdoAddress, Services, SupervisorThread, TransferLimits};
///
/// /// Reads one object, and another one in the background meanwhile.
/// fn identity(supervisor: &SupervisorThread, limits: TransferLimits) -> Result<(Vec<u8>, Vec<u8>), Error> {
///     let name = supervisor.background().sdo_upload(1, SdoAddress::new(0x1008, 0), limits.bytes(64));
///     let vendor = supervisor.sdo_upload(1, SdoAddress::new(0x1018, 1), limits.bytes(4))?;
///     Ok((name.finish()?, vendor))
/// }
/// ```
pub trait Services: Sized {
    /// How a service comes to its end; with this error where it fails itself.
    type Outcome<T, E>;

    /// How something comes back that takes no time on the bus.
    type Immediate<T>;

    /// Starts work of the engine. What every other service is made of.
    fn call<T, E>(
        self,
        start: impl FnOnce(&mut Engine) -> Pending<Result<T, E>> + Send + 'static,
    ) -> Self::Outcome<T, E>
    where
        T: Send + 'static,
        E: Send + 'static,
        Error: From<E>;

    /// Does something with the engine that takes no time on the bus.
    fn immediately<T: Send + 'static>(self, act: impl FnOnce(&mut Engine) -> T + Send + 'static) -> Self::Immediate<T>;

    /// Reads an object, by the SubDevice's mailbox in PREOP, SAFEOP or OP. [`SubDevice`](crate::SubDevice) has this and
    /// the other protocols with types.
    ///
    /// It fails before a scan, for a SubDevice that is not there or not declared, and for one without a mailbox, each
    /// with an error of its own.
    fn sdo_upload(
        self,
        subdevice: usize,
        object: SdoAddress,
        limits: TransferLimits,
    ) -> Self::Outcome<Vec<u8>, SubDeviceError> {
        let work = move |mailbox| async move { coe::read(&mailbox, object, limits.of_message(), limits.bytes).await };
        self.call(move |engine| {
            let address = Address::of_number(engine, subdevice);
            start_with_mailbox(engine, address, Opening::LeftAlone, None, work)
        })
    }

    /// Writes an object; as [`Services::sdo_upload`].
    fn sdo_download(
        self,
        subdevice: usize,
        object: SdoAddress,
        data: Vec<u8>,
        limits: TransferLimits,
    ) -> Self::Outcome<(), SubDeviceError> {
        let work = move |mailbox| async move { coe::write(&mailbox, object, &data, limits.of_message()).await };
        self.call(move |engine| {
            let address = Address::of_number(engine, subdevice);
            start_with_mailbox(engine, address, Opening::LeftAlone, None, work)
        })
    }

    /// Before activation: brings a scanned SubDevice to PREOP, BOOT or back to INIT; in PREOP and BOOT its mailbox may
    /// be used. It fails where there is no mailbox for that state, or the SubDevice refuses or does not answer.
    fn bring_to(self, position: usize, state: AlState) -> Self::Outcome<(), ConfigureError> {
        self.call(move |engine| engine.start_visit(position, state))
    }

    /// Brings one declared SubDevice to a state while the others go on: INIT, PREOP, BOOT for new firmware, SAFEOP, OP.
    /// Its configuration is written again on the way up. The state is kept, also over a loss of power; a SubDevice that
    /// refuses is brought back to the state before. No working counter waits for one without process data, and its
    /// inputs are not fresh.
    fn request_state(self, subdevice: usize, state: AlState) -> Self::Outcome<(), ConfigureError> {
        self.call(move |engine| engine.start_state_request(subdevice, state))
    }

    /// Reads `length` bytes of registers or memory of a SubDevice.
    fn register_read(
        self,
        subdevice: usize,
        address: RegisterAddress,
        length: usize,
    ) -> Self::Outcome<Vec<u8>, ServiceError> {
        self.call(move |engine| engine.start_register_read(subdevice, address, length))
    }

    /// Writes registers or memory of a SubDevice. Where a frame is lost, a register may be written twice.
    fn register_write(
        self,
        subdevice: usize,
        address: RegisterAddress,
        data: Vec<u8>,
    ) -> Self::Outcome<(), ServiceError> {
        self.call(move |engine| engine.start_register_write(subdevice, address, data))
    }

    /// Sends datagrams of the application's own at once, in one frame where they fit. Each brings its answer, whatever
    /// its working counter. More than [`MAX_DATAGRAMS`](crate::MAX_DATAGRAMS) are refused.
    fn datagrams(self, datagrams: Vec<RawDatagram>) -> Self::Outcome<Vec<Result<Reply, BusError>>, ServiceError> {
        self.call(move |engine| engine.start_datagrams(datagrams))
    }

    /// What a port does about its loop.
    fn port(self, subdevice: usize, port: u8) -> Self::Outcome<LoopControl, ServiceError> {
        self.call(move |engine| engine.start_port_read(subdevice, port))
    }

    /// Opens or closes a port. SubDevices behind one that is closed get no frames.
    fn set_port(self, subdevice: usize, port: u8, control: LoopControl) -> Self::Outcome<(), ServiceError> {
        self.call(move |engine| engine.start_port_set(subdevice, port, control))
    }

    /// Cuts a declared SubDevice off by closing the ports of its neighbours. In a line those behind it go with it. One
    /// at the main link itself cannot be cut off.
    fn block(self, subdevice: usize) -> Self::Outcome<Vec<BlockedPort>, ServiceError> {
        self.call(move |engine| engine.start_block(subdevice))
    }

    /// Opens all ports that [`Services::block`] has closed; the result is how many there were. A port of a neighbour
    /// that does not answer is kept for the next try.
    fn open_blocked(self) -> Self::Outcome<usize, ServiceError> {
        self.call(move |engine| engine.start_open_blocked())
    }

    /// Resets a SubDevice controller. A declared SubDevice is lost and found again, and configured anew.
    fn reset_controller(self, subdevice: usize) -> Self::Outcome<(), ServiceError> {
        self.call(move |engine| engine.start_reset(subdevice))
    }

    /// Looks at the whole segment again while process data goes on: which SubDevice is at which place now, which are
    /// new, have moved or are gone. New ones are read, but left alone; those that have moved are events, too. It ends
    /// when the segment holds still and every SubDevice is known, after `limit` at the latest. It fails where nothing
    /// is declared yet, the segment does not hold still, or the bus fails.
    ///
    /// Places of breaks, errors of cables and positions in events go by the new cabling from then on, unless the ring
    /// of two links is open or a mandatory SubDevice does not answer.
    fn rescan(self, limit: Duration) -> Self::Outcome<Rescan, ServiceError> {
        self.call(move |engine| engine.start_rescan(limit))
    }

    /// Reads an EEPROM, as large as it says that it is.
    fn sii_read(self, subdevice: usize) -> Self::Outcome<Vec<u8>, ServiceError> {
        self.call(move |engine| engine.start_sii_read(subdevice))
    }

    /// Writes an EEPROM: each word that is not right already, and reads it back. What is no SII image is refused unless
    /// `force` says so. Most of it counts from the SubDevice's next start on.
    fn sii_write(self, subdevice: usize, image: Vec<u8>, force: bool) -> Self::Outcome<SiiWritten, ServiceError> {
        self.call(move |engine| engine.start_sii_write(subdevice, image, force))
    }

    /// Writes the alias into the EEPROM, with the checksum that belongs to it; one that is wrong already is made right
    /// only with `force`. The alias counts from the SubDevice's next start on.
    fn write_alias(self, subdevice: usize, alias: u16, force: bool) -> Self::Outcome<SiiWritten, ServiceError> {
        self.call(move |engine| engine.start_alias_write(subdevice, alias, force))
    }

    /// Has a controller load its configuration from the EEPROM again. It refuses a wrong checksum.
    fn sii_reload(self, subdevice: usize) -> Self::Outcome<(), ServiceError> {
        self.call(move |engine| engine.start_sii_reload(subdevice))
    }

    /// Reads the error counters of a declared SubDevice now.
    fn read_statistics(self, subdevice: usize) -> Self::Outcome<Statistics, ServiceError> {
        self.call(move |engine| engine.start_statistics_read(subdevice))
    }

    /// Clears the error counters of a declared SubDevice, and what was kept of them.
    fn clear_statistics(self, subdevice: usize) -> Self::Outcome<(), ServiceError> {
        self.call(move |engine| engine.start_statistics_clear(subdevice))
    }

    /// Has all SubDevices looked at now, and new ones looked for, as if the segment had changed. False before
    /// activation: there a scan looks.
    fn force_topology_change(self) -> Self::Immediate<bool> {
        self.immediately(move |engine| engine.force_topology_change())
    }

    /// Sets how often the error counters of all declared SubDevices are read in the background; `None`, as at the
    /// beginning, is never.
    fn set_statistics_period(self, period: Option<Duration>) -> Self::Immediate<()> {
        self.immediately(move |engine| engine.set_statistics_period(period))
    }

    /// What a declared SubDevice has counted, as far as it was read. `None` before activation.
    fn statistics(self, subdevice: usize) -> Self::Immediate<Option<Statistics>> {
        self.immediately(move |engine| engine.statistics(subdevice))
    }

    /// A request for objects of a declared SubDevice of up to `size` bytes, to be made from the cyclic thread. It may
    /// be created before or after activation.
    fn create_sdo_request(self, subdevice: usize, size: usize) -> Self::Immediate<SdoRequest> {
        self.immediately(move |engine| engine.create_sdo_request(subdevice, size))
    }

    /// A request for registers of a declared SubDevice; as [`Services::create_sdo_request`].
    fn create_register_request(self, subdevice: usize, size: usize) -> Self::Immediate<RegisterRequest> {
        self.immediately(move |engine| engine.create_register_request(subdevice, size))
    }

    /// A request for IDNs of a declared SubDevice; as [`Services::create_sdo_request`].
    fn create_soe_request(self, subdevice: usize, size: usize) -> Self::Immediate<SoeRequest> {
        self.immediately(move |engine| engine.create_soe_request(subdevice, size))
    }

    /// A handler of vendor messages of a declared SubDevice; as [`Services::create_sdo_request`].
    fn create_voe_handler(self, subdevice: usize, size: usize) -> Self::Immediate<VoeHandler> {
        self.immediately(move |engine| engine.create_voe_handler(subdevice, size))
    }
}

/// Waits for the end.
impl Services for &SupervisorThread {
    type Outcome<T, E> = Result<T, Error>;
    type Immediate<T> = Result<T, Error>;

    fn call<T, E>(self, start: impl FnOnce(&mut Engine) -> Pending<Result<T, E>> + Send + 'static) -> Result<T, Error>
    where
        T: Send + 'static,
        E: Send + 'static,
        Error: From<E>,
    {
        self.start_work(start).finish()
    }

    fn immediately<T: Send + 'static>(self, act: impl FnOnce(&mut Engine) -> T + Send + 'static) -> Result<T, Error> {
        self.with(act)
    }
}

/// Services that are not waited for: [`SupervisorThread::background`].
#[derive(Clone, Copy, Debug)]
pub struct Background<'a>(&'a SupervisorThread);

impl SupervisorThread {
    /// The same services, each as a [`Job`] that goes on while the caller does something else.
    pub fn background(&self) -> Background<'_> {
        Background(self)
    }
}

/// Does not wait for the end.
impl Services for Background<'_> {
    type Outcome<T, E> = Job<Result<T, E>>;
    type Immediate<T> = Result<T, Error>;

    fn call<T, E>(self, start: impl FnOnce(&mut Engine) -> Pending<Result<T, E>> + Send + 'static) -> Job<Result<T, E>>
    where
        T: Send + 'static,
        E: Send + 'static,
        Error: From<E>,
    {
        self.0.start_work(start)
    }

    fn immediately<T: Send + 'static>(self, act: impl FnOnce(&mut Engine) -> T + Send + 'static) -> Result<T, Error> {
        self.0.with(act)
    }
}

/// Receives and sends until the end.
impl<L: Links> Services for &mut MainDevice<L> {
    type Outcome<T, E> = Result<T, Error>;
    type Immediate<T> = T;

    fn call<T, E>(self, start: impl FnOnce(&mut Engine) -> Pending<Result<T, E>> + Send + 'static) -> Result<T, Error>
    where
        T: Send + 'static,
        E: Send + 'static,
        Error: From<E>,
    {
        let work = start(self.engine_mut());
        Ok(self.finish(work)?)
    }

    fn immediately<T: Send + 'static>(self, act: impl FnOnce(&mut Engine) -> T + Send + 'static) -> T {
        act(self.engine_mut())
    }
}

/// Goes on while cycles go on.
impl<L: Links> Services for &mut Application<L, Inline> {
    type Outcome<T, E> = Pending<Result<T, E>>;
    type Immediate<T> = T;

    fn call<T, E>(
        self,
        start: impl FnOnce(&mut Engine) -> Pending<Result<T, E>> + Send + 'static,
    ) -> Pending<Result<T, E>>
    where
        T: Send + 'static,
        E: Send + 'static,
        Error: From<E>,
    {
        start(self.engine_mut())
    }

    fn immediately<T: Send + 'static>(self, act: impl FnOnce(&mut Engine) -> T + Send + 'static) -> T {
        act(self.engine_mut())
    }
}
