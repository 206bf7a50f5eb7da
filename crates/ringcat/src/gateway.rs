//! The mailbox gateway of a MainDevice whose acyclic half has a thread of its own; its clients are
//! [`ringcat_gateway`]'s.

pub use ringcat_gateway::{Gateway, GatewayCounters, GatewayOptions, RelayCounters};

use crate::error::Error;
use crate::supervisor_thread::SupervisorThread;

impl SupervisorThread {
    /// Opens the mailbox gateway. SubDevices answer from activation on.
    ///
    /// # Errors
    /// The address cannot be listened on, the system has no more threads, or the thread of the acyclic half is gone.
    pub fn start_gateway(&self, options: GatewayOptions) -> Result<Gateway, Error> {
        let failed = |cause| Error::Gateway { address: options.address, cause };
        let (gateway, mut passage) = Gateway::open(options).map_err(failed)?;
        self.attend(move |engine, _| passage.work(engine))?;
        Ok(gateway)
    }
}
