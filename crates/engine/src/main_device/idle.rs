//! The MainDevice without an application: phases, idle operation, the way back to it, and SubDevices by
//! address.

use alloc::rc::Rc;
use core::time::Duration;

use super::MainDevice;
use crate::declared::Address;
use crate::procedures::deactivate::{Remainder, deactivate};
use crate::procedures::loops::restore_within;
use crate::procedures::scan::ScanOptions;
use crate::procedures::services::ServiceError;
use crate::procedures::stop::StopError;
use crate::role::{Function, MainDevicePhase, MainDeviceRole};
use crate::segment::{Addressed, Found, IdleObservation, Observation, ReadPdos, Scan, UndeclaredObservation};
use crate::time::Instant;

impl MainDevice {
    /// What the MainDevice does as a whole. A link that does not report a carrier counts as connected.
    pub fn phase(&self) -> MainDevicePhase {
        let carriers = self.supervisor.bus().carriers();
        let links = if self.options.redundant.is_some() { 2 } else { 1 };
        match self.active() {
            Some(_) => MainDevicePhase::Operation,
            None if carriers.iter().take(links).all(|carrier| *carrier == Some(false)) => MainDevicePhase::Orphaned,
            None => MainDevicePhase::Idle,
        }
    }

    /// Whether an address names a declared SubDevice.
    pub fn is_declared(&self, subdevice: impl Into<Address>) -> bool {
        matches!(self.segment.view().find(subdevice), Some(Addressed::Member(_)))
    }

    /// Whether the MainDevice keeps SubDevices without a declaration in their states.
    pub fn has_idle_operation(&self) -> bool {
        self.options.idle_operation
    }

    /// Whether PDOs of dictionaries are about to replace those of the SIIs: SubDevices are on their first way to PREOP,
    /// or their dictionaries are being read. Without an application only.
    pub fn are_pdos_awaited(&self) -> bool {
        self.active().is_none() && self.segment.view().are_pdos_awaited()
    }

    /// Whether ports are closed for a moment, to measure delays. They are opened again by this MainDevice; without a
    /// further frame of it they are opened when the temporary setting expires, within a second.
    pub fn are_ports_altered(&self) -> bool {
        let view = self.segment.view();
        view.is_measuring() || !view.altered().is_empty()
    }

    /// The SubDevice with an address.
    pub(super) fn find(&self, subdevice: impl Into<Address>) -> Result<Addressed, ServiceError> {
        let subdevice = subdevice.into();
        self.segment.view().find(subdevice).ok_or(ServiceError::NoSubDevice { subdevice })
    }

    /// Index in the declaration of the SubDevice with an address.
    pub(super) fn find_member(&self, subdevice: impl Into<Address>) -> Result<usize, ServiceError> {
        self.active().ok_or(ServiceError::NotActive)?;
        let subdevice = subdevice.into();
        match self.find(subdevice)? {
            Addressed::Member(index) => Ok(index),
            Addressed::Undeclared(_) => Err(ServiceError::NoSubDevice { subdevice }),
        }
    }

    /// Starts the procedures of idle operation, if it is requested and they do not run.
    pub(super) fn begin_idle(&mut self) {
        let is_active = self.role() == MainDeviceRole::Active;
        if !self.options.idle_operation || !is_active || self.segment.view().keeps_undeclared() {
            return;
        }
        self.segment.observe_undeclared(UndeclaredObservation::KeepingBegun);
        self.segment.observe_idle(IdleObservation::Begun);
    }

    /// What the last scan has found. With idle operation an application may begin before the first scan has ended: it
    /// has found nothing then, and each SubDevice is configured when it comes. A requested scan goes on.
    pub(super) fn found_to_begin(&self) -> Option<Rc<Found>> {
        let is_unknown = {
            let view = self.segment.view();
            view.found().is_none() && !view.is_requested_scan_under_way()
        };
        if self.options.idle_operation && is_unknown {
            self.segment.observe(Observation::ScanBegun);
            self.segment.observe(Observation::ScanEnded(Ok(Scan::nothing())));
        }
        self.segment.view().found().cloned()
    }

    /// Ends the application: process data, supervision and all other procedures end, and every SubDevice goes to PREOP
    /// with its mailbox, those without a declaration too. The scan is kept and follows what the application has found,
    /// so another declaration can be activated at once, with other domains, members and clocks. The exchange must not
    /// send any more.
    ///
    /// # Errors
    /// [`ServiceError::NotPermitted`].
    pub fn start_deactivate(&mut self, limit: Duration, now: Instant) -> Result<(), ServiceError> {
        self.permit(Function::Deactivate)?;
        let segment = self.active().ok_or(ServiceError::NotActive)?;
        // What is known of them is noted here.
        self.segment.observe_written_pdos();
        let remainder = Remainder::of(&segment.view());
        self.end_application(now);
        let (bus, segment, slot) = (self.supervisor.bus(), self.segment.clone(), self.stopped.clone());
        let options = ScanOptions { pdos: ReadPdos::Never, ..self.own_scan_options() };
        let is_kept = self.options.idle_operation;
        if is_kept {
            segment.observe_undeclared(UndeclaredObservation::KeepingBegun);
            segment.observe_idle(IdleObservation::Deactivating);
            segment.observe_idle(IdleObservation::Begun);
        }
        let scan = segment.view().scan_number();
        self.supervisor.spawn(async move {
            let work = async {
                let left = restore_within(&bus, &segment, limit).await;
                deactivate(&bus, &segment, &options, remainder, left).await
            };
            // Another application requests other states, a scan assigns addresses: no SubDevice is brought to PREOP any
            // more.
            let result = segment.unless(|model| model.is_active() || model.has_another_scan(scan), work).await;
            *slot.borrow_mut() = Some(result.unwrap_or(Err(StopError::Ended)));
            if is_kept {
                segment.observe_idle(IdleObservation::Deactivated);
            }
        });
        Ok(())
    }

    /// Repeats the failed configuration of a SubDevice now, or of all. False if there is no such SubDevice.
    pub fn retry(&mut self, subdevice: Option<Address>) -> bool {
        let found = subdevice.map(|subdevice| self.find(subdevice)).transpose();
        if let Ok(subdevice) = found {
            self.segment.observe(Observation::Retried(subdevice));
        }
        found.is_ok()
    }
}
