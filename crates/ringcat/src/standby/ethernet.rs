//! Ethernet to the other MainDevice, for programs that move its frames themselves (protocol 9.12).

use ringcat_engine::standby::PartnerEndpoint;

use crate::acyclic::Inline;
use crate::application::Application;
use crate::error::Error;
use crate::links::Links;
use crate::main_device::MainDevice;
use crate::supervisor_thread::SupervisorThread;

impl<L: Links> MainDevice<L> {
    /// The endpoint of the Ethernet to the other MainDevice, for any thread: it works before an application begins,
    /// while it runs, and in both roles. `None` without
    /// [`StandbyOptions::max_acyclic`](super::StandbyOptions::max_acyclic), and after the first call.
    pub fn partner_endpoint(&mut self) -> Option<PartnerEndpoint> {
        self.engine.partner_endpoint()
    }
}

impl<L: Links> Application<L, Inline> {
    /// As [`MainDevice::partner_endpoint`].
    pub fn partner_endpoint(&mut self) -> Option<PartnerEndpoint> {
        self.acyclic.engine.partner_endpoint()
    }
}

impl SupervisorThread {
    /// As [`MainDevice::partner_endpoint`]. A frame that is queued leaves when the thread of the acyclic half works
    /// next, within 5 ms.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn partner_endpoint(&self) -> Result<Option<PartnerEndpoint>, Error> {
        self.act(|engine| engine.partner_endpoint())
    }
}
