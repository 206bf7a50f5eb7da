//! What `ringcat eni --json` prints.

use serde::Serialize;

use super::values::SyncSignals;

/// An ENI, and what follows from it.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct EniFile {
    /// Name of the MainDevice
    pub name: String,
    /// Version of the format; null where the file names none
    pub version: Option<String>,
    /// The tool that made the file; null where the file names none
    pub made_by: Option<String>,
    /// Cycle time of the file, in nanoseconds; null where the file has none
    pub cycle_ns: Option<u64>,
    /// The SubDevices, in the order of the file
    pub subdevices: Vec<SubDevice>,
    /// Names of hot connect groups; their index is the `group` of SubDevices
    pub groups: Vec<String>,
    /// Tasks: what is exchanged at which cycle
    pub tasks: Vec<Task>,
    /// LRW datagrams over several SubDevices
    pub lrw: Vec<Lrw>,
    /// The distributed clocks; null without
    pub clocks: Option<Clocks>,
    /// The process image
    pub image: Image,
    /// What is not followed as written
    pub not_followed: Vec<Notice>,
}

/// A SubDevice of the file. Its index in the list is its index in the declaration.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SubDevice {
    /// Its name
    pub name: String,
    /// Station address of the file; null where the file has none
    pub station: Option<u16>,
    /// How it is found on the bus
    pub address: Address,
    /// Index of its hot connect group; null without
    pub group: Option<usize>,
    /// Vendor ID that is compared; null where it is not compared
    pub vendor_id: Option<u32>,
    /// Product code that is compared; null where it is not compared
    pub product_code: Option<u32>,
    /// Revision number that is compared; null where it is not compared
    pub revision: Option<u32>,
    /// Serial number that is compared; null where it is not compared
    pub serial: Option<u32>,
    /// The port that it is plugged into; null at an interface, and where the file does not state it
    pub connected_to: Option<DeclaredPort>,
    /// Its SyncManagers; null where its EEPROM is followed
    pub sync_managers: Option<Vec<SyncManager>>,
    /// Its watchdogs
    pub watchdog: Watchdog,
    /// Its SYNC signals; null without
    pub sync: Option<SyncSignals>,
    /// Its start-up commands
    pub startup: Vec<StartupCommand>,
}

/// How a SubDevice is found on the bus. One of `position`, `alias` and `identification` is not null.
#[derive(Clone, Copy, Debug, Default, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Address {
    /// Position on the bus, from 0; null where it is found otherwise
    pub position: Option<u16>,
    /// Station alias; null where it is found otherwise
    pub alias: Option<u16>,
    /// Identification value (hot connect); null where it is found otherwise
    pub identification: Option<u16>,
    /// Address of the word in the memory of the SubDevice that holds the identification; null where the EEPROM states
    /// how it is read
    pub data_word: Option<u16>,
    /// Positions behind the one with the alias or the identification; null with `position`
    pub offset: Option<u16>,
}

/// A port of a SubDevice of the file.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct DeclaredPort {
    /// Index of the SubDevice
    pub subdevice: usize,
    /// Number of its port, 0 to 3
    pub port: u8,
}

/// A SyncManager.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SyncManager {
    /// Its number
    pub index: u8,
    /// `mail out`, `mail in`, `outputs` or `inputs`
    pub role: &'static str,
    /// Physical start address
    pub start: u16,
    /// Length, in bytes
    pub length: u16,
    /// Control byte
    pub control: u8,
    /// Whether it is on
    pub enabled: bool,
    /// Whether it is on in OP only
    pub op_only: bool,
    /// Its PDOs
    pub pdos: Vec<Pdo>,
}

/// A PDO.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Pdo {
    /// Its index
    pub index: u16,
    /// Its entries
    pub entries: Vec<Entry>,
}

/// An entry of a PDO.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Entry {
    /// Index of the object; 0: padding
    pub index: u16,
    /// Sub-index of the object
    pub sub_index: u8,
    /// Length, in bits
    pub bits: u8,
}

/// Watchdogs of a SubDevice.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Watchdog {
    /// Divider (register 0x0400); null where the file has none
    pub divider: Option<u16>,
    /// Time of the outputs' watchdog, in intervals of the divider (register 0x0420); null where the file has none
    pub outputs: Option<u16>,
    /// Time of the PDI's watchdog, in intervals of the divider (register 0x0410); null where the file has none
    pub pdi: Option<u16>,
}

/// A start-up command.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct StartupCommand {
    /// The transition it belongs to, such as `IP` or `PS`
    pub transition: String,
    /// What it does, for people
    pub action: String,
    /// Comment of the file; null without
    pub comment: Option<String>,
    /// Time limit, in nanoseconds; null where the file has none
    pub limit_ns: Option<u64>,
}

/// What is exchanged at one cycle time.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Task {
    /// Cycle time, in nanoseconds
    pub cycle_ns: u64,
    /// The SubDevices that take part
    pub members: Vec<Member>,
}

/// A SubDevice of a task.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Member {
    /// Index of the SubDevice
    pub subdevice: usize,
    /// Numbers of its SyncManagers that are exchanged; null: all of them
    pub sync_managers: Option<Vec<u8>>,
}

/// An LRW datagram over several SubDevices.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Lrw {
    /// Its place in the file
    pub name: String,
    /// Logical address
    pub logical: u32,
    /// Length, in bytes
    pub length: usize,
    /// Indices of the SubDevices
    pub subdevices: Vec<usize>,
}

/// Distributed clocks.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Clocks {
    /// Index of the SubDevice with the reference clock; null: the first one with a clock
    pub reference: Option<usize>,
    /// Whether the reference clock follows this host
    pub bus_shift: bool,
}

/// The process image.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Image {
    /// Bytes of inputs
    pub input_bytes: usize,
    /// Bytes of outputs
    pub output_bytes: usize,
    /// Process data of SubDevices in the image
    pub areas: Vec<Area>,
    /// Variables
    pub variables: Vec<Variable>,
    /// Inputs that are copied to outputs
    pub copies: Vec<Copied>,
}

/// Process data of a SubDevice in the image.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Area {
    /// Index of the SubDevice
    pub subdevice: usize,
    /// `inputs` or `outputs`
    pub image: &'static str,
    /// Number of its SyncManager; null: not known before the SubDevice was scanned
    pub sync_manager: Option<u8>,
    /// First bit within the process data of the SyncManager
    pub bit_offset: u32,
    /// First bit in the image
    pub image_bit: u32,
    /// Length, in bits
    pub bits: u32,
}

/// A variable.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Variable {
    /// Its name
    pub name: String,
    /// Its data type as the file names it
    #[serde(rename = "type")]
    pub data_type: String,
    /// `inputs` or `outputs`
    pub image: &'static str,
    /// First bit in the image
    pub image_bit: u32,
    /// Length, in bits
    pub bits: u32,
    /// Index of the SubDevice that it belongs to; null where it belongs to none
    pub subdevice: Option<usize>,
}

/// Inputs that are copied to outputs.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Copied {
    /// First bit in the inputs
    pub input_bit: u32,
    /// First bit in the outputs
    pub output_bit: u32,
    /// Length, in bits
    pub bits: u32,
}

/// Something that is not followed as written.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Notice {
    /// What
    pub subject: String,
    /// Why, and what is done instead
    pub reason: String,
    /// Line of the file; null where it has no place
    pub line: Option<u32>,
    /// Column of the file; null where it has no place
    pub column: Option<u32>,
    /// How often it occurs
    pub times: usize,
    /// Indices of the SubDevices concerned
    pub subdevices: Vec<usize>,
}

/// An ENI that was written.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct EniExport {
    /// Number of SubDevices
    pub subdevices: usize,
    /// Number of variables
    pub variables: usize,
    /// Whether cyclic commands are LRW
    pub lrw: bool,
    /// Bytes of the file
    pub bytes: usize,
    /// Settings that are not in the file
    pub left_out: Vec<LeftOut>,
}

/// A setting that is not in the file. The network of the file comes to OP without it.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct LeftOut {
    /// The SubDevice, from 0; null: the whole network
    pub subdevice: Option<usize>,
    /// The setting
    pub what: String,
    /// The reason, and the effect
    pub reason: String,
}
