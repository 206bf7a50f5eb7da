//! Services for the whole segment, and the four forms of all services of the acyclic half.
//!
//! Each service has four forms, by the value on which it is called. Services of a single SubDevice are methods of
//! [`SubDevice`](crate::SubDevice), which is created from the same values:
//!
//! | called on | form | the method returns |
//! |---|---|---|
//! | [`MainDevice`] | before activation; receives and sends until the end | `Result<T, Error>` |
//! | [`SupervisorThread`] | from any thread, before and during process data; waits for the end | `Result<T, Error>` |
//! | [`SupervisorThread::background`] | the same, without waiting | [`Job`]: wait, poll, or await it |
//! | [`Application`] in one thread | runs while cycles run | [`Pending`]: polled |

use std::time::Duration;

use ringcat_engine::Rescan;
use ringcat_engine::ServiceError;
use ringcat_engine::Statistics;
use ringcat_engine::SubDevicePorts;
use ringcat_engine::event::{ClientEvents, ClientId, EventsSince, LogFilter, MessagesSince, Subjects};
use ringcat_engine::info::SubDeviceInfo;
use ringcat_engine::main_device::snapshot::Snapshot;
use ringcat_engine::main_device::{
    Address, Function, LiveStatus, MainDevice as Engine, MainDevicePhase, MainDeviceRole, Pending, Permission,
    RawDatagram,
};
use ringcat_engine::request::{RegisterRequest, RetryRequest, SdoRequest, SoeRequest, VoeHandler};
use ringcat_engine::{BusError, Reply};
use ringcat_engine::{RingInspection, ScanError, inspect_ring};
use ringcat_engine::{StateScope, StatesError};
use ringcat_wire::al::AlState;

use crate::acyclic::Inline;
use crate::application::Application;
use crate::error::Error;
use crate::job::Job;
use crate::links::Links;
use crate::main_device::MainDevice;
use crate::supervisor_thread::SupervisorThread;
use key::EngineKey;

/// The key to the engine in [`Services`]. The module is private: applications have it with the feature `engine` only,
/// so without that they cannot reach the engine.
pub(crate) mod key {
    /// An argument of the functions of [`Services`](super::Services) that pass the engine to a closure.
    #[derive(Clone, Copy, Debug)]
    pub struct EngineKey;
}

/// The services of the acyclic half, in the thread of the cycles or in its own.
///
/// ```
/// use std::time::Duration;
/// use ringcat::{Error, Services, SubDeviceId, SupervisorThread};
///
/// /// Reads the identity of a SubDevice while the whole segment is scanned again in the background.
/// fn inspect(supervisor: &SupervisorThread, terminal: SubDeviceId) -> Result<(), Error> {
///     let rescan = supervisor.background().rescan(Duration::from_secs(2));
///     let vendor = supervisor.subdevice(terminal).sdo_read::<u32>(0x1018, 1)?;
///     println!("vendor {vendor:#010x}; absent: {:?}", rescan.finish()?.missing);
///     Ok(())
/// }
/// ```
pub trait Services: Sized {
    /// How the caller gets a service's result; `E` is the error of the service itself.
    type Outcome<T, E>;

    /// How the caller gets a result that needs no frame.
    type Immediate<T>;

    /// Starts an async function of the engine. All other services use this method. It takes a key that other crates
    /// have with the feature `engine` only (`ringcat::EngineKey`):
    ///
    /// ```compile_fail,E0603
    /// use ringcat::services::key::EngineKey;
    /// use ringcat::{MainDeviceRole, Services, SupervisorThread};
    ///
    /// fn role(supervisor: &SupervisorThread) -> Option<MainDeviceRole> {
    ///     supervisor.immediately(EngineKey, |engine| engine.role()).ok()
    /// }
    /// ```
    #[doc(hidden)]
    fn call<T, E>(
        self,
        key: EngineKey,
        start: impl FnOnce(&mut Engine) -> Pending<Result<T, E>> + Send + 'static,
    ) -> Self::Outcome<T, E>
    where
        T: Send + 'static,
        E: Send + 'static,
        Error: From<E>;

    /// Calls the engine for a result that needs no frame; as [`Services::call`], with the key.
    #[doc(hidden)]
    fn immediately<T: Send + 'static>(
        self,
        key: EngineKey,
        act: impl FnOnce(&mut Engine) -> T + Send + 'static,
    ) -> Self::Immediate<T>;

    /// Sends datagrams of the application at once, in one frame where they fit. Each one returns its data and working
    /// counter; a working counter of 0 is no error. More than [`MAX_DATAGRAMS`](crate::MAX_DATAGRAMS) are refused.
    fn datagrams(self, datagrams: Vec<RawDatagram>) -> Self::Outcome<Vec<Result<Reply, BusError>>, ServiceError> {
        self.call(EngineKey, move |engine| engine.start_datagrams(datagrams))
    }

    /// State of the segment, of the links and of each declared SubDevice, for real-time threads: a handle that can be
    /// copied to any thread. Before activation it contains no SubDevice.
    fn live_status(self) -> Self::Immediate<LiveStatus> {
        self.immediately(EngineKey, |engine| engine.live_status())
    }

    /// Opens all ports that [`SubDevice::block`](crate::SubDevice::block) has closed; the result is their number. A
    /// port of a neighbour that does not answer is kept for the next try.
    fn open_blocked(self) -> Self::Outcome<usize, ServiceError> {
        self.call(EngineKey, move |engine| engine.start_open_blocked())
    }

    /// Scans the whole segment again while process data continues, and returns the SubDevice at each position: which
    /// ones are new, have moved or are absent. New SubDevices are identified but not configured. A SubDevice that has
    /// moved is also reported by an event. The scan ends when the segment is stable and each SubDevice is identified,
    /// at the latest after `limit`. It fails when the segment keeps changing, or when the bus fails.
    ///
    /// Locations of breaks, CRC errors of cables and positions in events follow the new cabling from then on, unless
    /// the ring of two links is open or a mandatory SubDevice is absent.
    ///
    /// Without an application it needs [`Options::idle_operation`](crate::Options). SubDevices that did not change keep
    /// their states, mailboxes and transfers, and the result says what is different from the scan before.
    fn rescan(self, limit: Duration) -> Self::Outcome<Rescan, ServiceError> {
        self.call(EngineKey, move |engine| engine.start_rescan(limit))
    }

    /// Reads what the scan left out of the SIIs ([`Options::sii_extent`](crate::Options::sii_extent)): names and
    /// operation modes. Returns the SubDevices of the scan with all data, at once where nothing is missing. Without
    /// this call the rest is read in the background, after activation.
    fn complete_siis(self) -> Self::Outcome<Vec<SubDeviceInfo>, ServiceError> {
        self.call(EngineKey, |engine| engine.start_sii_completion())
    }

    /// Checks all SubDevices and searches for new ones now, as after a change of the segment. Returns false before
    /// activation, where [`MainDevice::scan`] does this.
    fn force_topology_change(self) -> Self::Immediate<bool> {
        self.immediately(EngineKey, move |engine| engine.force_topology_change())
    }

    /// Sets the period in which the error counters of all declared SubDevices are read in the background. `None`, the
    /// default, turns this off.
    fn set_statistics_period(self, period: Option<Duration>) -> Self::Immediate<()> {
        self.immediately(EngineKey, move |engine| engine.set_statistics_period(period))
    }

    /// The error counters of a declared SubDevice as they were last read. `None` before activation, and where the
    /// declaration has no such SubDevice.
    fn statistics(self, subdevice: impl Into<Address>) -> Self::Immediate<Option<Statistics>> {
        let subdevice = subdevice.into();
        self.immediately(EngineKey, move |engine| engine.statistics(subdevice))
    }

    /// The events from a number on ([`TimedEvent::number`](crate::TimedEvent)), also those that were fetched: for a
    /// client that was away. The last 4,096 events are kept; the number of missing ones is in the result, and the
    /// number to continue with. Another epoch means that the MainDevice began anew.
    fn events_since(self, number: u64) -> Self::Immediate<EventsSince> {
        self.immediately(EngineKey, move |engine| engine.events_since(number))
    }

    /// Registers a client of events with a queue of its own, of `size` events and with the subjects that it subscribes
    /// to. A client that does not fetch loses its own oldest events only. `None` if there are 64 clients.
    fn register_client(self, subjects: Subjects, size: usize) -> Self::Immediate<Option<ClientId>> {
        self.immediately(EngineKey, move |engine| engine.register_client(subjects, size))
    }

    /// Sets the subjects of a client's further events; false if there is no such client.
    fn set_client_subjects(self, client: ClientId, subjects: Subjects) -> Self::Immediate<bool> {
        self.immediately(EngineKey, move |engine| engine.set_client_subjects(client, subjects))
    }

    /// The events of a client since it fetched last, and how many it has missed; `None` if there is no such client.
    fn client_events(self, client: ClientId) -> Self::Immediate<Option<ClientEvents>> {
        self.immediately(EngineKey, move |engine| engine.take_client_events(client))
    }

    /// Removes a client of events; false if there is no such client.
    fn unregister_client(self, client: ClientId) -> Self::Immediate<bool> {
        self.immediately(EngineKey, move |engine| engine.unregister_client(client))
    }

    /// Sets which messages of the acyclic half are reported from now on, beside the events: the level (0 to 2, as
    /// `ethercat debug`) and the mask of subjects. It is level 0 at first, and stays over activations and stops. The
    /// cyclic half reports no messages.
    fn set_log_filter(self, filter: LogFilter) -> Self::Immediate<()> {
        self.immediately(EngineKey, move |engine| engine.set_log_filter(filter))
    }

    /// Which messages are reported.
    fn log_filter(self) -> Self::Immediate<LogFilter> {
        self.immediately(EngineKey, |engine| engine.log_filter())
    }

    /// The messages from a number on: the last 4,096 are kept, up to 1 MiB. The number of missing ones is in the
    /// result, and the number to continue with. [`text::message`](crate::text::message) has a line for each.
    fn messages_since(self, number: u64) -> Self::Immediate<MessagesSince> {
        self.immediately(EngineKey, move |engine| engine.messages_since(number))
    }

    /// Begins or ends events about single datagrams, cyclic and acyclic, with wrong working counters:
    /// [`Event::CyclicCommand`](crate::Event) and `AcyclicCommand`, at most one a second per command and address. They
    /// are off at first.
    fn set_command_reports(self, is_on: bool) -> Self::Immediate<()> {
        self.immediately(EngineKey, move |engine| engine.set_command_reports(is_on))
    }

    /// Sends a text in an Ethernet frame on each link: a mark in captures, up to the first SubDevice, which destroys it
    /// and counts an error; with bit 0 of DL_CONTROL cleared SubDevices pass it on, and what comes back is ignored. The
    /// EtherType is any but that of EtherCAT; 0x88B5 is free for such uses (IEEE 802). At most 1,500 bytes.
    fn debug_message(self, ethertype: u16, text: Vec<u8>) -> Self::Outcome<(), ServiceError> {
        self.call(EngineKey, move |engine| engine.start_debug_message(ethertype, &text))
    }

    /// The role of the MainDevice on the segment.
    fn role(self) -> Self::Immediate<MainDeviceRole> {
        self.immediately(EngineKey, |engine| engine.role())
    }

    /// Sets the role. [`MainDeviceRole::Inactive`] ends all that runs, and functions that need the bus are refused from
    /// then on ([`Function::needs_the_bus`]); with [`MainDeviceRole::Active`] the MainDevice continues with its
    /// knowledge ([`Engine::set_role`]).
    fn set_role(self, role: MainDeviceRole) -> Self::Immediate<()> {
        self.immediately(EngineKey, move |engine| engine.set_role(role))
    }

    /// Whether a function can be called in the present role and phase.
    fn permission(self, function: Function) -> Self::Immediate<Permission> {
        self.immediately(EngineKey, move |engine| engine.permission(function))
    }

    /// Reads the ports of all SubDevices, with and without an application: links, neighbours, delays, receive times,
    /// error counters. Empty before a scan.
    fn port_report(self) -> Self::Outcome<Vec<SubDevicePorts>, ServiceError> {
        self.call(EngineKey, |engine| engine.start_port_report())
    }

    /// State of the ring and error counters of its cables, without changing anything, as
    /// [`MainDevice::inspect_ring`](crate::MainDevice::inspect_ring).
    fn inspect_ring(self) -> Self::Outcome<RingInspection, ScanError> {
        self.call(EngineKey, |engine| {
            let bus = engine.bus();
            engine.start(inspect_ring(bus))
        })
    }

    /// Repeats the failed configuration of a SubDevice now, or of all, without a further pause. The result is false if
    /// there is no such SubDevice.
    fn retry(self, subdevice: Option<Address>) -> Self::Immediate<bool> {
        self.immediately(EngineKey, move |engine| engine.retry(subdevice))
    }

    /// Creates a request for another attempt of all failed configurations, which a cyclic thread starts while an
    /// application is active ([`Services::retry`] sends a message).
    fn create_retry_request(self) -> Self::Immediate<RetryRequest> {
        self.immediately(EngineKey, |engine| engine.create_retry_request())
    }

    /// Brings all SubDevices to INIT, PREOP, SAFEOP or OP and waits until they are there: while an application is
    /// active the declared ones, each at most to its declared state; otherwise those of the scan, with the defaults of
    /// their SIIs. The error names those that did not follow within `limit`, with their reasons. The state is kept.
    fn request_state_of_all(
        self,
        state: AlState,
        scope: StateScope,
        limit: Duration,
    ) -> Self::Outcome<(), StatesError> {
        self.call(EngineKey, move |engine| engine.start_state_of_all(state, scope, limit))
    }

    /// What the MainDevice does as a whole.
    fn phase(self) -> Self::Immediate<MainDevicePhase> {
        self.immediately(EngineKey, |engine| engine.phase())
    }

    /// The whole state of the MainDevice at one moment: SubDevices, ring, clocks, groups, counters, and the number of
    /// the next event. Later events have that number or a higher one.
    fn snapshot(self) -> Self::Immediate<Snapshot> {
        self.immediately(EngineKey, |engine| engine.snapshot())
    }

    /// Creates a request for objects of a SubDevice of up to `size` bytes, for use in the cyclic thread. It may be
    /// created before or after activation. A SubDevice without a declaration has a position, and answers with
    /// [`Options::idle_operation`](crate::Options) only.
    fn create_sdo_request(self, subdevice: impl Into<Address>, size: usize) -> Self::Immediate<SdoRequest> {
        let subdevice = subdevice.into();
        self.immediately(EngineKey, move |engine| engine.create_sdo_request(subdevice, size))
    }

    /// Creates a request for registers of a SubDevice; as [`Services::create_sdo_request`].
    fn create_register_request(self, subdevice: impl Into<Address>, size: usize) -> Self::Immediate<RegisterRequest> {
        let subdevice = subdevice.into();
        self.immediately(EngineKey, move |engine| engine.create_register_request(subdevice, size))
    }

    /// Creates a request for IDNs of a SubDevice; as [`Services::create_sdo_request`].
    fn create_soe_request(self, subdevice: impl Into<Address>, size: usize) -> Self::Immediate<SoeRequest> {
        let subdevice = subdevice.into();
        self.immediately(EngineKey, move |engine| engine.create_soe_request(subdevice, size))
    }

    /// Creates a handler of vendor messages of a SubDevice; as [`Services::create_sdo_request`].
    fn create_voe_handler(self, subdevice: impl Into<Address>, size: usize) -> Self::Immediate<VoeHandler> {
        let subdevice = subdevice.into();
        self.immediately(EngineKey, move |engine| engine.create_voe_handler(subdevice, size))
    }
}

/// Waits until the service has ended.
impl Services for &SupervisorThread {
    type Outcome<T, E> = Result<T, Error>;
    type Immediate<T> = Result<T, Error>;

    fn call<T, E>(
        self,
        _: EngineKey,
        start: impl FnOnce(&mut Engine) -> Pending<Result<T, E>> + Send + 'static,
    ) -> Result<T, Error>
    where
        T: Send + 'static,
        E: Send + 'static,
        Error: From<E>,
    {
        self.start_work(start).finish()
    }

    fn immediately<T: Send + 'static>(
        self,
        _: EngineKey,
        act: impl FnOnce(&mut Engine) -> T + Send + 'static,
    ) -> Result<T, Error> {
        self.act(act)
    }
}

/// Services that are not waited for: [`SupervisorThread::background`].
#[derive(Clone, Copy, Debug)]
pub struct Background<'a>(&'a SupervisorThread);

impl SupervisorThread {
    /// The same services without waiting: each returns a [`Job`].
    pub fn background(&self) -> Background<'_> {
        Background(self)
    }
}

/// Does not wait.
impl Services for Background<'_> {
    type Outcome<T, E> = Job<Result<T, E>>;
    type Immediate<T> = Result<T, Error>;

    fn call<T, E>(
        self,
        _: EngineKey,
        start: impl FnOnce(&mut Engine) -> Pending<Result<T, E>> + Send + 'static,
    ) -> Job<Result<T, E>>
    where
        T: Send + 'static,
        E: Send + 'static,
        Error: From<E>,
    {
        self.0.start_work(start)
    }

    fn immediately<T: Send + 'static>(
        self,
        _: EngineKey,
        act: impl FnOnce(&mut Engine) -> T + Send + 'static,
    ) -> Result<T, Error> {
        self.0.act(act)
    }
}

/// Receives and sends until the service has ended.
impl<L: Links> Services for &mut MainDevice<L> {
    type Outcome<T, E> = Result<T, Error>;
    type Immediate<T> = T;

    fn call<T, E>(
        self,
        _: EngineKey,
        start: impl FnOnce(&mut Engine) -> Pending<Result<T, E>> + Send + 'static,
    ) -> Result<T, Error>
    where
        T: Send + 'static,
        E: Send + 'static,
        Error: From<E>,
    {
        let work = start(&mut self.engine);
        Ok(self.finish(work)?)
    }

    fn immediately<T: Send + 'static>(self, _: EngineKey, act: impl FnOnce(&mut Engine) -> T + Send + 'static) -> T {
        act(&mut self.engine)
    }
}

/// Runs while cycles run.
impl<L: Links> Services for &mut Application<L, Inline> {
    type Outcome<T, E> = Pending<Result<T, E>>;
    type Immediate<T> = T;

    fn call<T, E>(
        self,
        _: EngineKey,
        start: impl FnOnce(&mut Engine) -> Pending<Result<T, E>> + Send + 'static,
    ) -> Pending<Result<T, E>>
    where
        T: Send + 'static,
        E: Send + 'static,
        Error: From<E>,
    {
        start(&mut self.acyclic.engine)
    }

    fn immediately<T: Send + 'static>(self, _: EngineKey, act: impl FnOnce(&mut Engine) -> T + Send + 'static) -> T {
        act(&mut self.acyclic.engine)
    }
}
