//! SoE, AoE and VoE: IDNs of drives, ADS requests, messages of vendors.

use ringcat_engine::mail::aoe::{self, AoeDeviceInfo, AoeRoute, AoeStates};
use ringcat_engine::mail::soe::command::{self, CommandState};
use ringcat_engine::mail::soe::{self, SoeAddress};
use ringcat_engine::mail::voe::{self, Voe};
use ringcat_wire::mailbox::soe::Idn;

use super::{SubDevice, SubDeviceError, SubDeviceFailure};
use crate::services::Services;
use crate::value::ObjectValue;

impl<S: Services> SubDevice<S> {
    /// Reads the value of an IDN of a drive, 0 to 7.
    pub fn soe_read<T: ObjectValue>(self, drive: u8, idn: Idn) -> S::Outcome<T, SubDeviceError> {
        let limits = self.limits;
        self.ask_mailbox(move |mailbox| async move {
            let address = SoeAddress::value(drive, idn);
            let bytes = soe::read(&mailbox, address, limits.of_message(), limits.bytes).await?;
            match T::BYTES.filter(|expected| *expected != bytes.len()) {
                Some(expected) => {
                    Err(SubDeviceFailure::Size { what: format!("SoE {address}"), expected, got: bytes.len() })
                }
                None => Ok(T::decode(bytes)),
            }
        })
    }

    /// Writes the value of an IDN of a drive, 0 to 7.
    pub fn soe_write<T: ObjectValue>(self, drive: u8, idn: Idn, value: T) -> S::Outcome<(), SubDeviceError> {
        let limits = self.limits.of_message();
        let data = value.encode();
        self.ask_mailbox(move |mailbox| async move {
            soe::write(&mailbox, SoeAddress::value(drive, idn), &data, limits).await
        })
    }

    /// Reads elements of an IDN: name, attribute, unit, minimum, maximum, or several at once.
    pub fn soe_read_elements(self, address: SoeAddress) -> S::Outcome<Vec<u8>, SubDeviceError> {
        let limits = self.limits;
        self.ask_mailbox(
            move |mailbox| async move { soe::read(&mailbox, address, limits.of_message(), limits.bytes).await },
        )
    }

    /// Writes an element of an IDN other than its value, such as a limit that is not protected.
    pub fn soe_write_elements(self, address: SoeAddress, data: Vec<u8>) -> S::Outcome<(), SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { soe::write(&mailbox, address, &data, limits).await })
    }

    /// Starts the procedure command of an IDN.
    pub fn soe_command(self, drive: u8, idn: Idn) -> S::Outcome<(), SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { command::start(&mailbox, drive, idn, limits).await })
    }

    /// Reads the state of a procedure command.
    pub fn soe_command_state(self, drive: u8, idn: Idn) -> S::Outcome<CommandState, SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { command::state(&mailbox, drive, idn, limits).await })
    }

    /// Ends a procedure command.
    pub fn soe_abort_command(self, drive: u8, idn: Idn) -> S::Outcome<(), SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { command::abort(&mailbox, drive, idn, limits).await })
    }

    /// Reads `length` bytes at most by ADS.
    pub fn aoe_read(
        self,
        route: AoeRoute,
        group: u32,
        offset: u32,
        length: u32,
    ) -> S::Outcome<Vec<u8>, SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(
            move |mailbox| async move { aoe::read(&mailbox, route, (group, offset), length, limits).await },
        )
    }

    /// Writes by ADS.
    pub fn aoe_write(self, route: AoeRoute, group: u32, offset: u32, data: Vec<u8>) -> S::Outcome<(), SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(
            move |mailbox| async move { aoe::write(&mailbox, route, (group, offset), &data, limits).await },
        )
    }

    /// Writes by ADS, then reads `length` bytes at most, in one request.
    pub fn aoe_read_write(
        self,
        route: AoeRoute,
        group: u32,
        offset: u32,
        data: Vec<u8>,
        length: u32,
    ) -> S::Outcome<Vec<u8>, SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move {
            aoe::read_write(&mailbox, route, (group, offset), length, &data, limits).await
        })
    }

    /// The states of ADS and of an ADS device.
    pub fn aoe_states(self, route: AoeRoute) -> S::Outcome<AoeStates, SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { aoe::read_state(&mailbox, route, limits).await })
    }

    /// Requests states of ADS and of an ADS device, with data in the device's own form.
    pub fn aoe_set_states(self, route: AoeRoute, states: AoeStates, data: Vec<u8>) -> S::Outcome<(), SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { aoe::write_control(&mailbox, route, states, &data, limits).await })
    }

    /// Name and version of an ADS device.
    pub fn aoe_device_info(self, route: AoeRoute) -> S::Outcome<AoeDeviceInfo, SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { aoe::read_device_info(&mailbox, route, limits).await })
    }

    /// Sends a message of a vendor and waits for the vendor's next one.
    pub fn voe_exchange(self, message: Voe) -> S::Outcome<Voe, SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { voe::exchange(&mailbox, &message, limits).await })
    }

    /// Sends a message of a vendor that is not answered.
    pub fn voe_send(self, message: Voe) -> S::Outcome<(), SubDeviceError> {
        let limit = self.limits.request;
        self.ask_mailbox(move |mailbox| async move { voe::send(&mailbox, &message, limit).await })
    }
}
