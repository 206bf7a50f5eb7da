//! Ethernet between both MainDevices, beside the procedures of the acyclic half (protocol 9.12).

use core::time::Duration;

use ringcat_wire::master_frame::is_master_frame;

use crate::link::{Link, LinkSet};
use crate::main_device::MainDevice;
use crate::ring::Class;
use crate::ring::identity::{Classified, class_of};
use crate::role::MainDeviceRole;
use crate::standby::PartnerEndpoint;
use crate::standby::ethernet::EthernetDue;
use crate::time::Instant;

impl MainDevice {
    /// The endpoint of the Ethernet to the other MainDevice, for any thread. `None` without
    /// [`StandbyOptions::max_acyclic`](super::super::StandbyOptions::max_acyclic), and after the first call.
    pub fn partner_endpoint(&mut self) -> Option<PartnerEndpoint> {
        self.standby.as_mut()?.endpoint.take()
    }

    /// Gives an endpoint of [`MainDevice::partner_endpoint`] back, so that it can be taken again.
    pub fn return_partner_endpoint(&mut self, endpoint: PartnerEndpoint) {
        if let Some(standby) = &mut self.standby {
            standby.endpoint = Some(endpoint);
        }
    }

    /// A copy of an own frame has come back after the role has become INACTIVE: takes an Ethernet frame in it. Any
    /// bytes are allowed.
    pub fn take_returned(&mut self, bytes: &[u8], now: Instant) {
        self.take_ethernet(bytes, now);
    }

    pub(in crate::main_device) fn has_ethernet(&self) -> bool {
        self.standby.as_ref().is_some_and(|standby| standby.ethernet.is_some())
    }

    /// Takes a received frame, if it is an acyclic master frame; false if it is none of this MainDevice.
    pub(in crate::main_device) fn take_ethernet(&mut self, bytes: &[u8], now: Instant) -> bool {
        let Some(ethernet) = self.standby.as_mut().and_then(|standby| standby.ethernet.as_mut()) else { return false };
        if !is_acyclic_master_frame(bytes) {
            return false;
        }
        match self.identity.classify(bytes) {
            Classified::Ours(_) => {
                let is_taken = ethernet.take_own(bytes, now);
                self.poll_ethernet(now);
                is_taken
            }
            Classified::Foreign => {
                ethernet.take_foreign(bytes, now);
                false
            }
            Classified::Other => false,
        }
    }

    /// Takes and fills an acyclic master frame of the ACTIVE before it is forwarded.
    pub(in crate::main_device) fn fill_ethernet(&mut self, frame: &mut [u8], now: Instant) {
        if let Some(ethernet) = self.standby.as_mut().and_then(|standby| standby.ethernet.as_mut())
            && is_acyclic_master_frame(frame)
        {
            ethernet.fill(frame, now);
        }
    }

    /// Sets the period of the cycles, which is that of the master frames.
    pub(in crate::main_device) fn set_ethernet_period(&mut self, period: Duration) {
        if let Some(ethernet) = self.standby.as_mut().and_then(|standby| standby.ethernet.as_mut()) {
            ethernet.set_period(period);
        }
    }

    /// Follows the role, and determines when master frames are due.
    pub(in crate::main_device) fn poll_ethernet(&mut self, now: Instant) {
        let is_active = self.role() == MainDeviceRole::Active;
        let Some(ethernet) = self.standby.as_mut().and_then(|standby| standby.ethernet.as_mut()) else { return };
        let EthernetDue { at, is_now } = ethernet.poll(is_active, now);
        self.supervisor.set_due_beside(at, is_now);
    }

    /// Sends datagrams of procedures and master frames.
    pub(in crate::main_device) fn transmit_with_ethernet(
        &mut self,
        now: Instant,
        budget: usize,
        transmit: &mut impl FnMut(Link, &[u8]),
    ) -> usize {
        let goes_first = self.standby.as_ref().and_then(|it| it.ethernet.as_ref()).is_some_and(|it| it.is_starved(now));
        let first = if goes_first { self.send_ethernet(now, budget, transmit) } else { 0 };
        let mut used = first + self.supervisor.transmit(now, budget - first, transmit);
        if !goes_first {
            used += self.send_ethernet(now, budget.saturating_sub(used), transmit);
        }
        self.poll_ethernet(now);
        used
    }

    fn send_ethernet(&mut self, now: Instant, budget: usize, transmit: &mut impl FnMut(Link, &[u8])) -> usize {
        if self.role() != MainDeviceRole::Active || self.options.links() != LinkSet::Ring {
            return 0;
        }
        let MainDevice { standby, supervisor, .. } = self;
        let Some(ethernet) = standby.as_mut().and_then(|standby| standby.ethernet.as_mut()) else { return 0 };
        ethernet.transmit((now, budget), LinkSet::Ring, || supervisor.take_sequence(), transmit)
    }
}

fn is_acyclic_master_frame(bytes: &[u8]) -> bool {
    is_master_frame(bytes) && class_of(bytes) == Some(Class::Acyclic)
}
