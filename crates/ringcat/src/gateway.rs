//! The mailbox gateway of a MainDevice with its acyclic half in its own thread; [`ringcat_gateway`] serves the clients.

pub use ringcat_gateway::{Gateway, GatewayCounters, GatewayOptions, RelayCounters};

use crate::error::Error;
use crate::supervisor_thread::SupervisorThread;

impl SupervisorThread {
    /// Opens the mailbox gateway. SubDevices answer from activation on, or with
    /// [`Options::idle_operation`](crate::Options) as soon as they are in PREOP, declared or not.
    ///
    /// # Errors
    /// The address cannot be bound, the system cannot start a thread, or the thread of the acyclic half has ended.
    pub fn start_gateway(&self, options: GatewayOptions) -> Result<Gateway, Error> {
        let failed = |cause| Error::Gateway { address: options.address, cause };
        let (gateway, mut passage) = Gateway::open(options, self.waker()).map_err(failed)?;
        self.attend(move |engine, _| passage.work(engine))?;
        Ok(gateway)
    }
}
