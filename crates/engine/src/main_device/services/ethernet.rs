//! Ethernet of SubDevices, declared or not: one port for each that supports it.

use alloc::rc::Rc;
use alloc::vec::Vec;

use ringcat_wire::address::Position;
use ringcat_wire::sii::MailboxProtocols;

use crate::declared::{Address, SubDeviceId};
use crate::info::SubDeviceInfo;
use crate::mail::eoe::EthernetPort;
use crate::main_device::MainDevice;
use crate::role::Function;

/// A SubDevice that supports Ethernet frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct EthernetSubDevice {
    /// Its index in the active declaration, or its position if it has no declaration.
    pub subdevice: Address,
    /// Position in the scan's order.
    pub position: Position,
    /// Alias; 0 is none.
    pub alias: u16,
}

impl EthernetSubDevice {
    /// A SubDevice by its address, its position and its alias (0: none).
    pub fn new(subdevice: impl Into<Address>, position: Position, alias: u16) -> EthernetSubDevice {
        EthernetSubDevice { subdevice: subdevice.into(), position, alias }
    }

    /// Whether it is the same SubDevice at the same position, declared or not.
    pub fn is_at_place_of(&self, other: &EthernetSubDevice) -> bool {
        (self.position, self.alias) == (other.position, other.alias)
    }
}

impl MainDevice {
    /// SubDevices whose SII offers EoE, whether they answer now or not: declared ones that were seen, and with idle
    /// operation those without a declaration.
    pub fn ethernet_subdevices(&self) -> Vec<EthernetSubDevice> {
        let mut all = Vec::new();
        let mut add = |subdevice: Address, position: Position, info: &SubDeviceInfo| {
            if info.protocols.0 & MailboxProtocols::EOE != 0 && info.mailbox.is_some() {
                all.push(EthernetSubDevice { subdevice, position, alias: info.alias });
            }
        };
        let view = self.segment.view();
        if view.is_active() {
            for (index, member) in view.members().enumerate() {
                member.info.into_iter().for_each(|info| add(SubDeviceId(index).into(), info.position, info));
            }
        }
        let undeclared: Vec<(Position, Rc<SubDeviceInfo>)> = match view.found().filter(|_| !view.is_active()) {
            _ if !self.options.idle_operation => Vec::new(),
            // After a deactivation mailboxes open one after the other: each SubDevice stays in the list meanwhile.
            Some(found) => (0..).map(Position).zip(found.subdevices.iter().cloned()).collect(),
            None => {
                let with_mailbox = view.subdevices().unassigned().filter(|it| it.upkeep.is_some());
                with_mailbox.filter_map(|it| Some((it.position, it.knowledge.info()?.clone()))).collect()
            }
        };
        for (position, info) in &undeclared {
            add((*position).into(), *position, info);
        }
        all
    }

    /// The Ethernet of a SubDevice. Its port is opened at the first call. It lasts until the SubDevice has another
    /// mailbox, which is when a declaration with it begins or ends, or until the MainDevice stops. `None` if the
    /// SubDevice has no mailbox, if this mailbox has another port, and in role INACTIVE.
    pub fn ethernet_port(&mut self, subdevice: impl Into<Address>) -> Option<&EthernetPort> {
        self.permit(Function::Ethernet).ok()?;
        let subdevice = self.find(subdevice).ok()?;
        let mailbox = self.segment.mailbox_of(subdevice)?;
        // The station address stays when SubDevices before this one come or go; the position does not.
        let station = self.segment.view().station(subdevice)?;
        let is_current = self.ports.get(&station).is_some_and(|port| port.is_of(&mailbox));
        if !is_current {
            let view = self.segment.view();
            self.ports.retain(|other, _| *other != station && view.has_station(*other));
            self.ports.insert(station, EthernetPort::open(&mailbox)?);
        }
        self.ports.get(&station)
    }
}
