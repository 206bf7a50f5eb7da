//! The MainDevice without an application: phases, idle operation, the way back to it, and SubDevices by position.

use alloc::rc::Rc;
use core::time::Duration;

use ringcat_wire::address::Position;

use super::MainDevice;
use super::states::MainDevicePhase;
use crate::declared::{Address, SubDeviceId};
use crate::info::SubDeviceInfo;
use crate::procedures::deactivate::{Remainder, deactivate};
use crate::procedures::idle::watch;
use crate::procedures::services::ServiceError;
use crate::procedures::shared_segment::SharedSegment;
use crate::procedures::undeclared::{follow_unassigned, keep, watch_undeclared_mail, without_declaration};
use crate::time::Instant;

/// The SubDevice with a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// A declared one, by its index in the declaration.
    Member(usize),
    /// One without a declaration, by its position.
    Undeclared(Position),
}

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

    /// The number of a SubDevice in functions that take one: its index in the declaration; before activation its
    /// position; for a SubDevice without a declaration, while one is active and with idle operation, its position
    /// behind all indices. A declared SubDevice has a position, too. `None` if there is no such SubDevice.
    pub fn number(&self, address: impl Into<Address>) -> Option<usize> {
        let view = self.segment.view();
        let members = view.subdevices().member_count();
        match address.into() {
            Address::Declared(SubDeviceId(index)) => (index < members).then_some(index),
            Address::Scanned(position) if !view.is_active() => {
                let scanned = view.found()?.subdevices.len();
                (usize::from(position.0) < scanned).then_some(position.0.into())
            }
            Address::Scanned(position) => {
                if self.segment.undeclared.info(position).is_some() {
                    return Some(members + usize::from(position.0));
                }
                let station = *view.cabling().stations.get(usize::from(position.0))?;
                view.subdevices().member_of(station).filter(|_| self.options.idle_operation)
            }
        }
    }

    /// Whether a number is that of a declared SubDevice.
    pub fn is_declared(&self, subdevice: usize) -> bool {
        matches!(self.place(subdevice), Place::Member(_))
    }

    /// Whether the MainDevice keeps SubDevices without a declaration in their states.
    pub fn has_idle_operation(&self) -> bool {
        self.options.idle_operation
    }

    pub(super) fn place(&self, subdevice: usize) -> Place {
        let view = self.segment.view();
        let position = |number: usize| Place::Undeclared(Position(u16::try_from(number).unwrap_or(u16::MAX)));
        match subdevice.checked_sub(view.subdevices().member_count()) {
            Some(number) if !view.is_active() || self.segment.undeclared.is_kept() => position(number),
            _ if !view.is_active() => position(subdevice),
            _ => Place::Member(subdevice),
        }
    }

    /// Data of a SubDevice without a declaration.
    pub(super) fn info_of(&self, position: Position) -> Option<Rc<SubDeviceInfo>> {
        let view = self.segment.view();
        if view.is_active() {
            return self.segment.undeclared.info(position);
        }
        view.found()?.subdevices.get(usize::from(position.0)).cloned()
    }

    /// Starts the procedures of idle operation, if it is requested and they do not run.
    pub(super) fn begin_idle(&mut self) {
        if !self.options.idle_operation || core::mem::replace(&mut self.is_idle, true) {
            return;
        }
        let (bus, segment, options) = (self.supervisor.bus(), self.segment.clone(), self.scan_options());
        segment.undeclared.begin_keeping();
        self.supervisor.spawn(keep(bus.clone(), segment.undeclared.clone()));
        self.supervisor.spawn(watch_undeclared_mail(bus.clone(), segment.undeclared.clone()));
        self.supervisor.spawn(watch(bus, segment, options));
    }

    /// An application begins: declared SubDevices are no longer kept in their states of idle operation.
    pub(super) fn begin_keeping_undeclared(&mut self, segment: &SharedSegment) {
        if self.is_idle {
            segment.undeclared.follow(&without_declaration(&segment.view()));
            self.supervisor.spawn(follow_unassigned(segment.clone()));
        } else {
            segment.undeclared.clear();
        }
    }

    /// Ends the application: process data, supervision and all other procedures end, and every SubDevice goes to PREOP
    /// with its mailbox, those without a declaration too. The scan is kept and follows what the application has found,
    /// so another declaration can be activated at once, with other domains, members and clocks. The exchange must not
    /// send any more.
    ///
    /// # Errors
    /// [`ServiceError::NotActive`].
    pub fn start_deactivate(&mut self, limit: Duration, now: Instant) -> Result<(), ServiceError> {
        let segment = self.active().ok_or(ServiceError::NotActive)?;
        let remainder = Remainder::of(&segment.view());
        self.end_application(now);
        let (bus, segment, slot) = (self.supervisor.bus(), self.segment.clone(), self.stopped.clone());
        let options = self.scan_options();
        let is_kept = self.options.idle_operation;
        self.is_idle = is_kept;
        if is_kept {
            segment.undeclared.begin_keeping();
        }
        self.supervisor.spawn(async move {
            let result = deactivate(&bus, &segment, &options, remainder, limit).await;
            *slot.borrow_mut() = Some(result);
            if is_kept {
                bus.spawn(keep(bus.clone(), segment.undeclared.clone()));
                bus.spawn(watch_undeclared_mail(bus.clone(), segment.undeclared.clone()));
                watch(bus, segment, options).await;
            }
        });
        Ok(())
    }

    /// Repeats the failed configuration of a SubDevice now, by its number ([`MainDevice::number`]), or of all.
    pub fn retry(&mut self, subdevice: Option<usize>) {
        match subdevice.map(|subdevice| self.place(subdevice)) {
            None => {
                self.segment.undeclared.retry(None);
                self.segment.retry(None);
            }
            Some(Place::Undeclared(position)) => self.segment.undeclared.retry(Some(position)),
            Some(Place::Member(index)) => self.segment.retry(Some(index)),
        }
    }
}
