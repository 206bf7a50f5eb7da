//! What the ACTIVE has measured, for the INACTIVE (protocol MR-14, MR-19, REQ045).

use ringcat_engine::main_device::HeardDiagnosis;

use crate::acyclic::Inline;
use crate::application::Application;
use crate::error::Error;
use crate::links::Links;
use crate::main_device::MainDevice;
use crate::supervisor_thread::SupervisorThread;

impl<L: Links> MainDevice<L> {
    /// What the ACTIVE has measured of the segment, with the counters of its frames and cycles, as of the last cycle
    /// that has arrived as a whole; `None` before one, and if this MainDevice is alone.
    pub fn heard_diagnosis(&self) -> Option<HeardDiagnosis> {
        self.engine.heard_diagnosis()
    }
}

impl<L: Links> Application<L, Inline> {
    /// As [`MainDevice::heard_diagnosis`]. Not for the cyclic path.
    pub fn heard_diagnosis(&self) -> Option<HeardDiagnosis> {
        self.acyclic.engine.heard_diagnosis()
    }
}

impl SupervisorThread {
    /// As [`MainDevice::heard_diagnosis`].
    ///
    /// # Errors
    /// The thread has ended.
    pub fn heard_diagnosis(&self) -> Result<Option<HeardDiagnosis>, Error> {
        self.act(|engine| engine.heard_diagnosis())
    }
}
