//! What the ACTIVE has measured, for the INACTIVE (protocol MR-14, MR-19, REQ045).

use ringcat_engine::main_device::PartnerDiagnosis;

use crate::acyclic::Inline;
use crate::application::Application;
use crate::error::Error;
use crate::links::Links;
use crate::main_device::MainDevice;
use crate::supervisor_thread::SupervisorThread;

impl<L: Links> MainDevice<L> {
    /// What the ACTIVE has measured of the segment, with the counters of its frames and cycles, as of the last cycle
    /// that has arrived as a whole; `None` before one, and if this MainDevice is alone.
    pub fn partner_diagnosis(&self) -> Option<PartnerDiagnosis> {
        self.engine.partner_diagnosis()
    }
}

impl<L: Links> Application<L, Inline> {
    /// As [`MainDevice::partner_diagnosis`]. Not for the cyclic path.
    pub fn partner_diagnosis(&self) -> Option<PartnerDiagnosis> {
        self.acyclic.engine.partner_diagnosis()
    }
}

impl SupervisorThread {
    /// As [`MainDevice::partner_diagnosis`].
    ///
    /// # Errors
    /// The thread has ended.
    pub fn partner_diagnosis(&self) -> Result<Option<PartnerDiagnosis>, Error> {
        self.act(|engine| engine.partner_diagnosis())
    }
}
