//! Mailboxes of an ENI: buffers, protocols, commands of each protocol (protocol 8.1).

use super::command::Transition;
use crate::eni::Place;

/// `Send` or `Recv` of a mailbox.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MailboxBuffer {
    /// Its position in the file.
    pub place: Place,
    /// Start address.
    pub start: u16,
    /// Number of bytes.
    pub length: u16,
}

/// How the MainDevice detects a full mailbox.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Poll {
    /// `PollTime` in milliseconds.
    Every(u32),
    /// `StatusBitAddr`: bit in the area of `MailboxStates`.
    StatusBit(u32),
}

/// `Mailbox`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Mailbox {
    /// `Send`.
    pub send: Option<MailboxBuffer>,
    /// `Recv`.
    pub receive: Option<MailboxBuffer>,
    /// `Recv/PollTime` or `Recv/StatusBitAddr`.
    pub poll: Option<Poll>,
    /// `BootStrap/Send` and `BootStrap/Recv`.
    pub bootstrap: Option<(MailboxBuffer, MailboxBuffer)>,
    /// `Protocol`.
    pub protocols: Vec<String>,
    /// `CoE/InitCmds`.
    pub coe: Vec<CoeCommand>,
    /// `SoE/InitCmds`.
    pub soe: Vec<SoeCommand>,
    /// `EoE/InitCmds`.
    pub eoe: Vec<EoeCommand>,
    /// `AoE/InitCmds`, `FoE/InitCmds`, `VoE/InitCmds`.
    pub others: Vec<RawMailCommand>,
    /// `AoE/NetId`.
    pub net_id: Option<[u8; 6]>,
}

/// `CoE/InitCmds/InitCmd`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CoeCommand {
    /// Its position in the file.
    pub place: Place,
    /// Transitions at which it is sent.
    pub transitions: Vec<Transition>,
    /// `Comment`.
    pub comment: String,
    /// Time limit in milliseconds; 0 is the tool's default.
    pub timeout_ms: u32,
    /// `Ccs`: 1 downloads, 2 uploads; some files have it reversed (protocol 8.2).
    pub ccs: u8,
    /// Attribute `CompleteAccess`.
    pub complete_access: bool,
    /// `Index`.
    pub index: u16,
    /// `SubIndex`.
    pub sub_index: u8,
    /// `Data`.
    pub data: Vec<u8>,
    /// `Disabled`: not sent.
    pub disabled: bool,
}

/// `SoE/InitCmds/InitCmd`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SoeCommand {
    /// Its position in the file.
    pub place: Place,
    /// Transitions at which it is sent.
    pub transitions: Vec<Transition>,
    /// `Comment`.
    pub comment: String,
    /// Time limit in milliseconds; 0 is the tool's default.
    pub timeout_ms: u32,
    /// `OpCode`: 2 reads, 3 writes; a missing one writes.
    pub op_code: u8,
    /// `DriveNo`.
    pub drive: u8,
    /// `IDN`.
    pub idn: u16,
    /// `Elements`, a bit mask.
    pub elements: u8,
    /// `Attribute`.
    pub attribute: u32,
    /// `Data`.
    pub data: Vec<u8>,
    /// `Disabled`: not sent.
    pub disabled: bool,
}

/// `EoE/InitCmds/InitCmd`: with `Type` 2 it sets IP parameters.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EoeCommand {
    /// Its position in the file.
    pub place: Place,
    /// Transitions at which it is sent.
    pub transitions: Vec<Transition>,
    /// `Comment`.
    pub comment: String,
    /// Time limit in milliseconds; 0 is the tool's default.
    pub timeout_ms: u32,
    /// `Type`.
    pub kind: Option<u8>,
    /// `MAC`.
    pub mac: Option<Vec<u8>>,
    /// `IP`, in hexadecimal or dotted decimal form.
    pub ip: Option<Vec<u8>>,
    /// `Subnet`.
    pub subnet: Option<Vec<u8>>,
    /// `DefGateway`.
    pub gateway: Option<Vec<u8>>,
    /// `ServerIP`: DNS server.
    pub server: Option<Vec<u8>>,
    /// `DNSName`.
    pub name: Option<String>,
    /// `Data`: the message after the mailbox header.
    pub data: Vec<u8>,
    /// `Disabled`: not sent.
    pub disabled: bool,
}

/// A mailbox command of another protocol, as bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawMailCommand {
    /// Its position in the file.
    pub place: Place,
    /// `AoE`, `FoE` or `VoE`.
    pub protocol: &'static str,
    /// Transitions at which it is sent.
    pub transitions: Vec<Transition>,
    /// `Comment`.
    pub comment: String,
    /// Time limit in milliseconds; 0 is the tool's default.
    pub timeout_ms: u32,
    /// `Data`: the message after the mailbox header.
    pub data: Vec<u8>,
    /// `Disabled`: not sent.
    pub disabled: bool,
}
