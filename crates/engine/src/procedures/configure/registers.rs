//! Commands to registers: written until the SubDevice takes them, read until they hold what they must (protocol 8.2).

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;

use ringcat_wire::address::{RegisterAddress, StationAddress};

use super::BringUp;
use crate::config::{RegisterAccess, RegisterCommand};
use crate::supervisor::BusError;

/// Pause between two attempts, and between two looks.
const PAUSE: Duration = Duration::from_millis(1);

/// A command to a register that failed.
#[derive(Clone, Debug, PartialEq)]
pub struct RegisterError {
    /// The first register.
    pub address: RegisterAddress,
    /// What happened.
    pub cause: RegisterFailure,
}

/// What happened to a command to a register.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum RegisterFailure {
    /// The SubDevice did not take it, or the bus failed.
    Bus(BusError),
    /// The register holds something else.
    Value(Box<WrongValue>),
}

/// What a register holds instead of what it must hold.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WrongValue {
    /// What it must hold.
    pub expected: Vec<u8>,
    /// Bits that count.
    pub mask: Option<Vec<u8>>,
    /// What it held last.
    pub got: Vec<u8>,
    /// So long it was looked at.
    pub limit: Duration,
}

impl fmt::Display for RegisterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "register {}: ", self.address)?;
        match &self.cause {
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

/// The first bytes of data, in the order in which they lie.
pub(super) struct Hex<'a>(pub &'a [u8]);

impl fmt::Display for Hex<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        /// Bytes that are shown.
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

impl BringUp<'_> {
    pub(super) async fn register(&self, command: &RegisterCommand) -> Result<(), RegisterError> {
        let done = match &command.access {
            RegisterAccess::Write(data) => self.write(command, data).await,
            RegisterAccess::Check { data, mask, limit } => self.check(command, data, mask.as_deref(), *limit).await,
        };
        done.map_err(|cause| RegisterError { address: command.address, cause })
    }

    async fn write(&self, command: &RegisterCommand, data: &[u8]) -> Result<(), RegisterFailure> {
        let mut retries = command.retries;
        loop {
            match self.bus.fpwr(self.station, command.address, data).await {
                Ok(()) => return Ok(()),
                Err(BusError::Wkc { .. }) if retries > 0 => retries -= 1,
                Err(BusError::Wkc { .. }) if !command.required => return Ok(()),
                Err(error) => return Err(RegisterFailure::Bus(error)),
            }
            self.bus.sleep(PAUSE).await;
        }
    }

    async fn check(
        &self,
        command: &RegisterCommand,
        expected: &[u8],
        mask: Option<&[u8]>,
        limit: Duration,
    ) -> Result<(), RegisterFailure> {
        let station: StationAddress = self.station;
        let until = self.bus.now() + limit;
        let mut retries = command.retries;
        loop {
            // The last look comes when the time is over, so that a value in the last moment counts.
            let is_last = self.bus.now() >= until;
            let failure = match self.bus.fprd(station, command.address, expected.len()).await {
                Ok(got) if matches(&got, expected, mask) => return Ok(()),
                Ok(got) => {
                    let (expected, mask) = (expected.to_vec(), mask.map(<[u8]>::to_vec));
                    RegisterFailure::Value(Box::new(WrongValue { expected, mask, got, limit }))
                }
                Err(BusError::Wkc { .. }) if retries > 0 => {
                    retries -= 1;
                    self.bus.sleep(PAUSE).await;
                    continue;
                }
                Err(error) => RegisterFailure::Bus(error),
            };
            if is_last {
                return Err(failure);
            }
            self.bus.sleep(PAUSE).await;
        }
    }
}

fn matches(got: &[u8], expected: &[u8], mask: Option<&[u8]>) -> bool {
    let all = vec![0xFF; expected.len()];
    let mask = mask.unwrap_or(&all);
    got.len() == expected.len()
        && got.iter().zip(expected).zip(mask).all(|((got, expected), mask)| got & mask == *expected)
}
