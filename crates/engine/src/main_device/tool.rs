//! Services for a tool that looks at the segment and changes it by hand.

use alloc::vec::Vec;

use ringcat_wire::al::{AlState, AlStatus, AlStatusCode};

use super::MainDevice;
use super::pending::Pending;
use crate::declared::Address;
use crate::procedures::services::ServiceError;
use crate::procedures::services::eeprom_owner::{EepromAssignment, EepromOwnership, owner, set_owner};
use crate::procedures::services::forced_state::{Acknowledge, force};
use crate::procedures::services::port_report::{self, SubDevicePorts};
use crate::segment::{Addressed, UndeclaredObservation};

impl MainDevice {
    /// Starts a read of the ports of all SubDevices by position: links, neighbours, delays, receive times, error
    /// counters, with and without an application. Empty before a scan.
    pub fn start_port_report(&mut self) -> Pending<Result<Vec<SubDevicePorts>, ServiceError>> {
        let (bus, segment) = (self.bus(), self.segment.clone());
        self.start(async move { port_report::read(&bus, &segment).await })
    }

    /// Starts to write a state to AL control of a SubDevice once, without the steps between and without its
    /// configuration; the result is what the SubDevice shows right after. A SubDevice without a declaration is then
    /// left as it is until another state is requested. A declared one is brought back to its target state by the
    /// supervision.
    ///
    /// # Danger
    /// Outputs may switch, and a SubDevice may reach OP with a configuration that nothing has checked: for tests and
    /// maintenance of a machine that is secured.
    pub fn start_forced_state(
        &mut self,
        subdevice: impl Into<Address>,
        state: AlState,
        acknowledge: Acknowledge,
    ) -> Pending<Result<(AlStatus, AlStatusCode), ServiceError>> {
        let subdevice = subdevice.into();
        if let Ok(Addressed::Undeclared(key)) = self.find(subdevice) {
            self.segment.observe_undeclared(UndeclaredObservation::Forced(key));
        }
        self.start_on(subdevice, move |bus, station| async move { force(&bus, station, state, acknowledge).await })
    }

    /// Starts a read of the owner of an EEPROM: EtherCAT or the PDI.
    pub fn start_eeprom_owner_read(
        &mut self,
        subdevice: impl Into<Address>,
    ) -> Pending<Result<EepromOwnership, ServiceError>> {
        self.start_on(subdevice, |bus, station| async move { owner(&bus, station).await })
    }

    /// Starts to assign an EEPROM to EtherCAT or to the PDI; the result is the owner afterwards. Functions that read or
    /// write the EEPROM take it by force and give it back. State changes assign it as well (protocol 5.6).
    pub fn start_eeprom_assignment(
        &mut self,
        subdevice: impl Into<Address>,
        assignment: EepromAssignment,
    ) -> Pending<Result<EepromOwnership, ServiceError>> {
        let eeproms = self.segment.eeproms.clone();
        self.start_on(subdevice, move |bus, station| async move {
            let _turn = eeproms.take(station).await;
            set_owner(&bus, station, assignment).await
        })
    }
}
