//! Commands to registers: written until the SubDevice takes them, read until they hold the required value (protocol
//! 8.2).

use alloc::boxed::Box;
use alloc::vec;
use core::time::Duration;

use ringcat_wire::address::StationAddress;

use super::BringUp;
use super::register_error::{RegisterCommandError, RegisterFailure, WrongValue};
use crate::config::{RegisterAccess, RegisterCommand};
use crate::supervisor::BusError;

/// Pause between two attempts, and between two reads.
const PAUSE: Duration = Duration::from_millis(1);

impl BringUp<'_> {
    pub(super) async fn register(&self, command: &RegisterCommand) -> Result<(), RegisterCommandError> {
        let done = match &command.access {
            RegisterAccess::Write(data) => self.write(command, data).await,
            RegisterAccess::Check { data, mask, limit } => self.check(command, data, mask.as_deref(), *limit).await,
        };
        done.map_err(|cause| RegisterCommandError { address: command.address, cause })
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
            // The last read comes after the limit, so that a value at the last moment counts.
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
