//! Services for a tool that looks at the segment and changes it by hand.

use alloc::vec::Vec;

use ringcat_wire::al::AlState;
use ringcat_wire::frame::{ETHERNET_HEADER_LEN, ETHERTYPE, ETHERTYPE_VLAN, MAX_FRAME};

use crate::declared::Address;
use crate::main_device::MainDevice;
use crate::main_device::pending::Pending;
use crate::procedures::services::ServiceError;
use crate::procedures::services::eeprom_owner::{EepromAssignment, EepromOwnership, owner, set_owner};
use crate::procedures::services::forced_state::{Acknowledge, AlRegisters, force};
use crate::procedures::services::port_report::{self, SubDevicePorts};
use crate::role::Function;
use crate::segment::{Addressed, UndeclaredObservation};
use crate::supervisor::MOST_DEBUG_MESSAGES;

/// Longest text of a debug message.
const LONGEST_TEXT: usize = MAX_FRAME - ETHERNET_HEADER_LEN;
/// Smaller values of the EtherType are lengths (IEEE 802.3).
const FIRST_ETHERTYPE: u16 = 0x0600;

impl MainDevice {
    /// Starts a read of the ports of all SubDevices by position: links, neighbours, delays, receive times, error
    /// counters, with and without an application. Empty before a scan.
    pub fn start_port_report(&mut self) -> Pending<Result<Vec<SubDevicePorts>, ServiceError>> {
        let (bus, segment, permitted) = (self.bus(), self.segment.clone(), self.permit(Function::PortReport));
        self.start(async move {
            permitted?;
            port_report::read(&bus, &segment).await
        })
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
    ) -> Pending<Result<AlRegisters, ServiceError>> {
        let subdevice = subdevice.into();
        if let (Ok(()), Ok(Addressed::Undeclared(key))) = (self.permit(Function::ForcedState), self.find(subdevice)) {
            self.segment.observe_undeclared(UndeclaredObservation::Forced(key));
        }
        let function = Function::ForcedState;
        self.start_on(
            function,
            subdevice,
            move |bus, station| async move { force(&bus, station, state, acknowledge).await },
        )
    }

    /// Starts to send an Ethernet frame with a text on each link, in the window of acyclic frames: a mark in captures.
    /// Taps show it, and captures up to the first processing unit, which destroys it and counts an error (register
    /// 0x030C); with bit 0 of DL_CONTROL cleared SubDevices pass it on unchanged (protocol 2.6). What comes back is
    /// ignored. The result is there when it is queued.
    ///
    /// # Errors
    /// [`ServiceError::EtherType`], [`ServiceError::TooLong`], or [`ServiceError::TooMany`] if 16 messages wait.
    pub fn start_debug_message(&mut self, ethertype: u16, text: &[u8]) -> Pending<Result<(), ServiceError>> {
        let result = self.queue_debug_message(ethertype, text);
        self.start(async move { result })
    }

    fn queue_debug_message(&self, ethertype: u16, text: &[u8]) -> Result<(), ServiceError> {
        self.permit(Function::DebugMessage)?;
        if ethertype < FIRST_ETHERTYPE || [ETHERTYPE, ETHERTYPE_VLAN].contains(&ethertype) {
            return Err(ServiceError::EtherType { ethertype });
        }
        if text.len() > LONGEST_TEXT {
            return Err(ServiceError::TooLong { got: text.len(), limit: LONGEST_TEXT });
        }
        let sources = [Some(self.options.main), self.options.redundant];
        let limit = MOST_DEBUG_MESSAGES;
        let is_queued = self.supervisor.queue_debug_message(sources, ethertype, text);
        if is_queued { Ok(()) } else { Err(ServiceError::TooMany { got: limit + 1, limit }) }
    }

    /// Starts a read of the owner of an EEPROM: EtherCAT or the PDI.
    pub fn start_eeprom_owner_read(
        &mut self,
        subdevice: impl Into<Address>,
    ) -> Pending<Result<EepromOwnership, ServiceError>> {
        self.start_on(Function::EepromOwner, subdevice, |bus, station| async move { owner(&bus, station).await })
    }

    /// Starts to assign an EEPROM to EtherCAT or to the PDI; the result is the owner afterwards. Functions that read or
    /// write the EEPROM take it by force and give it back. State changes assign it as well (protocol 5.6).
    pub fn start_eeprom_assignment(
        &mut self,
        subdevice: impl Into<Address>,
        assignment: EepromAssignment,
    ) -> Pending<Result<EepromOwnership, ServiceError>> {
        let eeproms = self.segment.eeproms.clone();
        self.start_on(Function::EepromOwner, subdevice, move |bus, station| async move {
            let _turn = eeproms.take(station).await;
            set_owner(&bus, station, assignment).await
        })
    }
}
