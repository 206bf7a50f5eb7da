//! Memory of the application for process data between two MainDevices (protocol REQ046).

use super::Declaration;
use super::image_memory::ImageMemory;
use crate::main_device::activate::activate_error::ActivateError;

/// Memory of the application for process data between two MainDevices.
#[derive(Debug)]
pub struct PartnerMemory {
    /// What the application sends, in either role.
    pub to_partner: &'static mut [u8],
    /// What has arrived, in either role.
    pub from_partner: &'static mut [u8],
}

/// The same in a declaration: copies share it.
#[derive(Clone, Debug)]
pub(in crate::main_device) struct DeclaredMemory {
    to_partner: ImageMemory,
    from_partner: ImageMemory,
}

impl Declaration {
    /// Puts process data for the other MainDevice, and of it, into memory of the application, which outlives the
    /// MainDevice: leaked, static, or mapped into several processes. Each memory has at least the longer one of both
    /// sizes ([`MasterSizes`](crate::layout::MasterSizes)); the activation refuses shorter ones. Without a second
    /// MainDevice, nothing happens.
    ///
    /// What is in `to_partner` when a cycle leaves (as ACTIVE), or when the first master frame of a cycle arrives (as
    /// INACTIVE), is sent; a change of the role does not change it. `from_partner` has the last cycle of which all has
    /// arrived. It changes within a cycle before the application works, and, as ACTIVE, when the last master frame
    /// comes back; never while the application works. Another process reads it while no cycle runs, or has a lock of
    /// its own with the application.
    ///
    /// ```
    /// use ringcat_engine::main_device::Declaration;
    ///
    /// let mut declaration = Declaration::default();
    /// declaration.place_partner_data(Vec::leak(vec![0; 64]), Vec::leak(vec![0; 64]));
    /// ```
    pub fn place_partner_data(&mut self, to_partner: &'static mut [u8], from_partner: &'static mut [u8]) {
        let [to_partner, from_partner] = [to_partner, from_partner].map(ImageMemory::new);
        self.partner_memory = Some(DeclaredMemory { to_partner, from_partner });
    }

    /// Takes the memory.
    ///
    /// # Errors
    /// A copy of the declaration has the memory too. The memory stays with the copy.
    pub(super) fn take_partner_memory(&mut self) -> Result<Option<PartnerMemory>, ActivateError> {
        let Some(mut memory) = self.partner_memory.take() else { return Ok(None) };
        if !(memory.to_partner.is_only() && memory.from_partner.is_only()) {
            return Err(ActivateError::PartnerMemoryShared);
        }
        let taken = memory.to_partner.into_inner().zip(memory.from_partner.into_inner());
        Ok(taken.map(|(to_partner, from_partner)| PartnerMemory { to_partner, from_partner }))
    }
}
