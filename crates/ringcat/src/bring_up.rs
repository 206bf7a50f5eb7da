//! From a segment that nothing is known of to a running application in one step.
//!
//! A scan reads whole SIIs, because its result has names. A bring-up reads what operation needs; the rest follows in
//! the background when all SubDevices are in their target states ([`SiiExtent`](crate::SiiExtent)).

use ringcat_engine::Scan;
use ringcat_engine::main_device::{Declaration, MainDevice as Engine};

use crate::application::Application;
use crate::error::Error;
use crate::links::Links;
use crate::main_device::{MainDevice, Refused};
use crate::supervisor_thread::{Activated, Ended, SupervisorThread};

impl<L: Links> MainDevice<L> {
    /// Scans, and activates what `declare` returns: the shortest way to OP, because only what operation needs is read
    /// of the SIIs before. Names and operation modes of clocks are empty in what `declare` gets, unless
    /// [`Options::sii_extent`](crate::Options::sii_extent) requests them. They are read in the background as soon as
    /// all SubDevices are in their target states, and are in [`MainDevice::subdevices`] and in searches by name then;
    /// [`Services::complete_siis`](crate::Services::complete_siis) waits for them.
    ///
    /// ```
    /// use std::time::Duration;
    /// use ringcat::simulated::SimulatedSegment;
    /// use ringcat::{MainDevice, Options, automatic};
    ///
    /// let links = SimulatedSegment::from_toml("[segment]\n[[device]]\ntype = \"servo\"\n")?;
    /// let main_device = MainDevice::request(links, &Options::default());
    /// let mut application = main_device.bring_up(|scan| automatic(&scan.subdevices, Duration::from_millis(1)))?;
    /// application.wait_until_op(Duration::from_secs(1))?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`MainDevice::scan`] and [`MainDevice::activate`]. The error contains the MainDevice for another attempt.
    pub fn bring_up(
        mut self,
        declare: impl FnOnce(&Scan) -> Declaration,
    ) -> Result<Application<L>, Box<Refused<MainDevice<L>>>> {
        match self.scan_for_operation() {
            Ok(scan) => self.activate(declare(&scan)),
            Err(error) => Err(Box::new(Refused { error, main_device: self })),
        }
    }

    /// Scans, and reads the words of the SIIs that operation needs.
    pub(crate) fn scan_for_operation(&mut self) -> Result<Scan, Error> {
        self.engine.start_scan_for_operation()?;
        self.finish_scan(|_| ())
    }
}

impl SupervisorThread {
    /// Scans, and activates what `declare` returns, as [`MainDevice::bring_up`]. Cycles use `links`, as in
    /// [`SupervisorThread::activate`].
    ///
    /// # Errors
    /// As [`SupervisorThread::scan`] and [`SupervisorThread::activate`]. The error contains the handle and the links
    /// for another attempt.
    pub fn bring_up<C: Links>(self, declare: impl FnOnce(&Scan) -> Declaration, links: C) -> Activated<C> {
        match self.scan_for_operation() {
            Ok(scan) => self.activate(declare(&scan), links),
            Err(error) => Err(Box::new(Refused { error, main_device: Ended { supervisor: self, links } })),
        }
    }

    /// Scans, and reads the words of the SIIs that operation needs.
    pub(crate) fn scan_for_operation(&self) -> Result<Scan, Error> {
        self.act(Engine::start_scan_for_operation)??;
        self.finish_scan(|| ())
    }
}
