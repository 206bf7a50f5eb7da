//! Why a command to a register failed.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;

use ringcat_wire::address::RegisterAddress;

use crate::supervisor::BusError;

/// A command to a register that failed.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct RegisterCommandError {
    /// The first register.
    pub address: RegisterAddress,
    /// The error.
    pub cause: RegisterFailure,
}

/// Why a command to a register failed.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum RegisterFailure {
    /// The SubDevice did not process it, or the bus failed.
    Bus(BusError),
    /// The register holds another value.
    Value(Box<WrongValue>),
}

/// The value of a register and the required value.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct WrongValue {
    /// The required value.
    pub expected: Vec<u8>,
    /// Compared bits.
    pub mask: Option<Vec<u8>>,
    /// The last value read.
    pub got: Vec<u8>,
    /// The time limit.
    pub limit: Duration,
}

impl fmt::Display for RegisterCommandError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "register {}: {}", self.address, self.cause)
    }
}

impl fmt::Display for RegisterFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RegisterFailure::Bus(error) => error.fmt(f),
            RegisterFailure::Value(wrong) => {
                write!(f, "expected {}", Hex(&wrong.expected))?;
                if let Some(mask) = &wrong.mask {
                    write!(f, " (mask {})", Hex(mask))?;
                }
                write!(f, " within {} ms, got {}", wrong.limit.as_millis(), Hex(&wrong.got))
            }
        }
    }
}

impl core::error::Error for RegisterCommandError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        Some(&self.cause)
    }
}

impl core::error::Error for RegisterFailure {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            RegisterFailure::Bus(error) => Some(error),
            RegisterFailure::Value(_) => None,
        }
    }
}

/// The first bytes of data, in memory order.
pub(super) struct Hex<'a>(pub &'a [u8]);

impl fmt::Display for Hex<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        /// Number of bytes shown.
        const SHOWN: usize = 16;
        for (number, byte) in self.0.iter().take(SHOWN).enumerate() {
            write!(f, "{}{byte:02x}", if number == 0 { "" } else { " " })?;
        }
        match self.0.len() {
            0 => f.write_str("nothing"),
            length if length > SHOWN => write!(f, " ... ({length} bytes)"),
            _ => Ok(()),
        }
    }
}
