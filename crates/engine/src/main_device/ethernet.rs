//! Ethernet of declared SubDevices: one port for each that supports it.

use alloc::vec::Vec;

use ringcat_wire::address::Position;
use ringcat_wire::sii::MailboxProtocols;

use super::MainDevice;
use crate::declared::{Address, SubDeviceId};
use crate::mail::eoe::EthernetPort;

/// A SubDevice that supports Ethernet frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct EthernetSubDevice {
    /// Index in the declaration.
    pub subdevice: SubDeviceId,
    /// Position in the scan's order.
    pub position: Position,
    /// Alias; 0 is none.
    pub alias: u16,
}

impl EthernetSubDevice {
    /// A SubDevice by its index, its position and its alias (0: none).
    pub const fn new(subdevice: SubDeviceId, position: Position, alias: u16) -> EthernetSubDevice {
        EthernetSubDevice { subdevice, position, alias }
    }
}

impl MainDevice {
    /// Declared SubDevices that were seen and whose SII offers EoE, whether they answer now or not; none before
    /// activation.
    pub fn ethernet_subdevices(&self) -> Vec<EthernetSubDevice> {
        let Some(segment) = self.active() else { return Vec::new() };
        let access = segment.view();
        let members = access.members().enumerate();
        members
            .filter_map(|(subdevice, member)| {
                let info = member.info?;
                let speaks = info.protocols.0 & MailboxProtocols::EOE != 0 && info.mailbox.is_some();
                let (position, alias) = (info.position, info.alias);
                speaks.then_some(EthernetSubDevice { subdevice: SubDeviceId(subdevice), position, alias })
            })
            .collect()
    }

    /// The Ethernet of a declared SubDevice. Its port is opened at the first call and lasts until the MainDevice stops;
    /// `None` if no such SubDevice is declared, or this mailbox has a port already.
    pub fn ethernet_port(&mut self, subdevice: impl Into<Address>) -> Option<&EthernetPort> {
        let index = self.find_member(subdevice).ok()?;
        if !self.ports.contains_key(&index) {
            let port = EthernetPort::open(&self.segment.mailbox(index)?)?;
            self.ports.insert(index, port);
        }
        self.ports.get(&index)
    }
}
