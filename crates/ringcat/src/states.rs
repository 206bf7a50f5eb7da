//! States of mandatory SubDevices, of hot connect groups, of clocks and of the whole segment.

use ringcat_engine::config::ReferenceClock;
use ringcat_engine::info::SubDeviceInfo;
use ringcat_engine::main_device::snapshot::Snapshot;
use ringcat_engine::main_device::{ClockStatus, GroupState};
use ringcat_wire::address::Position;

use crate::acyclic::Inline;
use crate::application::Application;
use crate::error::Error;
use crate::links::Links;
use crate::main_device::MainDevice;
use crate::supervisor_thread::SupervisorThread;

impl<L: Links> MainDevice<L> {
    /// The segment as a whole: what is active, ring, links, SubDevices.
    pub fn snapshot(&mut self) -> Snapshot {
        self.engine.snapshot()
    }
}

impl<L: Links> Application<L, Inline> {
    /// The segment as a whole: what is active, ring, links, SubDevices. Not for the cyclic path.
    pub fn snapshot(&mut self) -> Snapshot {
        self.acyclic.engine.snapshot()
    }

    /// Whether all clocks follow the reference clock that operation needs
    /// ([`ClockStatus::is_required`](crate::ClockStatus::is_required)); false without clocks.
    pub fn clocks_locked(&self) -> bool {
        self.acyclic.engine.clocks_locked()
    }

    /// Whether every declared SubDevice that is not optional is in its target state.
    pub fn mandatory_settled(&self) -> bool {
        self.acyclic.engine.mandatory_settled()
    }

    /// The state of each hot connect group, by its number. Not for the cyclic path.
    pub fn groups(&self) -> Vec<GroupState> {
        self.acyclic.engine.groups()
    }

    /// Each distributed clock: delay, drift, difference to the reference clock. Empty if the declaration has no clocks.
    /// Not for the cyclic path.
    pub fn clocks(&self) -> Vec<ClockStatus> {
        self.acyclic.engine.clocks()
    }

    /// Chooses the reference clock, also while the clocks run. Returns the position of the reference from now on: the
    /// first clock that answers if the chosen one does not; `None` without clocks. Not for the cyclic path.
    pub fn choose_reference_clock(&mut self, reference: ReferenceClock) -> Option<Position> {
        self.acyclic.engine.choose_reference_clock(reference)
    }
}

impl SupervisorThread {
    /// The SubDevices of the last scan; empty before a successful scan, and in role INACTIVE.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn subdevices(&self) -> Result<Vec<SubDeviceInfo>, Error> {
        self.act(|engine| engine.subdevices())
    }

    /// The segment as a whole: what is active, ring, links, SubDevices.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn snapshot(&self) -> Result<Snapshot, Error> {
        self.act(|engine| engine.snapshot())
    }

    /// Whether PDOs of dictionaries are about to be read, without an application: SubDevices on their way to PREOP.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn are_pdos_awaited(&self) -> Result<bool, Error> {
        self.act(|engine| engine.are_pdos_awaited())
    }

    /// Whether all clocks follow the reference clock that operation needs
    /// ([`ClockStatus::is_required`](crate::ClockStatus::is_required)); false without clocks.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn clocks_locked(&self) -> Result<bool, Error> {
        self.act(|engine| engine.clocks_locked())
    }

    /// Whether every declared SubDevice that is not optional is in its target state.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn mandatory_settled(&self) -> Result<bool, Error> {
        self.act(|engine| engine.mandatory_settled())
    }

    /// The state of each hot connect group, by its number.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn groups(&self) -> Result<Vec<GroupState>, Error> {
        self.act(|engine| engine.groups())
    }

    /// Each distributed clock: delay, drift, difference to the reference clock. Empty if the declaration has no clocks.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn clocks(&self) -> Result<Vec<ClockStatus>, Error> {
        self.act(|engine| engine.clocks())
    }

    /// Chooses the reference clock, also while the clocks run. Returns the position of the reference from now on: the
    /// first clock that answers if the chosen one does not; `None` without clocks.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn choose_reference_clock(&self, reference: ReferenceClock) -> Result<Option<Position>, Error> {
        self.act(move |engine| engine.choose_reference_clock(reference))
    }
}
