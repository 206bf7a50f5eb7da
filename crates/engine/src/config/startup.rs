//! Start-up commands: objects, IDNs, IP parameters and registers that are written at each pass of a transition
//! (protocol 5.1, 6.3, 6.5, 6.6).

use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::soe::Idn;

use super::ip::IpSettings;
use super::register::RegisterCommand;

/// A transition at which start-up commands are sent, before the new state is requested. INIT has no mailbox: of the
/// commands of IP, register commands are sent in INIT before the mailbox is set up, all others as soon as PREOP is
/// reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Transition {
    /// INIT to PREOP.
    Ip,
    /// PREOP to SAFEOP, before PDO assignment and mapping are written.
    Ps,
    /// SAFEOP to OP.
    So,
    /// OP to SAFEOP.
    Os,
    /// SAFEOP to PREOP; a change from OP to PREOP passes SAFEOP.
    Sp,
}

impl Transition {
    /// The state before it.
    pub const fn from(self) -> AlState {
        match self {
            Transition::Ip => AlState::Init,
            Transition::Ps => AlState::PreOp,
            Transition::So | Transition::Sp => AlState::SafeOp,
            Transition::Os => AlState::Op,
        }
    }

    /// The state after it.
    pub const fn to(self) -> AlState {
        match self {
            Transition::Ip | Transition::Sp => AlState::PreOp,
            Transition::Ps | Transition::Os => AlState::SafeOp,
            Transition::So => AlState::Op,
        }
    }
}

impl fmt::Display for Transition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} to {}", self.from(), self.to())
    }
}

/// An SDO download.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct SdoDownload {
    /// Index of the object.
    pub index: u16,
    /// Subindex; with complete access the start, 0 or 1.
    pub sub_index: u8,
    /// Complete access.
    pub complete_access: bool,
    /// Data to write, little-endian.
    pub data: Vec<u8>,
}

impl SdoDownload {
    /// A download of one subindex.
    pub fn new(index: u16, sub_index: u8, data: impl Into<Vec<u8>>) -> SdoDownload {
        SdoDownload { index, sub_index, complete_access: false, data: data.into() }
    }

    /// Sets [`SdoDownload::complete_access`].
    #[must_use]
    pub const fn with_complete_access(mut self, complete_access: bool) -> SdoDownload {
        self.complete_access = complete_access;
        self
    }
}

/// An SDO upload.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct SdoUpload {
    /// Index of the object.
    pub index: u16,
    /// Subindex; with complete access the start, 0 or 1.
    pub sub_index: u8,
    /// Complete access.
    pub complete_access: bool,
    /// Required value, little-endian; with another value the configuration fails. With `None` an event reports the
    /// value.
    pub expected: Option<Vec<u8>>,
}

impl SdoUpload {
    /// An upload of one subindex; any value is accepted.
    pub const fn new(index: u16, sub_index: u8) -> SdoUpload {
        SdoUpload { index, sub_index, complete_access: false, expected: None }
    }

    /// Sets [`SdoUpload::complete_access`].
    #[must_use]
    pub const fn with_complete_access(mut self, complete_access: bool) -> SdoUpload {
        self.complete_access = complete_access;
        self
    }

    /// Sets [`SdoUpload::expected`].
    #[must_use]
    pub fn with_expected(mut self, expected: impl Into<Option<Vec<u8>>>) -> SdoUpload {
        self.expected = expected.into();
        self
    }
}

/// A write of an IDN's value.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct IdnWrite {
    /// Drive of the SubDevice, 0..=7.
    pub drive: u8,
    /// The IDN.
    pub idn: Idn,
    /// Data to write, little-endian; lists start with their two lengths.
    pub data: Vec<u8>,
}

impl IdnWrite {
    /// A write of the value of an IDN.
    pub fn new(drive: u8, idn: Idn, data: impl Into<Vec<u8>>) -> IdnWrite {
        IdnWrite { drive, idn, data: data.into() }
    }
}

/// Action of a start-up command.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum StartupAction {
    /// SDO download.
    Sdo(SdoDownload),
    /// SDO upload.
    Upload(SdoUpload),
    /// SoE write.
    Idn(IdnWrite),
    /// EoE: sets the IP parameters.
    Ip(IpSettings),
    /// A register of its controller.
    Register(RegisterCommand),
}

/// A start-up command.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct StartupCommand {
    /// The transition.
    pub transition: Transition,
    /// The action.
    pub action: StartupAction,
    /// Time limit of one message of a mailbox command; `None`: that of the SubDevice's time limits.
    pub limit: Option<Duration>,
    /// Purpose, as the author of the declaration wrote it; for messages.
    pub comment: Option<String>,
}

impl StartupCommand {
    /// Sets [`StartupCommand::limit`].
    #[must_use]
    pub fn with_limit(mut self, limit: impl Into<Option<Duration>>) -> StartupCommand {
        self.limit = limit.into();
        self
    }

    /// Sets [`StartupCommand::comment`].
    #[must_use]
    pub fn with_comment(mut self, comment: impl Into<Option<String>>) -> StartupCommand {
        self.comment = comment.into();
        self
    }

    /// A command with the default time limit and without a comment.
    pub const fn new(transition: Transition, action: StartupAction) -> StartupCommand {
        StartupCommand { transition, action, limit: None, comment: None }
    }
}
