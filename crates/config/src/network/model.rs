//! The keys of a network file. The doc comments of the keys are their descriptions in the JSON schema.
//!
//! Every value has a meaning of its own; what follows from several values is in `network::declare`.

mod startup;

use serde::Deserialize;

pub use startup::{At, Check, Idn, Ip, ReadFile, ReadIdn, Sdo, Startup, Upload, Write, WriteFile};

use super::values::{Shift, Time};

/// The version of the format.
pub const VERSION: u32 = 1;

/// A network file.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct NetworkFile {
    /// Version of the format: 1.
    pub ringcat_network: u32,
    /// Name of the network.
    #[serde(default)]
    pub name: String,
    /// Absent SubDevices that prevent the activation.
    #[serde(default)]
    pub required: Required,
    /// Use of LRW.
    #[serde(default)]
    pub lrw: Lrw,
    /// Redundancy of cables.
    #[serde(default)]
    pub redundancy: Redundancy,
    /// Distributed clocks; without this table no clock register is written.
    pub clocks: Option<Clocks>,
    /// Domains: process data that is exchanged in one cycle. At least one.
    #[serde(default)]
    pub domain: Vec<Domain>,
    /// SubDevices in the order of the bus; the members of a group follow each other, head first.
    #[serde(default)]
    pub subdevice: Vec<SubDevice>,
}

/// Absent SubDevices that prevent the activation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Required {
    /// Each absent SubDevice, optional or not.
    All,
    /// Each absent SubDevice that is not optional.
    #[default]
    Mandatory,
    /// No absent SubDevice.
    Nothing,
}

/// Use of LRW.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Lrw {
    /// On one link, where every SubDevice of a domain supports it.
    #[default]
    Automatic,
    /// Always; refused on two links.
    Always,
    /// One datagram per SubDevice.
    PerSubdevice,
}

/// Redundancy of cables.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Redundancy {
    /// The segment is a ring: it needs a redundant interface.
    #[serde(default)]
    pub ring: bool,
    /// Rings behind junctions.
    #[serde(default)]
    pub junctions: Junctions,
    /// The cables that close these rings, with `junctions = "strict"`.
    #[serde(default)]
    pub connection: Vec<Connection>,
}

/// Rings behind junctions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Junctions {
    /// The network has no rings behind junctions.
    #[default]
    Disabled,
    /// The scan finds the rings behind junctions.
    Automatic,
    /// The rings behind junctions are those that the file declares.
    Strict,
}

/// A cable that closes a ring behind a junction.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Connection {
    /// Name of the junction.
    pub head: String,
    /// Its port.
    pub head_port: u8,
    /// Name of the last SubDevice of the ring.
    pub tail: String,
    /// Its port.
    pub tail_port: u8,
}

/// Distributed clocks.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Clocks {
    /// Name of the SubDevice with the reference clock; the first SubDevice with a clock if the key is missing.
    pub reference: Option<String>,
    /// The reference clock follows the host.
    #[serde(default)]
    pub bus_shift: bool,
    /// Largest difference in the sync window, in nanoseconds.
    pub sync_window_ns: Option<u32>,
    /// A clock is locked if its difference is at or below this, in nanoseconds.
    pub lock_window_ns: Option<u32>,
    /// Longest time that a SubDevice with SYNC signals waits in SAFEOP for locked clocks.
    pub lock_limit: Option<Time>,
    /// SubDevices go on to OP with clocks that are not locked in time.
    #[serde(default)]
    pub go_on_unlocked: bool,
    /// Delays that a fork without a clock hides are estimated.
    #[serde(default)]
    pub estimate_delays: bool,
}

/// A domain.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Domain {
    /// Its name.
    pub name: String,
    /// Its cycle time, as in "1ms".
    pub period: Time,
    /// Number of its cycles that may be under way at once, 1 to 4.
    #[serde(default = "one")]
    pub under_way: u8,
    /// Lost frames are sent again within their cycle.
    #[serde(default)]
    pub send_again: bool,
}

const fn one() -> u8 {
    1
}

/// A SubDevice.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SubDevice {
    /// Its name, unique in the file.
    pub name: String,
    /// Its position on the bus, members of groups not counted. Without a place it is behind the SubDevice before it.
    pub position: Option<u16>,
    /// The station alias from which its place counts.
    pub alias: Option<u16>,
    /// The explicit device identification from which its place counts.
    pub identification: Option<u16>,
    /// Address of the word in the memory of the SubDevice that holds `identification`; needed if the EEPROM does not
    /// state how the identification is read.
    pub identification_word: Option<u16>,
    /// Number of SubDevices behind the one with the alias or identification.
    pub offset: Option<u16>,
    /// Name of its hot connect group. The first member is found by alias or identification; the others follow it.
    pub group: Option<String>,
    /// The network works without it.
    #[serde(default)]
    pub optional: bool,
    /// Vendor ID.
    pub vendor: Option<u32>,
    /// Product code.
    pub product: Option<u32>,
    /// Revision.
    pub revision: Option<u32>,
    /// Comparison of the revision.
    #[serde(default)]
    pub check_revision: CheckRevision,
    /// Serial number; another one is refused.
    pub serial: Option<u32>,
    /// Explicit device identification; another one is refused.
    pub check_identification: Option<u16>,
    /// Type of the device (order code), for people and for exports.
    #[serde(default)]
    pub order_code: String,
    /// Version of its firmware (object 0x100A), for `compare`.
    #[serde(default)]
    pub firmware: String,
    /// Kind of its ports 0 to 3, a letter each, Y: MII, K: E-bus, H: fast hot connect, blank: none; for exports and
    /// `compare`.
    #[serde(default)]
    pub ports: String,
    /// The SubDevice and the port that its port 0 is plugged into. A difference is reported.
    pub plugged_into: Option<PluggedInto>,
    /// The domain of its process data; the first one if the key is missing.
    pub domain: Option<String>,
    /// State to which it is brought.
    #[serde(default)]
    pub target: Target,
    /// Mailboxes as its EEPROM describes them, for exports and `compare`.
    pub mailbox: Option<Mailbox>,
    /// SyncManagers with process data. Without any, all PDOs are those of the EEPROM.
    #[serde(default)]
    pub sync_manager: Vec<SyncManager>,
    /// SYNC signals.
    pub sync: Option<Sync>,
    /// What it may receive a second time within a cycle.
    #[serde(default)]
    pub repeat: Repeat,
    /// Time that frames take through it.
    pub passage: Option<Passage>,
    /// Register WATCHDOG_DIVIDER.
    pub watchdog_divider: Option<u16>,
    /// Register WATCHDOG_TIME_PROCESS_DATA; 0: switched off.
    pub watchdog_process_data: Option<u16>,
    /// Register WATCHDOG_TIME_PDI; 0: switched off.
    pub watchdog_pdi: Option<u16>,
    /// The EEPROM is assigned to the PDI before PREOP is requested.
    #[serde(default)]
    pub eeprom_to_pdi: bool,
    /// Pause in PREOP before SAFEOP is requested.
    pub wait_before_safeop: Option<Time>,
    /// Time limits.
    #[serde(default)]
    pub timeouts: Timeouts,
    /// Start-up commands: those of a transition are sent in this order.
    #[serde(default)]
    pub startup: Vec<Startup>,
}

/// Comparison of the revision.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum CheckRevision {
    /// Not compared: the key is for people, exports and `compare`.
    #[default]
    None,
    /// Equal.
    Equal,
    /// Equal or greater.
    EqualOrGreater,
    /// Low words equal.
    LowEqual,
    /// Low words equal, high word equal or greater.
    LowEqualHighEqualOrGreater,
    /// High words equal.
    HighEqual,
    /// High words equal, low word equal or greater.
    HighEqualLowEqualOrGreater,
}

/// Where a cable ends.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct PluggedInto {
    /// Name of the SubDevice.
    pub subdevice: String,
    /// Number of its port, 0 to 3.
    pub port: u8,
}

/// State to which a SubDevice is brought.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "UPPERCASE")]
pub enum Target {
    /// INIT.
    Init,
    /// PREOP.
    Preop,
    /// SAFEOP.
    Safeop,
    /// OP.
    #[default]
    Op,
}

/// Mailboxes.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Mailbox {
    /// The mailbox that the MainDevice writes.
    pub write: Buffer,
    /// The mailbox that the MainDevice reads.
    pub read: Buffer,
    /// The mailbox that the MainDevice writes in BOOT.
    pub boot_write: Option<Buffer>,
    /// The mailbox that the MainDevice reads in BOOT.
    pub boot_read: Option<Buffer>,
    /// Its protocols.
    #[serde(default)]
    pub protocols: Vec<Protocol>,
    /// SDO services with complete access.
    #[serde(default)]
    pub complete_access: bool,
    /// The PDO assignment can be changed.
    #[serde(default)]
    pub pdo_assign: bool,
    /// The PDO mapping can be changed.
    #[serde(default)]
    pub pdo_config: bool,
}

/// A mailbox in the memory of the SubDevice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Buffer {
    /// Its address.
    pub start: u16,
    /// Its bytes.
    pub length: u16,
}

/// A mailbox protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub enum Protocol {
    /// ADS over EtherCAT.
    AoE,
    /// Ethernet over EtherCAT.
    EoE,
    /// CAN application protocol over EtherCAT.
    CoE,
    /// File access over EtherCAT.
    FoE,
    /// Servo drive profile over EtherCAT.
    SoE,
    /// Vendor specific protocol over EtherCAT.
    VoE,
}

/// A SyncManager with process data.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SyncManager {
    /// Its number, 0 to 15.
    pub number: u8,
    /// Outputs of the MainDevice, or inputs.
    pub direction: Direction,
    /// Its address as the EEPROM describes it, for exports and `compare`.
    pub start: Option<u16>,
    /// Its control byte as the EEPROM describes it, for exports and `compare`.
    pub control: Option<u8>,
    /// It is enabled in OP only, for exports.
    #[serde(default)]
    pub op_only: bool,
    /// Whether writes retrigger the process data watchdog; as in the EEPROM if the key is missing.
    pub watchdog: Option<bool>,
    /// The domain of its process data, where it differs from that of the SubDevice.
    pub domain: Option<String>,
    /// Its bytes, where they do not follow from its PDOs; for exports.
    pub length: Option<u16>,
    /// Its PDOs in order; an empty list without a length disables it.
    #[serde(default)]
    pub pdo: Vec<Pdo>,
}

/// Direction of process data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    /// From the MainDevice to the SubDevice.
    #[default]
    Outputs,
    /// From the SubDevice to the MainDevice.
    Inputs,
}

/// A PDO.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Pdo {
    /// Index of its mapping object.
    pub index: u16,
    /// Its name; variables begin with it.
    #[serde(default)]
    pub name: String,
    /// The device does not permit other entries: its mapping is never written.
    #[serde(default)]
    pub fixed: bool,
    /// Its entries in order; those of the EEPROM if the key is missing.
    pub entries: Option<Vec<Entry>>,
}

/// An entry of a PDO.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// Index of the object; 0: a gap.
    #[serde(default)]
    pub index: u16,
    /// Subindex of the object.
    #[serde(default)]
    pub sub: u8,
    /// Length in bits, 1 to 255.
    pub bits: u8,
    /// Its name; the last part of the name of the variable.
    #[serde(default)]
    pub name: String,
    /// Its data type, as in "UINT".
    #[serde(default, rename = "type")]
    pub data_type: String,
}

/// SYNC signals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Sync {
    /// Registers 0x0980 and 0x0981, as AssignActivate in ESI and EEPROM.
    pub assign_activate: u16,
    /// Cycle of SYNC0.
    pub sync0_cycle: Shift,
    /// Shift of SYNC0 after the beginning of the cycle.
    #[serde(default)]
    pub sync0_shift: Shift,
    /// Cycle of SYNC1: 0, that of SYNC0, or a multiple of it.
    #[serde(default)]
    pub sync1_cycle: Shift,
    /// Shift of SYNC1 after SYNC0.
    #[serde(default)]
    pub sync1_shift: Shift,
}

/// What a SubDevice may receive a second time within a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Repeat {
    /// Chosen from what is known of the SubDevice.
    #[default]
    Automatic,
    /// Outputs and inputs.
    Everything,
    /// Inputs.
    Inputs,
    /// Neither outputs nor inputs.
    Nothing,
}

/// Time that frames take through a SubDevice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Passage {
    /// Nanoseconds through the processing unit.
    pub processing_ns: u16,
    /// Nanoseconds without the processing unit.
    pub forwarding_ns: u16,
}

/// Time limits; those that are missing have the values of the ETG.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Timeouts {
    /// INIT to PREOP or BOOT.
    pub preop: Option<Time>,
    /// PREOP to SAFEOP, SAFEOP to OP.
    pub safeop_op: Option<Time>,
    /// Any state to INIT.
    pub back_to_init: Option<Time>,
    /// OP to SAFEOP, OP or SAFEOP to PREOP.
    pub back_to_safeop: Option<Time>,
    /// Until a mailbox accepts a request.
    pub mailbox_request: Option<Time>,
    /// Until the response to an SDO request is available.
    pub sdo: Option<Time>,
    /// Until the response to a SoE request is available.
    pub soe: Option<Time>,
    /// Until the response to an EoE request is available.
    pub eoe: Option<Time>,
}
