//! An orderly stop of an application, and the way back to operation without one, in one thread and in two.

use std::time::Duration;

use ringcat_engine::main_device::{Function, MainDevice as Engine, Permission};
use ringcat_wire::al::AlState;

use crate::acyclic::{AcyclicHalf, Inline};
use crate::application::{Application, LastOutputs};
use crate::error::Error;
use crate::links::Links;
use crate::main_device::{MainDevice, Refused};
use crate::supervisor_thread::{Ended, SupervisorThread};

/// Whether last cycles may be sent: in role INACTIVE the segment belongs to another MainDevice.
fn is_allowed(engine: &Engine, function: Function) -> bool {
    engine.permission(function) == Permission::Allowed
}

impl<L: Links, A: AcyclicHalf> Application<L, A> {
    /// The links, when another process goes on with the segment: the application ends without a further frame, and what
    /// the SubDevices do is up to that process and to their watchdogs ([`crate::MainDevice::resume`]).
    pub fn into_links(self) -> L {
        self.links
    }
}

impl<L: Links> Application<L, Inline> {
    /// Stops in order: runs a few more cycles, with all outputs zero if `outputs` requests it, then brings all
    /// SubDevices down to a state. Returns the MainDevice, which may scan again.
    ///
    /// # Errors
    /// SubDevices do not reach the state in time, or the bus fails.
    pub fn stop(mut self, outputs: LastOutputs, state: AlState, limit: Duration) -> Result<MainDevice<L>, Error> {
        self.end_cycles(outputs, is_allowed(&self.acyclic.engine, Function::Stop));
        self.acyclic.engine.start_stop(state, limit, self.links.now());
        let (budget, of_two) = (self.window.budget(), self.cyclic.of_two);
        let mut main_device = MainDevice::from_parts(self.links, self.acyclic.engine, budget, of_two);
        main_device.finish_stop()?;
        Ok(main_device)
    }

    /// Ends the application: runs a few more cycles, with all outputs zero if `outputs` requests it, then brings every
    /// SubDevice to PREOP, those without a declaration too. The returned MainDevice keeps the scan, and may activate
    /// another declaration at once.
    ///
    /// # Errors
    /// SubDevices do not reach PREOP in time, or the bus fails. The error contains the MainDevice, which may activate
    /// another declaration nevertheless.
    pub fn deactivate(
        mut self,
        outputs: LastOutputs,
        limit: Duration,
    ) -> Result<MainDevice<L>, Box<Refused<MainDevice<L>>>> {
        self.end_cycles(outputs, is_allowed(&self.acyclic.engine, Function::Deactivate));
        let begun = self.acyclic.engine.start_deactivate(limit, self.links.now()).map_err(Error::from);
        let (budget, of_two) = (self.window.budget(), self.cyclic.of_two);
        let mut main_device = MainDevice::from_parts(self.links, self.acyclic.engine, budget, of_two);
        match begun.and_then(|()| main_device.finish_stop()) {
            Ok(()) => Ok(main_device),
            Err(error) => Err(Box::new(Refused { error, main_device })),
        }
    }
}

impl<L: Links> Application<L, SupervisorThread> {
    /// Stops in order: runs a few more cycles, with all outputs zero if `outputs` requests it, then brings all
    /// SubDevices down to a state. Returns the MainDevice, which may scan again, and the links of the cycles.
    ///
    /// # Errors
    /// SubDevices do not reach the state in time, or the bus fails.
    pub fn stop(mut self, outputs: LastOutputs, state: AlState, limit: Duration) -> Result<Ended<L>, Error> {
        let is_allowed = self.acyclic.act(|engine| is_allowed(engine, Function::Stop))?;
        self.end_cycles(outputs, is_allowed);
        self.acyclic.stop(state, limit)?;
        Ok(Ended { supervisor: self.acyclic, links: self.links })
    }

    /// Ends the application, as in one thread. The returned thread keeps the scan, and may activate another declaration
    /// at once, on the same links.
    ///
    /// # Errors
    /// SubDevices do not reach PREOP in time, or the bus fails. The error contains the handle and the links.
    pub fn deactivate(mut self, outputs: LastOutputs, limit: Duration) -> Deactivated<L> {
        // Without its thread there is nothing to go on with.
        let ended = self.acyclic.act(|engine| is_allowed(engine, Function::Deactivate)).and_then(|is_allowed| {
            self.end_cycles(outputs, is_allowed);
            self.acyclic.deactivate(limit)
        });
        let main_device = Ended { supervisor: self.acyclic, links: self.links };
        match ended {
            Ok(()) => Ok(main_device),
            Err(error) => Err(Box::new(Refused { error, main_device })),
        }
    }
}

/// What a deactivated application leaves; the same if the deactivation was not complete.
pub type Deactivated<L> = Result<Ended<L>, Box<Refused<Ended<L>>>>;
