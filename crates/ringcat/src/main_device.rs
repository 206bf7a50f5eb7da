//! A MainDevice with its links, before activation.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use ringcat_engine::config::SubDeviceConfig;
use ringcat_engine::domain::DomainId;
use ringcat_engine::event::TimedEvent;
use ringcat_engine::info::{SiiExtent, SubDeviceInfo};
use ringcat_engine::knowledge::{Handover, Knowledge};
use ringcat_engine::link::Link;
use ringcat_engine::main_device::{
    ActivateError, Declaration, MainDevice as Engine, Options as Engineering, Pending, Retries,
};
use ringcat_engine::time::Instant;
use ringcat_engine::{AcyclicCounters, ReadPdos, RingInspection, Scan, inspect_ring};
use ringcat_engine::{JunctionConnection, JunctionMode};
use ringcat_wire::source_address::MacCodec;

use crate::acyclic::{Inline, carry_out_link_order, log_messages};
use crate::application::Application;
use crate::error::Error;
use crate::links::{Links, PerLink};
use crate::window::{DEFAULT_BUDGET, Window};

/// Options of a MainDevice. The MAC addresses come from the links.
///
/// ```
/// use std::time::Duration;
/// use ringcat::Options;
///
/// let options = Options::default().with_patience(Duration::from_secs(20)).with_max_datagrams_per_frame(15);
/// assert!(options.supervision);
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Options {
    /// Whether SII contents are kept and used for SubDevices with the same first 64 words.
    pub sii_cache: bool,
    /// How much of each SII a scan reads. `None`, the default: all of it in [`MainDevice::scan`], what operation needs
    /// in [`MainDevice::bring_up`]. The less, the sooner SubDevices are in OP; the rest is read in the background
    /// afterwards, or by [`Services::complete_siis`](crate::Services::complete_siis) when it is needed.
    pub sii_extent: Option<SiiExtent>,
    /// Dictionaries read for PDOs. `None`: [`ReadPdos::Missing`], in PREOP with idle operation [`ReadPdos::Always`].
    pub pdos: Option<ReadPdos>,
    /// Whether a supervision datagram is sent with the process data. Without it changes of the segment are not detected
    /// automatically.
    pub supervision: bool,
    /// How marks are written into source addresses (protocol 9.7.1).
    pub source_address: MacCodec,
    /// Time for which the number of SubDevices must be unchanged at the beginning of a scan.
    pub settle: Duration,
    /// Maximum wait of a scan for the first SubDevice.
    pub patience: Duration,
    /// Handling of rings behind junctions. An added connection makes it strict.
    pub junctions: JunctionMode,
    /// Whether the cabling is scanned again, as by [`Services::rescan`](crate::Services::rescan), when a hot connect
    /// group has joined or left, as soon as nothing is broken. Positions, places of breaks and errors of cables then
    /// follow the present segment; otherwise a group has no position until a rescan is requested.
    pub follow_groups: bool,
    /// Whether the redundant link may be taken down for a moment, when ports have changed, to locate a crossed line
    /// ([`Links::force_disconnect`]). Otherwise a closed ring shows only that a line is crossed.
    pub enhanced_line_crossed: bool,
    /// Whether the MainDevice works on its segment without an application, too, and on SubDevices without a
    /// declaration: it scans by itself, follows changes, and keeps all of them in PREOP with their mailboxes. Services
    /// take positions at any time then. In one thread it works while one of its methods runs ([`MainDevice::attend`]).
    pub idle_operation: bool,
    /// What follows a failed configuration of a SubDevice.
    pub retries: Retries,
    /// Maximum number of datagrams in a frame, cyclic and acyclic; `None`: as many as fit. Some gateways and simulators
    /// accept fewer (often 15): the scan then fails with [`ScanError::FrameLimit`](crate::ScanError). Values below 3
    /// are raised to 3.
    pub max_datagrams_per_frame: Option<u16>,
    /// Maximum number of bytes per cycle and link for everything but process data. The limit never exceeds the wire
    /// time that process data leaves free in the cycle, and is at least one longest frame. SubDevices share it fairly.
    pub acyclic_bytes: usize,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            sii_cache: true,
            sii_extent: None,
            pdos: None,
            supervision: true,
            source_address: MacCodec::FlagsFirst,
            settle: Duration::from_millis(5),
            patience: Duration::from_secs(5),
            junctions: JunctionMode::Disabled,
            follow_groups: true,
            enhanced_line_crossed: false,
            idle_operation: false,
            retries: Retries::Always,
            max_datagrams_per_frame: None,
            acyclic_bytes: DEFAULT_BUDGET,
        }
    }
}

impl Options {
    /// Sets [`Options::sii_cache`].
    #[must_use]
    pub fn with_sii_cache(mut self, sii_cache: bool) -> Options {
        self.sii_cache = sii_cache;
        self
    }

    /// Sets [`Options::sii_extent`].
    #[must_use]
    pub fn with_sii_extent(mut self, sii_extent: SiiExtent) -> Options {
        self.sii_extent = Some(sii_extent);
        self
    }

    /// Sets [`Options::pdos`].
    #[must_use]
    pub fn with_pdos(mut self, pdos: ReadPdos) -> Options {
        self.pdos = Some(pdos);
        self
    }

    /// Sets [`Options::supervision`].
    #[must_use]
    pub fn with_supervision(mut self, supervision: bool) -> Options {
        self.supervision = supervision;
        self
    }

    /// Sets [`Options::source_address`].
    #[must_use]
    pub fn with_source_address(mut self, source_address: MacCodec) -> Options {
        self.source_address = source_address;
        self
    }

    /// Sets [`Options::settle`].
    #[must_use]
    pub fn with_settle(mut self, settle: Duration) -> Options {
        self.settle = settle;
        self
    }

    /// Sets [`Options::patience`].
    #[must_use]
    pub fn with_patience(mut self, patience: Duration) -> Options {
        self.patience = patience;
        self
    }

    /// Sets [`Options::junctions`].
    #[must_use]
    pub fn with_junctions(mut self, junctions: JunctionMode) -> Options {
        self.junctions = junctions;
        self
    }

    /// Sets [`Options::follow_groups`].
    #[must_use]
    pub fn with_follow_groups(mut self, follow_groups: bool) -> Options {
        self.follow_groups = follow_groups;
        self
    }

    /// Sets [`Options::enhanced_line_crossed`].
    #[must_use]
    pub fn with_enhanced_line_crossed(mut self, enhanced_line_crossed: bool) -> Options {
        self.enhanced_line_crossed = enhanced_line_crossed;
        self
    }

    /// Sets [`Options::idle_operation`].
    #[must_use]
    pub fn with_idle_operation(mut self, idle_operation: bool) -> Options {
        self.idle_operation = idle_operation;
        self
    }

    /// Sets [`Options::retries`].
    #[must_use]
    pub fn with_retries(mut self, retries: Retries) -> Options {
        self.retries = retries;
        self
    }

    /// Sets [`Options::acyclic_bytes`].
    #[must_use]
    pub fn with_acyclic_bytes(mut self, acyclic_bytes: usize) -> Options {
        self.acyclic_bytes = acyclic_bytes;
        self
    }

    /// Sets [`Options::max_datagrams_per_frame`].
    #[must_use]
    pub fn with_max_datagrams_per_frame(mut self, datagrams: u16) -> Options {
        self.max_datagrams_per_frame = Some(datagrams);
        self
    }

    /// An engine for these links.
    pub(crate) fn engine(&self, links: &impl Links) -> Engine {
        let PerLink { main, redundant, .. } = links.addresses();
        let mut options = Engineering::new(main, redundant);
        options.sii_cache = self.sii_cache;
        options.sii_extent = self.sii_extent;
        options.pdos = self.pdos;
        options.supervision = self.supervision;
        options.codec = self.source_address;
        options.settle = self.settle;
        options.patience = self.patience;
        options.junctions = self.junctions;
        options.follow_groups = self.follow_groups;
        options.enhanced_line_crossed = self.enhanced_line_crossed;
        options.idle_operation = self.idle_operation;
        options.retries = self.retries;
        options.max_datagrams_per_frame = self.max_datagrams_per_frame;
        Engine::new(options, links.now())
    }
}

/// A MainDevice with links, before activation. It sends only while one of its methods runs.
#[derive(Debug)]
pub struct MainDevice<L> {
    links: L,
    engine: Engine,
    acyclic_bytes: usize,
}

impl<L: Links> MainDevice<L> {
    /// Creates a MainDevice on these links.
    pub fn request(links: L, options: &Options) -> MainDevice<L> {
        let engine = options.engine(&links);
        MainDevice { links, engine, acyclic_bytes: options.acyclic_bytes }
    }

    /// Scans the segment; all SubDevices are in INIT afterwards.
    ///
    /// # Errors
    /// [`Error::Scan`]: no frame returns, no SubDevice answers, the number of SubDevices does not settle, an SII cannot
    /// be read, and others ([`ScanError`](crate::ScanError)).
    pub fn scan(&mut self) -> Result<Scan, Error> {
        self.scan_with(|_| ())
    }

    /// Scans like [`MainDevice::scan`], and calls `on_event` for each event.
    ///
    /// # Errors
    /// As [`MainDevice::scan`].
    pub fn scan_with(&mut self, on_event: impl FnMut(&TimedEvent)) -> Result<Scan, Error> {
        self.engine.start_scan()?;
        self.finish_scan(on_event)
    }

    /// Waits for the end of a scan that the engine has begun.
    pub(crate) fn finish_scan(&mut self, mut on_event: impl FnMut(&TimedEvent)) -> Result<Scan, Error> {
        loop {
            self.work();
            while let Some(event) = self.engine.pop_event(self.links.now()) {
                on_event(&event);
            }
            if let Some(result) = self.engine.scan_result() {
                return Ok(result?);
            }
            self.wait();
        }
    }

    /// Goes on with a segment that another process has known, without a scan ([`Engine::resume`]). Returns what was
    /// found; nothing was read again that is as known.
    ///
    /// # Errors
    /// [`Error::Scan`]: no SubDevice answers within [`Options::patience`], or the segment does not become stable.
    pub fn resume(&mut self, knowledge: Knowledge, handover: Handover) -> Result<Scan, Error> {
        self.engine.resume(knowledge, handover)?;
        loop {
            self.work();
            if let Some(result) = self.engine.scan_result() {
                return Ok(result?);
            }
            self.wait();
        }
    }

    /// What is known of the segment, for another process that goes on with it; `None` without a successful scan.
    pub fn knowledge(&self) -> Option<Knowledge> {
        self.engine.knowledge()
    }

    /// The links, when another process goes on with the segment: this MainDevice ends without a frame.
    pub fn into_links(self) -> L {
        self.links
    }

    /// Inspects the ring without changing anything on it: counts, cabling, the place of a break, error counters.
    ///
    /// # Errors
    /// Frames are lost repeatedly, no SubDevice answers, or SubDevices are added or lost meanwhile.
    pub fn inspect_ring(&mut self) -> Result<RingInspection, Error> {
        let bus = self.engine.bus();
        Ok(self.run(inspect_ring(bus))?)
    }

    /// Receives frames, runs procedures, sends frames.
    fn work(&mut self) {
        let MainDevice { links, engine, .. } = self;
        let now = links.now();
        engine.set_carriers(Link::ALL.map(|link| links.carrier(link)));
        while links.receive(&mut |link, frame| {
            engine.receive(link, frame, now);
        }) {}
        engine.poll(now);
        carry_out_link_order(engine, links);
        engine.transmit(now, usize::MAX, &mut |link, frame| links.send(link, frame));
        log_messages(engine);
    }

    /// Works for a time without an application: with [`Options::idle_operation`] it watches the segment meanwhile.
    pub fn attend(&mut self, time: Duration) {
        let end = self.links.now() + time;
        while self.links.now() < end {
            self.work();
            let wake = self.engine.next_deadline().unwrap_or(end);
            self.links.wait(wake.min(end));
        }
    }

    /// Takes the oldest event.
    pub fn pop_event(&mut self) -> Option<TimedEvent> {
        self.engine.pop_event(self.links.now())
    }

    /// The SubDevices that the last scan found, as idle operation has followed them; empty before a scan.
    pub fn subdevices(&self) -> Vec<SubDeviceInfo> {
        self.engine.subdevices()
    }

    /// Host time.
    pub fn now(&self) -> Instant {
        self.links.now()
    }

    /// The engine, for functions without a method here.
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    /// Waits for a frame or a deadline.
    fn wait(&mut self) {
        if let Some(wake) = self.engine.next_deadline() {
            self.links.wait(wake);
        }
    }

    /// Runs an async function of the engine to its end.
    pub fn run<T: 'static>(&mut self, work: impl Future<Output = T> + 'static) -> T {
        let work = self.engine.start(work);
        self.finish(work)
    }

    /// The engine, for functions without a method here.
    pub fn engine_mut(&mut self) -> &mut Engine {
        &mut self.engine
    }

    /// Waits for the result of a procedure. Nothing stops the engine meanwhile, so there always is a result.
    pub(crate) fn finish<T: 'static>(&mut self, mut work: Pending<T>) -> T {
        loop {
            self.work();
            if let Some(result) = work.take() {
                return result;
            }
            self.wait();
        }
    }

    /// Lays out process data, starts the configuration of all SubDevices, and returns the running application.
    ///
    /// # Errors
    /// The declaration does not fit the scan, or process data does not fit into frames. The error contains the
    /// MainDevice for another attempt.
    pub fn activate(mut self, declaration: Declaration) -> Result<Application<L>, Box<Refused<MainDevice<L>>>> {
        match self.load(declaration) {
            Ok(()) => self.apply(),
            Err(error) => Err(Box::new(Refused { error, main_device: self })),
        }
    }

    /// First of the steps that [`MainDevice::activate`] combines: loads a declaration. It replaces a previously loaded
    /// one, with all added connections.
    ///
    /// # Errors
    /// Errors in the declaration alone.
    pub fn load(&mut self, declaration: Declaration) -> Result<(), Error> {
        Ok(self.engine.load(declaration)?)
    }

    /// Second step, as often as needed: adds the connection of a ring behind a junction. The mode is then strict.
    ///
    /// # Errors
    /// Nothing is loaded, or the connection is wrong.
    pub fn add_junction_connection(&mut self, connection: JunctionConnection) -> Result<(), Error> {
        Ok(self.engine.add_junction_connection(connection).map_err(ActivateError::Junction)?)
    }

    /// Last step: lays out process data, starts the configuration of all SubDevices, and returns the running
    /// application.
    ///
    /// # Errors
    /// Nothing is loaded, the declaration does not fit the scan, or a declared ring does not close as declared (each is
    /// tested). The error contains the MainDevice; the declaration stays loaded.
    pub fn apply(mut self) -> Result<Application<L>, Box<Refused<MainDevice<L>>>> {
        let window = Arc::new(Window::new(self.acyclic_bytes));
        let check = self.engine.start_connection_check();
        let checked = self.finish(check).map_err(ActivateError::Junction);
        match checked.and_then(|()| self.engine.apply()) {
            Ok(active) => Ok(Application::new(self.links, Inline::new(self.engine), active, window)),
            Err(error) => Err(Box::new(Refused { error: error.into(), main_device: self })),
        }
    }

    /// Gives back the memory for the image of a domain after a failed activation ([`Declaration::place_image`]).
    pub fn unused_memory(&mut self, domain: DomainId) -> Option<&'static mut [u8]> {
        self.engine.unused_memory(domain)
    }

    pub(crate) fn from_parts(links: L, engine: Engine, acyclic_bytes: usize) -> MainDevice<L> {
        MainDevice { links, engine, acyclic_bytes }
    }

    /// Waits for the end of a stop that the engine has begun.
    pub(crate) fn finish_stop(&mut self) -> Result<(), Error> {
        loop {
            self.work();
            if let Some(result) = self.engine.stop_result() {
                return Ok(result?);
            }
            self.wait();
        }
    }

    /// Counters of frames and datagrams of the acyclic half so far.
    pub fn acyclic_counters(&self) -> AcyclicCounters {
        self.engine.counters()
    }

    /// The links.
    pub fn links_mut(&mut self) -> &mut L {
        &mut self.links
    }
}

/// A refused activation or a deactivation that was not complete, with the MainDevice. `?` converts it into an [`Error`]
/// or a `Box<dyn std::error::Error>`, and drops the MainDevice.
#[non_exhaustive]
pub struct Refused<M> {
    /// The cause.
    pub error: Error,
    /// The MainDevice.
    pub main_device: M,
}

impl<M> fmt::Debug for Refused<M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Refused").field("error", &self.error).finish_non_exhaustive()
    }
}

impl<M> fmt::Display for Refused<M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.error.fmt(f)
    }
}

impl<M> std::error::Error for Refused<M> {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        Some(&self.error)
    }
}

impl<M> From<Box<Refused<M>>> for Error {
    fn from(refused: Box<Refused<M>>) -> Error {
        refused.error
    }
}

/// A declaration of all scanned SubDevices, with the process data of their SII in one domain.
pub fn automatic(subdevices: &[SubDeviceInfo], period: Duration) -> Declaration {
    let mut declaration = Declaration::new(period);
    for subdevice in subdevices {
        declaration.add(SubDeviceConfig::from_info(subdevice));
    }
    declaration
}
