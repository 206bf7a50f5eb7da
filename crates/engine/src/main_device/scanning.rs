//! The scan, and what it has found.

use alloc::string::ToString;
use alloc::vec::Vec;

use super::MainDevice;
use super::activate::activate_error::ActivateError;
use crate::info::{SiiExtent, SubDeviceInfo};
use crate::procedures::cabling::until_link_returns;
use crate::procedures::loops::restore;
use crate::procedures::scan::{Scan, ScanError, ScanOptions, end_scan, scan, unless_another};
use crate::role::Function;
use crate::segment::{Observation, ReadPdos};

/// What a scan ends when it begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ends {
    /// It is refused while another one is under way.
    Nothing,
    TheOneUnderWay,
}

impl MainDevice {
    /// Starts a scan, which puts all SubDevices into INIT. Refused while active.
    pub fn start_scan(&mut self) -> Result<(), ActivateError> {
        self.begin_scan(self.options.sii_extent.unwrap_or_default(), Ends::Nothing)
    }

    /// Starts a scan as [`MainDevice::start_scan`], and ends one that is under way: also one of idle operation, or one
    /// that goes on with the knowledge of another process. [`MainDevice::scan_result`] has the result of the new one.
    pub fn restart_scan(&mut self) -> Result<(), ActivateError> {
        self.begin_scan(self.options.sii_extent.unwrap_or_default(), Ends::TheOneUnderWay)
    }

    /// As [`MainDevice::start_scan`]; of the SIIs it reads what operation needs, unless the options name an extent.
    pub fn start_scan_for_operation(&mut self) -> Result<(), ActivateError> {
        self.begin_scan(self.options.sii_extent.unwrap_or(SiiExtent::Operation), Ends::Nothing)
    }

    fn begin_scan(&mut self, extent: SiiExtent, ends: Ends) -> Result<(), ActivateError> {
        self.permit(Function::Scan)?;
        if ends == Ends::Nothing && self.segment.view().is_scanning() {
            return Err(ActivateError::Scanning);
        }
        self.segment.observe(Observation::ScanBegun);
        *self.scan_error.borrow_mut() = None;
        self.emergencies.borrow_mut().forget_positions();
        let (bus, segment, slot) = (self.supervisor.bus(), self.segment.clone(), self.scan_error.clone());
        let options = self.scan_options(extent);
        let number = self.segment.view().scan_number();
        self.supervisor.spawn(async move {
            let scanned = unless_another(&segment, number, async {
                restore(&bus, &segment).await;
                until_link_returns(&bus, &segment).await;
                scan(&bus, &segment, &options).await
            });
            if let Some(result) = scanned.await {
                let ended = result.map_err(|error| slot.borrow_mut().insert(error).to_string());
                end_scan(&segment, ended);
            }
        });
        self.begin_idle();
        Ok(())
    }

    pub(super) fn scan_options(&self, extent: SiiExtent) -> ScanOptions {
        ScanOptions {
            settle: self.options.settle,
            patience: self.options.patience,
            extent,
            cache: self.cache.clone(),
            junctions: self.options.junctions,
            pdos: self.options.pdos.unwrap_or_default(),
            enhanced_line_crossed: self.options.enhanced_line_crossed,
            alias_source: self.options.alias_source,
            sii_assignment: self.options.sii_assignment,
        }
    }

    /// Options of scans that no application has requested. SubDevices that are kept in PREOP have their dictionaries
    /// read there.
    pub(super) fn own_scan_options(&self) -> ScanOptions {
        let options = self.scan_options(self.options.sii_extent.unwrap_or_default());
        let pdos = if self.options.idle_operation { ReadPdos::Never } else { options.pdos };
        ScanOptions { pdos, ..options }
    }

    /// The result of the last scan, once it has ended.
    pub fn scan_result(&self) -> Option<Result<Scan, ScanError>> {
        if let Some(error) = *self.scan_error.borrow() {
            return Some(Err(error));
        }
        self.segment.view().found().map(|found| Ok(found.scan()))
    }

    /// SubDevices of the last scan; empty before a successful scan, and in role INACTIVE.
    pub fn subdevices(&self) -> Vec<SubDeviceInfo> {
        if self.permit(Function::SubDeviceInfo).is_err() {
            return Vec::new();
        }
        self.segment.view().found().map(|found| found.scan().subdevices).unwrap_or_default()
    }
}
