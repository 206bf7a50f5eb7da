//! Commands of an ENI: what is sent, at which transitions, and what must come back (protocol 8.1).

use ringcat_wire::address::{LogicalAddress, RegisterAddress};
use ringcat_wire::command::Command;

use crate::eni::Place;

/// A transition of the state machine at which commands are sent (protocol 8.2); `Op` is OP to PREOP, `Po` the other
/// way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Transition {
    /// INIT to INIT.
    Ii,
    /// INIT to PREOP.
    Ip,
    /// PREOP to PREOP.
    Pp,
    /// PREOP to INIT.
    Pi,
    /// PREOP to SAFEOP.
    Ps,
    /// PREOP to OP.
    Po,
    /// SAFEOP to SAFEOP.
    Ss,
    /// SAFEOP to PREOP.
    Sp,
    /// SAFEOP to INIT.
    Si,
    /// SAFEOP to OP.
    So,
    /// OP to SAFEOP.
    Os,
    /// OP to PREOP.
    Op,
    /// OP to INIT.
    Oi,
    /// INIT to BOOT.
    Ib,
    /// BOOT to INIT.
    Bi,
}

impl Transition {
    /// All of them.
    pub const ALL: [Transition; 15] = [
        Transition::Ii,
        Transition::Ip,
        Transition::Pp,
        Transition::Pi,
        Transition::Ps,
        Transition::Po,
        Transition::Ss,
        Transition::Sp,
        Transition::Si,
        Transition::So,
        Transition::Os,
        Transition::Op,
        Transition::Oi,
        Transition::Ib,
        Transition::Bi,
    ];

    /// As the file writes it.
    pub const fn name(self) -> &'static str {
        match self {
            Transition::Ii => "II",
            Transition::Ip => "IP",
            Transition::Pp => "PP",
            Transition::Pi => "PI",
            Transition::Ps => "PS",
            Transition::Po => "PO",
            Transition::Ss => "SS",
            Transition::Sp => "SP",
            Transition::Si => "SI",
            Transition::So => "SO",
            Transition::Os => "OS",
            Transition::Op => "OP",
            Transition::Oi => "OI",
            Transition::Ib => "IB",
            Transition::Bi => "BI",
        }
    }
}

/// What a datagram addresses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// `Adp` and `Ado`.
    Register {
        /// Position, station address or nothing, depending on the command.
        adp: u16,
        /// Register.
        ado: RegisterAddress,
    },
    /// `Addr`.
    Logical(LogicalAddress),
}

/// A datagram.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Datagram {
    /// `Cmd`.
    pub command: Command,
    /// Where it goes.
    pub target: Target,
    /// `Data`, or as many zeros as `DataLength` says.
    pub data: Vec<u8>,
    /// `Cnt`: the working counter that is expected.
    pub count: Option<u16>,
}

/// `Requires`: with what the command begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Requires {
    /// A frame of its own.
    Frame,
    /// A cycle of its own.
    Cycle,
}

/// `Validate`: a read is repeated until `answer & mask == data`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Validate {
    /// What must come.
    pub data: Vec<u8>,
    /// Bits that count; all of them where there is no mask.
    pub mask: Option<Vec<u8>>,
    /// Milliseconds.
    pub timeout_ms: u32,
}

/// `InitCmd` with a datagram (ECatCmd).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EcatCommand {
    /// Where it stands.
    pub place: Place,
    /// When it is sent.
    pub transitions: Vec<Transition>,
    /// A command of the MainDevice that comes before those of the SubDevices.
    pub before_subdevices: bool,
    /// What it is for.
    pub comment: String,
    /// With what it begins.
    pub requires: Option<Requires>,
    /// What is sent.
    pub datagram: Datagram,
    /// How often it is sent again when the working counter is wrong.
    pub retries: u16,
    /// What the answer must be.
    pub validate: Option<Validate>,
    /// Milliseconds, as some tools write for state changes.
    pub timeout_ms: Option<u32>,
}
