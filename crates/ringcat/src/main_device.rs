//! A MainDevice with its links, before activation.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use ringcat_engine::config::{SubDeviceConfig, data_words};
use ringcat_engine::domain::DomainId;
use ringcat_engine::event::TimedEvent;
use ringcat_engine::info::SubDeviceInfo;
use ringcat_engine::knowledge::{Handover, Knowledge};
use ringcat_engine::link::Link;
use ringcat_engine::main_device::{ActivateError, Declaration, MainDevice as Engine, Pending};
use ringcat_engine::time::Instant;
use ringcat_engine::{AcyclicCounters, RingInspection, Scan, inspect_ring};
use ringcat_engine::{JunctionConnection, JunctionError};

use crate::acyclic::{Inline, carry_out_link_order, log_messages};
use crate::application::Application;
use crate::error::Error;
use crate::links::Links;
use crate::of_two::OfTwo;
pub use crate::options::Options;
use crate::window::Window;

/// A MainDevice with links, before activation. It sends only while one of its methods runs.
#[derive(Debug)]
pub struct MainDevice<L> {
    pub(crate) links: L,
    pub(crate) engine: Engine,
    pub(crate) acyclic_bytes: usize,
    /// Its part in a ring of two MainDevices.
    pub(crate) of_two: OfTwo,
}

impl<L: Links> MainDevice<L> {
    /// Creates a MainDevice on these links.
    pub fn request(links: L, options: &Options) -> MainDevice<L> {
        let engine = options.engine(&links);
        let of_two = options.of_two(&links);
        MainDevice { links, engine, acyclic_bytes: options.acyclic_bytes, of_two }
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

    /// Scans like [`MainDevice::scan`], and ends a scan that is under way: one that idle operation has begun.
    ///
    /// # Errors
    /// As [`MainDevice::scan`].
    pub fn restart_scan(&mut self) -> Result<Scan, Error> {
        self.engine.restart_scan()?;
        self.finish_scan(|_| ())
    }

    /// Reads the words of memory by which declarations find SubDevices
    /// ([`ConfigAddress::DataWord`](crate::ConfigAddress)) into the result of a scan. An activation reads these words
    /// itself; a comparison before the activation needs this function.
    pub fn read_data_words(&mut self, declared: &[SubDeviceConfig], scan: &mut Scan) {
        let words = self.engine.start_data_words(data_words(declared));
        let read = self.finish(words);
        take_data_words(read, scan);
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
        Ok(self.perform(inspect_ring(bus))?)
    }

    /// Receives frames, runs procedures, sends frames.
    pub(crate) fn work(&mut self) {
        let MainDevice { links, engine, of_two, .. } = self;
        let now = links.now();
        engine.set_carriers(Link::ALL.map(|link| links.carrier(link)));
        of_two.take_in(links, engine, now);
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

    /// Waits for a frame or a deadline.
    fn wait(&mut self) {
        if let Some(wake) = self.engine.next_deadline() {
            self.links.wait(wake);
        }
    }

    /// Runs an async function of the engine to its end.
    pub(crate) fn perform<T: 'static>(&mut self, work: impl Future<Output = T> + 'static) -> T {
        let work = self.engine.start(work);
        self.finish(work)
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

    /// Tests whether the added rings close as declared, without the last step (which makes the same test). Nothing is
    /// configured.
    ///
    /// # Errors
    /// [`JunctionError::NotThere`]: a ring does not close as declared.
    pub fn check_connections(&mut self) -> Result<(), JunctionError> {
        let check = self.engine.start_connection_check();
        self.finish(check)
    }

    /// Last step: lays out process data, starts the configuration of all SubDevices, and returns the running
    /// application.
    ///
    /// # Errors
    /// Nothing is loaded, the declaration does not fit the scan, or a declared ring does not close as declared (each is
    /// tested). The error contains the MainDevice; the declaration stays loaded.
    pub fn apply(mut self) -> Result<Application<L>, Box<Refused<MainDevice<L>>>> {
        let window = Arc::new(Window::new(self.acyclic_bytes));
        let words = self.engine.start_loaded_data_words();
        let read = self.finish(words);
        let checked = read.and_then(|()| self.check_connections().map_err(ActivateError::Junction));
        match checked.and_then(|()| self.engine.apply()) {
            Ok(active) => Ok(Application::new(self.links, Inline::new(self.engine), active, window)),
            Err(error) => Err(Box::new(Refused { error: error.into(), main_device: self })),
        }
    }

    /// Gives back the memory for the image of a domain after a failed activation ([`Declaration::place_image`]).
    pub fn unused_memory(&mut self, domain: DomainId) -> Option<&'static mut [u8]> {
        self.engine.unused_memory(domain)
    }

    /// The same of the memory for process data between both MainDevices
    /// ([`Declaration::place_partner_data`](crate::Declaration::place_partner_data)).
    #[cfg(feature = "standby")]
    pub fn unused_partner_memory(&mut self) -> Option<crate::standby::PartnerMemory> {
        self.engine.unused_partner_memory()
    }

    pub(crate) fn from_parts(links: L, engine: Engine, acyclic_bytes: usize, of_two: OfTwo) -> MainDevice<L> {
        MainDevice { links, engine, acyclic_bytes, of_two }
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

/// Copies the data words that were read to the result of a scan; words that belong to another scan are skipped.
pub(crate) fn take_data_words(read: Vec<SubDeviceInfo>, scan: &mut Scan) {
    for (of, read) in scan.subdevices.iter_mut().zip(read) {
        if (of.station, of.identity) == (read.station, read.identity) {
            of.data_words = read.data_words;
        }
    }
}
