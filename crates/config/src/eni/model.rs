//! The content of an ENI as written in the file (protocol 8.1). Numbers are validated, nothing is interpreted yet.

mod command;
mod cyclic;
mod mailbox;

use ringcat_wire::address::LogicalAddress;

use crate::xml::Place;

pub use command::{Datagram, EcatCommand, Requires, Target, Transition, Validate};
pub use cyclic::{CopyInfo, CyclicCommand, CyclicState, CyclicTask, Frame, ImageSide, ProcessImage, Variable};
pub use mailbox::{CoeCommand, EoeCommand, Mailbox, MailboxBuffer, Poll, RawMailCommand, SoeCommand};

/// A file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Eni {
    /// Version of the schema.
    pub version: Option<String>,
    /// The tool that created the file, if a comment before the root names it.
    pub made_by: Option<String>,
    /// The MainDevice.
    pub main_device: MainDevice,
    /// The SubDevices in document order.
    pub subdevices: Vec<SubDevice>,
    /// The cyclic tasks.
    pub tasks: Vec<CyclicTask>,
    /// The process image.
    pub image: ProcessImage,
    /// Unknown elements, at most [`super::MAX_UNKNOWN`].
    pub unknown: Vec<Unknown>,
    /// Number of further unknown elements.
    pub more_unknown: usize,
}

/// An element unknown to the reader.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unknown {
    /// Its position in the file.
    pub place: Place,
    /// The element, from the root.
    pub element: String,
}

/// `Master`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MainDevice {
    /// `Info/Name`.
    pub name: String,
    /// `Info/Destination`: destination address of the frames, normally 6 bytes.
    pub destination: Vec<u8>,
    /// `Info/Source`: source address of the frames.
    pub source: Vec<u8>,
    /// `MailboxStates`.
    pub mailbox_states: Option<MailboxStates>,
    /// `EoE`: the MainDevice bridges Ethernet.
    pub eoe: bool,
    /// `InitCmds`: commands for the whole bus.
    pub init_commands: Vec<EcatCommand>,
}

/// `MailboxStates`: the area in which a logical read collects the status bits of mailboxes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MailboxStates {
    /// Its position in the file.
    pub place: Place,
    /// Logical address.
    pub start: LogicalAddress,
    /// Number of bytes.
    pub count: u32,
}

/// `Slave`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SubDevice {
    /// Its position in the file.
    pub place: Place,
    /// `Info/Name`.
    pub name: String,
    /// `Info/PhysAddr`: the station address.
    pub station: Option<u16>,
    /// `Info/AutoIncAddr`: 0, 65535, 65534, ...
    pub auto_increment: Option<u16>,
    /// `Info/Physics`: one letter per port.
    pub physics: String,
    /// `Info/VendorId`.
    pub vendor_id: Option<u32>,
    /// `Info/ProductCode`.
    pub product_code: Option<u32>,
    /// `Info/RevisionNo`.
    pub revision: Option<u32>,
    /// `Info/SerialNo`.
    pub serial: Option<u32>,
    /// `ProcessData`.
    pub process_data: Option<ProcessData>,
    /// `Mailbox`.
    pub mailbox: Option<Mailbox>,
    /// `InitCmds`.
    pub init_commands: Vec<EcatCommand>,
    /// `PreviousPort`.
    pub previous_ports: Vec<PreviousPort>,
    /// `HotConnect`.
    pub hot_connect: Option<HotConnect>,
    /// `DC`.
    pub clock: Option<DistributedClock>,
}

/// A range of bits in an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitRange {
    /// Its position in the file.
    pub place: Place,
    /// `BitStart`.
    pub start: u32,
    /// `BitLength`.
    pub length: u32,
}

/// `ProcessData`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ProcessData {
    /// `Send`: position of the outputs in the output image.
    pub send: Vec<BitRange>,
    /// `Recv`: position of the inputs in the input image.
    pub receive: Vec<BitRange>,
    /// `Sm0` to `Sm15`.
    pub sync_managers: Vec<SyncManagerSettings>,
    /// `RxPdo` and `TxPdo`.
    pub pdos: Vec<Pdo>,
}

/// `Type` of a SyncManager.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SyncManagerKind {
    /// `Outputs`.
    Outputs,
    /// `Inputs`.
    Inputs,
    /// `MBoxOut`.
    MailboxOut,
    /// `MBoxIn`.
    MailboxIn,
}

/// `Sm0` to `Sm15`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SyncManagerSettings {
    /// Its position in the file.
    pub place: Place,
    /// Its number.
    pub index: u8,
    /// `Type`.
    pub kind: Option<SyncManagerKind>,
    /// `DefaultSize`.
    pub default_size: Option<u16>,
    /// `StartAddress`.
    pub start: Option<u16>,
    /// `ControlByte`.
    pub control: Option<u8>,
    /// `Enable`.
    pub enable: Option<bool>,
    /// `Pdo`: assigned PDOs.
    pub pdos: Vec<u16>,
}

/// `RxPdo` or `TxPdo`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pdo {
    /// Its position in the file.
    pub place: Place,
    /// Whether it is an RxPdo (outputs).
    pub outputs: bool,
    /// `Index`.
    pub index: u16,
    /// `Name`.
    pub name: String,
    /// Attribute `Sm`: the SyncManager.
    pub sync_manager: Option<u8>,
    /// `Entry`.
    pub entries: Vec<PdoEntry>,
}

/// An entry of a PDO; index 0 is a gap.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PdoEntry {
    /// `Index`.
    pub index: u16,
    /// `SubIndex`.
    pub sub_index: u8,
    /// `BitLen`: entries such as `ARRAY [0..99] OF BYTE` exceed the range of a byte.
    pub bit_length: u16,
    /// `Name`.
    pub name: String,
    /// `DataType`.
    pub data_type: String,
}

/// A port of a SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Port {
    /// Port 0.
    A,
    /// Port 1.
    B,
    /// Port 2.
    C,
    /// Port 3.
    D,
}

/// `PreviousPort`: the upstream connection of the SubDevice.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PreviousPort {
    /// Its position in the file.
    pub place: Place,
    /// Attribute `Selected`.
    pub selected: bool,
    /// `Port` of the other SubDevice.
    pub port: Port,
    /// `PhysAddr` of the other SubDevice; `None` if the file has only a `DeviceId`.
    pub station: Option<u16>,
}

/// `HotConnect`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HotConnect {
    /// Its position in the file.
    pub place: Place,
    /// `GroupName`.
    pub name: String,
    /// `GroupMemberCnt`, including the head.
    pub members: u16,
    /// `IdentifyCmd`.
    pub identify: Vec<EcatCommand>,
}

/// `DC`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DistributedClock {
    /// Its position in the file.
    pub place: Place,
    /// `ReferenceClock`.
    pub reference: bool,
    /// `CycleTime0` in nanoseconds.
    pub cycle_0_ns: u32,
    /// `CycleTime1` in nanoseconds.
    pub cycle_1_ns: u32,
    /// `ShiftTime` in nanoseconds.
    pub shift_ns: i32,
}
