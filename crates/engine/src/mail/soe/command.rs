//! Procedure commands of drives: start, state, abort (protocol 6.6; IEC 61491: the value of the IDN is the command, its
//! data state the acknowledgement).

use ringcat_wire::mailbox::soe::{Idn, SoeElements};

use super::{SoeAddress, SoeError, read, write};
use crate::mail::{Limits, Mailbox};

/// Set and enabled.
const START: u16 = 0x0003;
/// Neither set nor enabled: aborts a running command, acknowledges an ended one.
const CANCEL: u16 = 0x0000;

/// Data state of a procedure command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CommandState(pub u16);

impl CommandState {
    /// It is set in the drive.
    pub const fn is_set(self) -> bool {
        self.0 & 1 != 0
    }

    /// It is being executed.
    pub const fn is_running(self) -> bool {
        self.0 & 0x04 != 0
    }

    /// It has ended with an error, or cannot be executed.
    pub const fn has_failed(self) -> bool {
        self.0 & 0x08 != 0
    }

    /// It was set and has ended without error.
    pub const fn is_done(self) -> bool {
        self.is_set() && !self.is_running() && !self.has_failed()
    }
}

/// Starts a command; [`state`] gives its progress.
pub async fn start(mailbox: &Mailbox, drive: u8, idn: Idn, limits: Limits) -> Result<(), SoeError> {
    write(mailbox, SoeAddress::value(drive, idn), &START.to_le_bytes(), limits).await
}

/// Aborts a running command, or acknowledges an ended one, so that it can be started again.
pub async fn abort(mailbox: &Mailbox, drive: u8, idn: Idn, limits: Limits) -> Result<(), SoeError> {
    write(mailbox, SoeAddress::value(drive, idn), &CANCEL.to_le_bytes(), limits).await
}

/// State of a command.
pub async fn state(mailbox: &Mailbox, drive: u8, idn: Idn, limits: Limits) -> Result<CommandState, SoeError> {
    let address = SoeAddress { drive, idn, elements: SoeElements::DATA_STATE };
    let bytes = read(mailbox, address, limits, 2).await?;
    Ok(CommandState(bytes.first_chunk().map_or(0, |word| u16::from_le_bytes(*word))))
}
