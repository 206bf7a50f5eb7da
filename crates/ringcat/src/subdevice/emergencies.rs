//! Emergencies of a SubDevice.

use ringcat_engine::mail::EmergencyRing;

use super::SubDevice;
use crate::services::Services;
use crate::services::key::EngineKey;

impl<S: Services> SubDevice<S> {
    /// The SubDevice's emergencies (CoE). The ring is a handle for any thread: reading, clearing and counting wait for
    /// no other thread. Each emergency is also an [`Event::Emergency`](crate::Event::Emergency).
    ///
    /// ```
    /// use ringcat::{Error, SubDeviceId, SupervisorThread};
    ///
    /// /// Prints the emergencies of a drive, of which up to 200 wait.
    /// fn watch(supervisor: &SupervisorThread, drive: SubDeviceId) -> Result<(), Error> {
    ///     let emergencies = supervisor.subdevice(drive).create_emergency_ring(200)?;
    ///     while let Some(received) = emergencies.pop() {
    ///         println!("{} ns: {:#06x}", received.at.0, received.emergency.error_code);
    ///     }
    ///     println!("{} more were not kept", emergencies.overruns());
    ///     Ok(())
    /// }
    /// ```
    pub fn emergencies(self) -> S::Immediate<EmergencyRing> {
        let address = self.address;
        self.services.immediately(EngineKey, move |engine| engine.emergencies(address))
    }

    /// Keeps further emergencies of the SubDevice in a new ring of this size, at most [`EmergencyRing::MAX_SIZE`]; the
    /// ring before gets no more. With a size of 0 emergencies are only counted and reported as events.
    pub fn create_emergency_ring(self, size: usize) -> S::Immediate<EmergencyRing> {
        let address = self.address;
        self.services.immediately(EngineKey, move |engine| engine.create_emergency_ring(address, size))
    }
}
