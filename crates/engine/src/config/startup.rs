//! Start-up commands: objects, IDNs, IP parameters, messages and registers that are written or read at each pass of a
//! transition (protocol 5.1, 6.3, 6.5 to 6.8).

use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;
use core::hash::{Hash, Hasher};
use core::time::Duration;

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::aoe::AmsHeader;
use ringcat_wire::mailbox::soe::{Idn, SoeElements};
use ringcat_wire::mailbox::voe::VoeMessage;

use super::ip::IpSettings;
use super::register::RegisterCommand;

/// A transition at which start-up commands are sent, before the new state is requested.
///
/// INIT has no mailbox. At a transition between INIT and another state, register commands are sent in INIT, all others
/// in the other state: at IP first the registers, then PREOP, then the mail; at PI first the mail, then INIT, then the
/// registers.
///
/// Commands of a way to INIT ([`Transition::Pi`], [`Transition::Si`], [`Transition::Oi`], [`Transition::Bi`]) are sent
/// if the application requests a state that is reached through INIT, and the SubDevice is as configured. The recovery
/// of a SubDevice sends none, nor do a stop and a deactivation.
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
    /// INIT to INIT: at the beginning of each bring-up that does not begin with a way to INIT, and if INIT is requested
    /// again. Only register commands are possible.
    Ii,
    /// PREOP to PREOP: PREOP is requested again.
    Pp,
    /// SAFEOP to SAFEOP: SAFEOP is requested again.
    Ss,
    /// PREOP to INIT, also on the way to BOOT.
    Pi,
    /// SAFEOP to INIT, also on the way to BOOT.
    Si,
    /// OP to INIT, also on the way to BOOT.
    Oi,
    /// INIT to BOOT.
    Ib,
    /// BOOT to INIT.
    Bi,
}

impl Transition {
    /// All transitions, each one behind those that usually precede it.
    pub const ALL: [Transition; 13] = [
        Transition::Ii,
        Transition::Ip,
        Transition::Pp,
        Transition::Ps,
        Transition::Ss,
        Transition::So,
        Transition::Os,
        Transition::Sp,
        Transition::Pi,
        Transition::Si,
        Transition::Oi,
        Transition::Ib,
        Transition::Bi,
    ];

    /// The transition from a state to itself.
    pub(crate) const fn within(state: AlState) -> Option<Transition> {
        match state {
            AlState::Init => Some(Transition::Ii),
            AlState::PreOp => Some(Transition::Pp),
            AlState::SafeOp => Some(Transition::Ss),
            AlState::Op | AlState::Boot => None,
        }
    }

    /// The transition from a state to INIT.
    pub(crate) const fn to_init(state: AlState) -> Transition {
        match state {
            AlState::Init => Transition::Ii,
            AlState::PreOp => Transition::Pi,
            AlState::SafeOp => Transition::Si,
            AlState::Op => Transition::Oi,
            AlState::Boot => Transition::Bi,
        }
    }

    /// The state before it.
    pub const fn from(self) -> AlState {
        match self {
            Transition::Ii | Transition::Ip | Transition::Ib => AlState::Init,
            Transition::Ps | Transition::Pp | Transition::Pi => AlState::PreOp,
            Transition::So | Transition::Sp | Transition::Ss | Transition::Si => AlState::SafeOp,
            Transition::Os | Transition::Oi => AlState::Op,
            Transition::Bi => AlState::Boot,
        }
    }

    /// The state after it.
    pub const fn to(self) -> AlState {
        match self {
            Transition::Ii | Transition::Pi | Transition::Si | Transition::Oi | Transition::Bi => AlState::Init,
            Transition::Ip | Transition::Sp | Transition::Pp => AlState::PreOp,
            Transition::Ps | Transition::Os | Transition::Ss => AlState::SafeOp,
            Transition::So => AlState::Op,
            Transition::Ib => AlState::Boot,
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

/// A read of elements of an IDN.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct IdnRead {
    /// Drive of the SubDevice, 0..=7.
    pub drive: u8,
    /// The IDN.
    pub idn: Idn,
    /// The elements; several are read in the order of their bits.
    pub elements: SoeElements,
    /// Required data, little-endian; with other data the configuration fails. With `None` an event reports the data.
    pub expected: Option<Vec<u8>>,
}

impl IdnRead {
    /// A read of the value of an IDN; any value is accepted.
    pub const fn new(drive: u8, idn: Idn) -> IdnRead {
        IdnRead { drive, idn, elements: SoeElements::VALUE, expected: None }
    }

    /// Sets [`IdnRead::elements`].
    #[must_use]
    pub const fn with_elements(mut self, elements: SoeElements) -> IdnRead {
        self.elements = elements;
        self
    }

    /// Sets [`IdnRead::expected`].
    #[must_use]
    pub fn with_expected(mut self, expected: impl Into<Option<Vec<u8>>>) -> IdnRead {
        self.expected = expected.into();
        self
    }
}

/// A whole message behind the mailbox header, as its author wrote it.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum MailMessage {
    /// AoE: an AMS header with a request. Its answer has to report no error.
    Aoe(Vec<u8>),
    /// VoE: vendor, type and data. The SubDevice has to take it; an answer is mail for the application.
    Voe(Vec<u8>),
}

impl MailMessage {
    /// Whether it begins with the header of its protocol.
    pub fn is_sound(&self) -> bool {
        match self {
            MailMessage::Aoe(data) => AmsHeader::decode(data).is_ok_and(|(header, _)| !header.is_response()),
            MailMessage::Voe(data) => VoeMessage::decode(data).is_ok(),
        }
    }
}

/// A write of a file (FoE).
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct FileWrite {
    /// Name of the file.
    pub name: String,
    /// Password, 0 for none.
    pub password: u32,
    /// Its contents.
    pub data: Vec<u8>,
}

impl FileWrite {
    /// A write without a password.
    pub fn new(name: impl Into<String>, data: impl Into<Vec<u8>>) -> FileWrite {
        FileWrite { name: name.into(), password: 0, data: data.into() }
    }

    /// Sets [`FileWrite::password`].
    #[must_use]
    pub const fn with_password(mut self, password: u32) -> FileWrite {
        self.password = password;
        self
    }
}

/// A read of a file (FoE) of at most 64 KiB. An event reports its contents.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct FileRead {
    /// Name of the file.
    pub name: String,
    /// Password, 0 for none.
    pub password: u32,
}

impl FileRead {
    /// A read without a password.
    pub fn new(name: impl Into<String>) -> FileRead {
        FileRead { name: name.into(), password: 0 }
    }

    /// Sets [`FileRead::password`].
    #[must_use]
    pub const fn with_password(mut self, password: u32) -> FileRead {
        self.password = password;
        self
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
    /// SoE read.
    IdnRead(IdnRead),
    /// A message of AoE or VoE.
    Mail(MailMessage),
    /// FoE write.
    FileWrite(FileWrite),
    /// FoE read.
    FileRead(FileRead),
}

/// A start-up command.
#[derive(Clone, Debug, PartialEq, Eq)]
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
    /// It is sent after the PDO assignment and mapping of the declaration; otherwise before them. It has no effect at
    /// other transitions than PS, where these are written.
    pub after_pdos: bool,
}

/// Without `after_pdos` the digest is the same as before this field existed.
impl Hash for StartupCommand {
    fn hash<H: Hasher>(&self, state: &mut H) {
        let StartupCommand { transition, action, limit, comment, after_pdos } = self;
        (transition, action, limit, comment).hash(state);
        if *after_pdos {
            after_pdos.hash(state);
        }
    }
}

impl StartupCommand {
    /// Sets [`StartupCommand::after_pdos`].
    #[must_use]
    pub fn with_after_pdos(mut self, after_pdos: bool) -> StartupCommand {
        self.after_pdos = after_pdos;
        self
    }

    /// Whether it is sent after the PDO assignment and mapping.
    pub fn is_after_pdos(&self) -> bool {
        self.after_pdos && self.transition == Transition::Ps
    }

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
        StartupCommand { transition, action, limit: None, comment: None, after_pdos: false }
    }
}
