//! Process data for the other MainDevice and of it, in own memory or in memory of the application (protocol FR-15,
//! REQ046).
//!
//! What leaves and what has arrived are two memories, whatever the role is; each is as long as the longer one of both
//! directions. What arrives is collected elsewhere, and copied when all of it is there: memory never has parts of two
//! cycles.

use alloc::vec;

use ringcat_wire::master_frame::Lengths;

use crate::exchange::image::Bytes;
use crate::role::MainDeviceRole;

/// Memory of the application for process data between two MainDevices.
#[derive(Debug)]
#[non_exhaustive]
pub struct PartnerMemory {
    /// What the application sends, in either role.
    pub to_partner: &'static mut [u8],
    /// What has arrived, in either role.
    pub from_partner: &'static mut [u8],
}

/// Process data between both.
#[derive(Debug)]
pub(in crate::exchange) struct PartnerData {
    lengths: [usize; 2],
    to: Bytes,
    from: Bytes,
}

impl PartnerData {
    /// In own memory: zeros.
    pub fn new(lengths: &Lengths) -> PartnerData {
        let lengths = [lengths.to_inactive as usize, lengths.to_active as usize];
        let [to, from] = [(); 2].map(|()| Bytes::Own(vec![0; lengths[0].max(lengths[1])].into_boxed_slice()));
        PartnerData { lengths, to, from }
    }

    /// From now on in memory of the application. False if it is too short: then nothing changes.
    pub fn place(&mut self, memory: PartnerMemory) -> bool {
        let PartnerMemory { to_partner, from_partner } = memory;
        let needed = self.to.len();
        let (Some((to, _)), Some((from, _))) =
            (to_partner.split_at_mut_checked(needed), from_partner.split_at_mut_checked(needed))
        else {
            return false;
        };
        (self.to, self.from) = (Bytes::Given(to), Bytes::Given(from));
        true
    }

    /// Gives memory of the application back.
    pub fn give_back(&mut self) -> Option<PartnerMemory> {
        let (to_partner, from_partner) = self.to.give_back().zip(self.from.give_back())?;
        Some(PartnerMemory { to_partner, from_partner })
    }

    /// What leaves in a role.
    pub fn outgoing(&self, role: MainDeviceRole) -> &[u8] {
        &self.to[..self.lengths[usize::from(role == MainDeviceRole::Inactive)]]
    }

    /// The same, to be written.
    pub fn outgoing_mut(&mut self, role: MainDeviceRole) -> &mut [u8] {
        &mut self.to[..self.lengths[usize::from(role == MainDeviceRole::Inactive)]]
    }

    /// What arrives in a role.
    pub fn incoming(&self, role: MainDeviceRole) -> &[u8] {
        &self.from[..self.lengths[usize::from(role == MainDeviceRole::Active)]]
    }

    /// The same, to be written.
    pub fn incoming_mut(&mut self, role: MainDeviceRole) -> &mut [u8] {
        &mut self.from[..self.lengths[usize::from(role == MainDeviceRole::Active)]]
    }
}
