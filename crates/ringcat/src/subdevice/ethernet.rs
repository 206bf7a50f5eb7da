//! EoE: IP parameters and address filters of a SubDevice. Its frames pass through interfaces, see [`crate::eoe`].

use ringcat_engine::config::IpSettings;
use ringcat_engine::mail::eoe;
use ringcat_wire::mailbox::eoe::AddressFilter;

use super::{SubDevice, SubDeviceError};
use crate::services::Services;

impl<S: Services> SubDevice<S> {
    /// Sets the IP parameters at a port of the SubDevice; 0 is the SubDevice itself, or any port.
    pub fn eoe_set_ip(self, port: u8, settings: IpSettings) -> S::Outcome<(), SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { eoe::set_ip(&mailbox, port, &settings, limits).await })
    }

    /// Reads the IP parameters at a port of the SubDevice.
    pub fn eoe_ip(self, port: u8) -> S::Outcome<IpSettings, SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { eoe::read_ip(&mailbox, port, limits).await })
    }

    /// Sets the address filter of a port of the SubDevice.
    pub fn eoe_set_filter(self, port: u8, filter: AddressFilter) -> S::Outcome<(), SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { eoe::set_filter(&mailbox, port, filter, limits).await })
    }

    /// Reads the address filter of a port of the SubDevice.
    pub fn eoe_filter(self, port: u8) -> S::Outcome<AddressFilter, SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { eoe::read_filter(&mailbox, port, limits).await })
    }
}
