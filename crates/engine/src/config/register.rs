//! Register commands at a transition of a SubDevice: raw commands of a configuration file (ECatCmd of ETG.2100,
//! protocol 8.2), which write or check a register at each pass.

use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::RegisterAddress;
use ringcat_wire::datagram::MAX_DATA;

/// Action of a command on a register.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum RegisterAccess {
    /// Writes data.
    Write(Vec<u8>),
    /// Reads until the masked data is as expected.
    Check {
        /// Expected data.
        data: Vec<u8>,
        /// Mask of the compared bits, as long as the data; without a mask all bits are compared.
        mask: Option<Vec<u8>>,
        /// Time limit until the data is as expected; zero reads once.
        limit: Duration,
    },
}

/// A command to a register of one SubDevice.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct RegisterCommand {
    /// Address of the first register.
    pub address: RegisterAddress,
    /// Action.
    pub access: RegisterAccess,
    /// Number of retries for a command that the SubDevice did not process.
    pub retries: u16,
    /// The SubDevice must process the write. Otherwise a write that it did not process is ignored (no `Cnt` in the
    /// file). A check always needs a response.
    pub required: bool,
}

impl RegisterCommand {
    /// A command without retries, which the SubDevice need not process.
    pub const fn new(address: RegisterAddress, access: RegisterAccess) -> RegisterCommand {
        RegisterCommand { address, access, retries: 0, required: false }
    }

    /// Sets [`RegisterCommand::retries`].
    #[must_use]
    pub const fn with_retries(mut self, retries: u16) -> RegisterCommand {
        self.retries = retries;
        self
    }

    /// Sets [`RegisterCommand::required`].
    #[must_use]
    pub const fn with_required(mut self, required: bool) -> RegisterCommand {
        self.required = required;
        self
    }

    /// Length of data and mask in bytes.
    pub(crate) fn lengths(&self) -> (usize, Option<usize>) {
        match &self.access {
            RegisterAccess::Write(data) => (data.len(), None),
            RegisterAccess::Check { data, mask, .. } => (data.len(), mask.as_ref().map(Vec::len)),
        }
    }

    /// Whether it is valid.
    pub(crate) fn is_sound(&self) -> bool {
        let (data, mask) = self.lengths();
        let fits = (1..=MAX_DATA).contains(&data) && usize::from(self.address.0) + data <= 0x1_0000;
        fits && mask.is_none_or(|mask| mask == data)
    }
}
