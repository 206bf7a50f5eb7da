//! What can be asked of one SubDevice besides its mailbox (000 10.8): registers, ports, resets, error counters, its EEPROM.

pub mod registers;

use core::fmt;

use crate::supervisor::BusError;

/// Why a service was not done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ServiceError {
    /// Nobody is declared, or was found, with this number.
    NoSubDevice {
        /// The number.
        subdevice: usize,
    },
    /// The bus failed, or the SubDevice does not answer.
    Bus(BusError),
    /// The address and the length leave the memory of 64 KiB.
    Range {
        /// The first byte.
        address: u16,
        /// Bytes.
        length: usize,
    },
}

impl fmt::Display for ServiceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ServiceError::NoSubDevice { subdevice } => write!(f, "there is no SubDevice {subdevice}"),
            ServiceError::Bus(error) => error.fmt(f),
            ServiceError::Range { address, length } => {
                write!(f, "{length} bytes from {address:#06x} on: the memory ends at 0xffff")
            }
        }
    }
}

impl core::error::Error for ServiceError {}

impl From<BusError> for ServiceError {
    fn from(error: BusError) -> ServiceError {
        ServiceError::Bus(error)
    }
}
