//! Blocking transfers: objects and IDNs of a SubDevice by its position.

use ringcat::{Error, Idn, MailboxError, Position, SdoFailure, SoeFailure, SubDeviceFailure, SupervisorThread};

use crate::bus::Bus;
use crate::code::{Code, Outcome, report};

/// Highest drive behind a SubDevice.
const MAX_DRIVE: u8 = 7;

/// A failed transfer: the code, and the abort code of the SubDevice if it aborted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Failed {
    /// Return code.
    pub code: Code,
    /// Abort code of an SDO, or error code of an IDN.
    pub reason: Option<u32>,
}

impl From<Code> for Failed {
    fn from(code: Code) -> Failed {
        Failed { code, reason: None }
    }
}

/// Reads an entry.
///
/// # Errors
/// No such SubDevice, it aborted, or did not answer.
pub fn upload(bus: &Bus, position: u16, index: u16, sub_index: u8) -> Result<Vec<u8>, Failed> {
    let supervisor = reachable(bus, position)?;
    supervisor.subdevice(Position(position)).sdo_read::<Vec<u8>>(index, sub_index).map_err(|error| failed(&error))
}

/// Writes an entry, or with `complete` a whole object.
///
/// # Errors
/// As [`upload`]; no data.
pub fn download(bus: &Bus, position: u16, object: (u16, u8), complete: bool, data: Vec<u8>) -> Result<(), Failed> {
    if data.is_empty() {
        return Err(Code::INVALID.into());
    }
    let subdevice = reachable(bus, position)?.subdevice(Position(position));
    let written = match complete {
        true => subdevice.sdo_write_complete(object.0, data),
        false => subdevice.sdo_write(object.0, object.1, data),
    };
    written.map_err(|error| failed(&error))
}

/// Reads the value of an IDN.
///
/// # Errors
/// As [`upload`]; a drive above 7.
pub fn read_idn(bus: &Bus, position: u16, drive: u8, idn: u16) -> Result<Vec<u8>, Failed> {
    let supervisor = reachable(bus, position)?;
    check_drive(drive)?;
    supervisor.subdevice(Position(position)).soe_read::<Vec<u8>>(drive, Idn(idn)).map_err(|error| failed(&error))
}

/// Writes the value of an IDN.
///
/// # Errors
/// As [`read_idn`]; no data.
pub fn write_idn(bus: &Bus, position: u16, drive: u8, idn: u16, data: Vec<u8>) -> Result<(), Failed> {
    let supervisor = reachable(bus, position)?;
    check_drive(drive)?;
    if data.is_empty() {
        return Err(Code::INVALID.into());
    }
    supervisor.subdevice(Position(position)).soe_write(drive, Idn(idn), data).map_err(|error| failed(&error))
}

fn check_drive(drive: u8) -> Outcome {
    if drive > MAX_DRIVE { Err(Code::INVALID) } else { Ok(()) }
}

fn reachable(bus: &Bus, position: u16) -> Outcome<&SupervisorThread> {
    let found = bus.found()?;
    if usize::from(position) < found.len() { Ok(bus.supervisor()) } else { Err(Code::INVALID) }
}

fn failed(error: &Error) -> Failed {
    report(format_args!("{error}"));
    let Error::SubDevice(error) = error else { return Code::IO.into() };
    match &error.failure {
        SubDeviceFailure::Sdo(error) => match error.cause {
            SdoFailure::Aborted(code) => Failed { code: Code::IO, reason: Some(code.0) },
            SdoFailure::Mailbox(ref error) => of_mailbox(error),
            SdoFailure::TooLong(_) => Code::OVERFLOW.into(),
            _ => Code::IO.into(),
        },
        SubDeviceFailure::Soe(error) => match &error.cause {
            SoeFailure::Refused(code) => Failed { code: Code::IO, reason: Some(code.0.into()) },
            SoeFailure::Mailbox(error) => of_mailbox(error),
            _ => Code::IO.into(),
        },
        SubDeviceFailure::Mailbox(error) => of_mailbox(error),
        SubDeviceFailure::NoMailbox => Code::NO_PROTOCOL.into(),
        SubDeviceFailure::NoPosition { .. } => Code::INVALID.into(),
        _ => Code::IO.into(),
    }
}

fn of_mailbox(error: &MailboxError) -> Failed {
    match error {
        MailboxError::NoAnswer { .. } | MailboxError::Full { .. } => Code::TIMED_OUT.into(),
        MailboxError::Error(_) => Code::NO_PROTOCOL.into(),
        _ => Code::IO.into(),
    }
}
