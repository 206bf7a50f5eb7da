//! Registers that are written or looked at whenever a SubDevice passes a transition: raw commands of a configuration
//! file (ECatCmd of ETG.2100, protocol 8.2).

use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::RegisterAddress;
use ringcat_wire::datagram::MAX_DATA;

/// What a command does with a register.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RegisterAccess {
    /// Writes it.
    Write(Vec<u8>),
    /// Reads it until what comes, masked, is what is expected.
    Check {
        /// What is expected.
        data: Vec<u8>,
        /// Bits that count; all of them where there is none. As long as the data.
        mask: Option<Vec<u8>>,
        /// So long the value may take to come; zero looks once.
        limit: Duration,
    },
}

/// A command to a register of one SubDevice.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RegisterCommand {
    /// The first register.
    pub address: RegisterAddress,
    /// What is done with it.
    pub access: RegisterAccess,
    /// How often a command is sent again that the SubDevice did not take.
    pub retries: u8,
    /// The SubDevice must take it; otherwise a write that it does not take is none of our concern (without `Cnt` in the
    /// file). What is checked must always be answered.
    pub required: bool,
}

impl RegisterCommand {
    /// Bytes of data and of the mask.
    pub fn lengths(&self) -> (usize, Option<usize>) {
        match &self.access {
            RegisterAccess::Write(data) => (data.len(), None),
            RegisterAccess::Check { data, mask, .. } => (data.len(), mask.as_ref().map(Vec::len)),
        }
    }

    /// Whether it can be sent.
    pub(crate) fn is_sound(&self) -> bool {
        let (data, mask) = self.lengths();
        let fits = (1..=MAX_DATA).contains(&data) && usize::from(self.address.0) + data <= 0x1_0000;
        fits && mask.is_none_or(|mask| mask == data)
    }
}
