//! Memory of the application for process data between two MainDevices, in a declaration (protocol REQ046).

use core::fmt;

use super::image_memory::ImageMemory;
use crate::exchange::PartnerMemory;

/// Memory for process data between two MainDevices cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PartnerMemoryError {
    /// It is shorter than that process data.
    TooShort {
        /// Bytes of the longer direction.
        needed: usize,
        /// Bytes of the shorter memory.
        got: usize,
    },
    /// A copy of the declaration has it, too.
    Shared,
}

impl fmt::Display for PartnerMemoryError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            PartnerMemoryError::TooShort { needed, got } => {
                write!(f, "process data between both MainDevices has {needed} bytes, the memory for it {got}")
            }
            PartnerMemoryError::Shared => f.write_str(
                "a copy of the declaration has the memory for process data between both MainDevices, too: drop it \
                 before",
            ),
        }
    }
}

impl core::error::Error for PartnerMemoryError {}

/// The memory: copies of the declaration share it.
#[derive(Clone, Debug)]
pub(in crate::main_device) struct DeclaredMemory {
    to_partner: ImageMemory,
    from_partner: ImageMemory,
}

impl DeclaredMemory {
    pub fn new(to_partner: &'static mut [u8], from_partner: &'static mut [u8]) -> DeclaredMemory {
        let [to_partner, from_partner] = [to_partner, from_partner].map(ImageMemory::new);
        DeclaredMemory { to_partner, from_partner }
    }

    /// The memory.
    ///
    /// # Errors
    /// A copy of the declaration has it, too. It stays with the copy.
    pub fn take(mut self) -> Result<PartnerMemory, PartnerMemoryError> {
        if !(self.to_partner.is_only() && self.from_partner.is_only()) {
            return Err(PartnerMemoryError::Shared);
        }
        let taken = self.to_partner.into_inner().zip(self.from_partner.into_inner());
        let memory = taken.map(|(to_partner, from_partner)| PartnerMemory { to_partner, from_partner });
        memory.ok_or(PartnerMemoryError::Shared)
    }
}
