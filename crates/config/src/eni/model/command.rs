//! Commands of an ENI: datagram, transitions and expected response (protocol 8.1).

use ringcat_wire::address::{LogicalAddress, RegisterAddress};
use ringcat_wire::command::Command;

use crate::eni::Place;

/// A transition of the state machine at which commands are sent (protocol 8.2); `Op` is OP to PREOP, `Po` the reverse.
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
    /// All transitions.
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

    /// The name in the file.
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

/// The address of a datagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// `Adp` and `Ado`.
    Register {
        /// Position, station address or unused, depending on the command.
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
    /// Its address.
    pub target: Target,
    /// `Data`, or `DataLength` zeros.
    pub data: Vec<u8>,
    /// `Cnt`: the expected working counter.
    pub count: Option<u16>,
}

/// `Requires`: what the command starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Requires {
    /// A separate frame.
    Frame,
    /// A separate cycle.
    Cycle,
}

/// `Validate`: a read is repeated until `answer & mask == data`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Validate {
    /// The expected value.
    pub data: Vec<u8>,
    /// The bits to compare; all bits if there is no mask.
    pub mask: Option<Vec<u8>>,
    /// Time limit in milliseconds.
    pub timeout_ms: u32,
}

/// `InitCmd` with a datagram (ECatCmd).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EcatCommand {
    /// Its position in the file.
    pub place: Place,
    /// Transitions at which it is sent.
    pub transitions: Vec<Transition>,
    /// A command of the MainDevice that precedes those of the SubDevices.
    pub before_subdevices: bool,
    /// `Comment`.
    pub comment: String,
    /// `Requires`.
    pub requires: Option<Requires>,
    /// The datagram.
    pub datagram: Datagram,
    /// Number of repetitions if the working counter is wrong.
    pub retries: u16,
    /// The expected response.
    pub validate: Option<Validate>,
    /// Time limit in milliseconds, which some tools write for state changes.
    pub timeout_ms: Option<u32>,
}
