//! Memory of the application for the images of domains, and for process data between two MainDevices: declared before,
//! used from the activation on.
//!
//! The memory outlives the application: it is valid before the activation and after the end. Another process may map
//! it, or a C program may own it.

use alloc::vec::Vec;

use super::image_memory::ImageMemory;
#[cfg(feature = "standby")]
use super::partner_memory::{DeclaredMemory, PartnerMemoryError};
use crate::domain::DomainId;
#[cfg(feature = "standby")]
use crate::exchange::PartnerMemory;
use crate::layout::Layout;
use crate::main_device::activate::activate_error::ActivateError;
use crate::main_device::declaration::{Declaration, DomainConfig};

impl Declaration {
    /// Puts the image of a domain into memory of the application, which outlives the MainDevice: leaked, static, or
    /// mapped into several processes. The image is the beginning of the memory, with the content that it has at the
    /// activation: outputs in it leave with the first cycle. The activation refuses memory that is shorter than the
    /// image ([`Declaration::image_bytes`] for registered process data).
    ///
    /// The memory stays valid after the end of the application, with the last outputs and inputs;
    /// [`crate::exchange::Exchange::give_memory_back`] gives it back. Without such a domain, nothing happens.
    ///
    /// ```
    /// use core::time::Duration;
    /// use ringcat_engine::main_device::Declaration;
    ///
    /// let mut declaration = Declaration::default();
    /// let domain = declaration.add_domain(Duration::from_millis(1));
    /// declaration.place_image(domain, Vec::leak(vec![0; 64]));
    /// ```
    pub fn place_image(&mut self, domain: DomainId, memory: &'static mut [u8]) {
        if let Some(domain) = self.domains.get_mut(domain.0) {
            domain.memory = Some(ImageMemory::new(memory));
        }
    }

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
    #[cfg(feature = "standby")]
    pub fn place_partner_data(&mut self, to_partner: &'static mut [u8], from_partner: &'static mut [u8]) {
        self.partner_memory = Some(DeclaredMemory::new(to_partner, from_partner));
    }
}

/// Memory of a loaded declaration.
#[derive(Debug, Default)]
pub(in crate::main_device) struct Memories {
    /// By domain.
    pub images: Vec<Option<&'static mut [u8]>>,
    /// For process data between both.
    #[cfg(feature = "standby")]
    pub partner: Option<PartnerMemory>,
}

impl Memories {
    /// Takes the memory out of a declaration.
    ///
    /// # Errors
    /// A copy of the declaration has the memory too. The memory stays with the copy.
    pub fn of(declaration: &mut Declaration) -> Result<Memories, ActivateError> {
        let is_shared = |domain: &mut DomainConfig| domain.memory.as_mut().is_some_and(|memory| !memory.is_only());
        let shared = declaration.domains.iter_mut().position(is_shared);
        if let Some(domain) = shared {
            return Err(ActivateError::MemoryShared { domain: DomainId(domain) });
        }
        #[cfg(feature = "standby")]
        let partner = declaration.partner_memory.take().map(DeclaredMemory::take).transpose();
        #[cfg(feature = "standby")]
        let partner = partner.map_err(ActivateError::PartnerMemory)?;
        let taken = declaration.domains.iter_mut().map(|domain| domain.memory.take()?.into_inner());
        Ok(Memories {
            images: taken.collect(),
            #[cfg(feature = "standby")]
            partner,
        })
    }

    /// Checks that each image fits.
    ///
    /// # Errors
    /// Memory is shorter than the image of its domain.
    pub fn check(&self, layout: &Layout) -> Result<(), ActivateError> {
        for (domain, (memory, planned)) in self.images.iter().zip(&layout.domains).enumerate() {
            let needed = planned.image_len as usize;
            if let Some(got) = memory.as_ref().map(|memory| memory.len()).filter(|got| *got < needed) {
                return Err(ActivateError::MemoryTooShort { domain: DomainId(domain), needed, got });
            }
        }
        Ok(())
    }

    /// Checks that process data between both MainDevices fits, of which the longer direction has this many bytes.
    ///
    /// # Errors
    /// One of both memories is shorter.
    #[cfg(feature = "standby")]
    pub fn check_partner(&self, needed: usize) -> Result<(), ActivateError> {
        let Some(PartnerMemory { to_partner, from_partner }) = &self.partner else { return Ok(()) };
        let got = to_partner.len().min(from_partner.len());
        let error = PartnerMemoryError::TooShort { needed, got };
        if got < needed { Err(ActivateError::PartnerMemory(error)) } else { Ok(()) }
    }

    /// Takes the memory of all images.
    pub fn take(&mut self) -> impl Iterator<Item = (DomainId, &'static mut [u8])> + use<> {
        let all = core::mem::take(&mut self.images).into_iter().enumerate();
        all.filter_map(|(domain, memory)| Some((DomainId(domain), memory?)))
    }
}
