//! What answers to the tool contain about a master, its SubDevices and an application.

use std::net::Ipv4Addr;

use serde::{Deserialize, Serialize};

use crate::refusal::Refusal;

/// The master as a whole.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MasterReport {
    /// No network device is attached: all its interfaces are absent.
    pub is_orphaned: bool,
    /// An application is active.
    pub is_active: bool,
    /// A scan runs.
    pub is_scanning: bool,
    /// Number of SubDevices that the last scan found.
    pub subdevices: u32,
    /// Its links: main, redundant.
    pub links: Vec<LinkReport>,
    /// Position of the reference clock.
    pub reference: Option<u16>,
    /// Time of the reference clock that was read last, in nanoseconds since 2000-01-01; 0 if none was.
    pub reference_time_ns: u64,
    /// Time of the application, in nanoseconds since 2000-01-01; 0 if none is active.
    pub application_time_ns: u64,
    /// Cycles of the application; `None` while none run.
    pub cycles: Option<CycleReport>,
}

/// Cycles of an application.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CycleReport {
    /// Number of the last one, from 0.
    pub number: u64,
    /// When it began, or when its last domain was processed by an application that runs the parts of a cycle itself, in
    /// nanoseconds of the application's host.
    pub at_ns: u64,
    /// Cycles that began late, that were left out, and after which a domain was incomplete.
    pub late_skipped_incomplete: [u64; 3],
    /// Longest delay of the beginning of a cycle; 0 for an application that runs the parts of a cycle itself.
    pub longest_delay_ns: u64,
}

/// A link.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LinkReport {
    /// Address of the interface.
    pub mac: [u8; 6],
    /// It has a carrier; `None` if that is unknown.
    pub carrier: Option<bool>,
    /// Its frames.
    pub traffic: Traffic,
}

/// Frames of a link.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Traffic {
    /// Frames sent.
    pub frames: u64,
    /// Their bytes.
    pub bytes: u64,
    /// Of these, frames that did not come back.
    pub lost: u64,
    /// Their bytes.
    pub lost_bytes: u64,
    /// Over the last 1 s, 10 s and 60 s, as far as samples go back.
    pub rates: [TrafficRate; 3],
}

/// Rates over a time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrafficRate {
    /// Frames sent per second.
    pub frames_per_s: f64,
    /// Bytes sent per second.
    pub bytes_per_s: f64,
    /// Frames lost per second.
    pub lost_per_s: f64,
    /// Bytes lost per second.
    pub lost_bytes_per_s: f64,
}

/// An SII.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SiiLine {
    /// Position of the SubDevice.
    pub position: u16,
    /// Length of its image in bytes, or why it was not read.
    pub bytes: Result<u32, Refusal>,
}

/// What a transfer does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum TransferWork {
    /// Reads an SII.
    SiiRead,
    /// Writes an SII.
    SiiWrite,
    /// Reads a file.
    FileRead,
    /// Writes a file.
    FileWrite,
    /// Reads an object in segments.
    ObjectRead,
    /// Writes an object in segments.
    ObjectWrite,
}

/// Progress of a transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TransferLine {
    /// What it does.
    pub work: TransferWork,
    /// Bytes that are done.
    pub done: u64,
    /// All its bytes; `None` if they are not known in advance.
    pub total: Option<u64>,
}

/// A SubDevice in a list.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SubDeviceLine {
    /// Its position.
    pub position: u16,
    /// Its alias; 0 is none.
    pub alias: u16,
    /// Register AL_STATUS; `None` if it does not answer.
    pub status: Option<u16>,
    /// It answers on the redundant link, because the ring is broken before it.
    pub is_redundant: bool,
    /// Vendor, product, revision and serial number.
    pub identity: [u32; 4],
    /// Its name.
    pub name: String,
    /// Its order number.
    pub order: String,
}

/// What is known of a SubDevice.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Description {
    /// Vendor, product, revision, serial number.
    pub identity: [u32; 4],
    /// Alias; 0 is none.
    pub alias: u16,
    /// Its name.
    pub name: String,
    /// Kind of port 0 to 3: 0 not implemented, 1 not configured, 2 EBUS, 3 MII.
    pub port_kinds: [u8; 4],
    /// Features of the controller (register FEATURES).
    pub features: ClockFeatures,
    /// Receive and send mailbox in BOOT: address and bytes of each.
    pub bootstrap: Option<[(u16, u16); 2]>,
    /// Receive and send mailbox: address and bytes of each.
    pub mailbox: Option<[(u16, u16); 2]>,
    /// Mailbox protocols, as in word 0x1C of the SII.
    pub protocols: u16,
    /// Whether the SII has a general category with data.
    pub has_general: bool,
    /// Group.
    pub group: String,
    /// Image.
    pub image: String,
    /// CoE details, as in the general category.
    pub coe: u8,
    /// Flags, as in the general category.
    pub flags: u8,
    /// Current from the EBUS in milliamperes; negative: it supplies current.
    pub current_ma: i16,
    /// SyncManagers, from SM 0 on.
    pub sync_managers: Vec<SyncManagerLine>,
}

/// What a controller can do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClockFeatures {
    /// Bit 0 of register FEATURES: FMMUs map whole bytes only.
    pub fmmu_bytes: bool,
    /// It measures delays.
    pub dc: bool,
    /// Its clock has 64 bits.
    pub dc_64: bool,
}

/// A SyncManager of the SII.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SyncManagerLine {
    /// Physical start address.
    pub start: u16,
    /// Default length in bytes.
    pub length: u16,
    /// Control byte.
    pub control: u8,
    /// Enable byte.
    pub enable: u8,
    /// The MainDevice writes it.
    pub is_output: bool,
    /// Its PDOs.
    pub pdos: Vec<PdoLine>,
}

/// A PDO.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PdoLine {
    /// Index.
    pub index: u16,
    /// Name; empty if there is none.
    pub name: String,
    /// Its entries.
    pub entries: Vec<PdoEntryLine>,
}

/// An entry of a PDO.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PdoEntryLine {
    /// Index; 0 is a gap.
    pub index: u16,
    /// Sub-index.
    pub sub_index: u8,
    /// Length in bits.
    pub bits: u8,
    /// Name; empty if there is none.
    pub name: String,
}

/// The ports of a SubDevice.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PortsLine {
    /// Its position.
    pub position: u16,
    /// Delay from the reference clock in nanoseconds; 0 if it is not known.
    pub delay_ns: i64,
    /// Port 0 to 3.
    pub ports: [PortLine; 4],
}

/// A port.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PortLine {
    /// Kind: 0 not implemented, 1 not configured, 2 EBUS, 3 MII.
    pub kind: u8,
    /// Link, loop closed, signal.
    pub link: [bool; 3],
    /// Position of the neighbour behind an open port with a link.
    pub neighbour: Option<u16>,
    /// Port of the neighbour.
    pub neighbour_port: u8,
    /// An interface of the host is at the other end.
    pub is_host: bool,
    /// Receive time in nanoseconds of the local clock.
    pub received_ns: u32,
    /// Delay to the neighbour in nanoseconds; 0 if it is not known.
    pub delay_ns: i64,
    /// Invalid frames, receive errors, forwarded errors, lost links.
    pub errors: [u8; 4],
}

/// An object of a dictionary.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ObjectLine {
    /// Index.
    pub index: u16,
    /// Name.
    pub name: String,
    /// Its entries, at most 256.
    pub entries: Vec<EntryLine>,
}

/// An entry of an object.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct EntryLine {
    /// Sub-index.
    pub sub_index: u8,
    /// Data type, as in the dictionary.
    pub data_type: u16,
    /// Length in bits.
    pub bits: u16,
    /// Access rights: bit 0 to 2 read in PREOP, SAFEOP, OP; bit 3 to 5 write.
    pub access: u16,
    /// Name.
    pub name: String,
}

/// IP parameters; `None`: not set.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct IpParameters {
    /// MAC address.
    pub mac: Option<[u8; 6]>,
    /// IP address.
    pub address: Option<Ipv4Addr>,
    /// Subnet mask.
    pub mask: Option<Ipv4Addr>,
    /// Default gateway.
    pub gateway: Option<Ipv4Addr>,
    /// DNS server.
    pub dns: Option<Ipv4Addr>,
    /// Name, at most 32 bytes.
    pub name: Option<Vec<u8>>,
}

/// A file with the last frames.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RecordLine {
    /// Its path, on the host of the daemon.
    pub path: String,
    /// Frames in it.
    pub frames: u64,
    /// Frames that were not recorded since the recording began, because a queue was full.
    pub lost: u64,
}

/// A SubDevice that the application has declared.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeclaredLine {
    /// Alias; 0: the position counts from the beginning of the ring.
    pub alias: u16,
    /// Position, or offset behind the alias.
    pub position: u16,
    /// Expected vendor and product; 0 matches any.
    pub identity: [u32; 2],
    /// Position of the SubDevice that it is; `None` if it is absent.
    pub found: Option<u16>,
    /// Watchdog divider and intervals of process data; `None`: not written.
    pub watchdog: [Option<u16>; 2],
    /// SyncManagers with PDOs, or with settings of their own.
    pub sync_managers: Vec<DeclaredSyncManager>,
    /// SDO downloads at start-up.
    pub sdos: Vec<SdoLine>,
    /// IDN writes at start-up.
    pub idns: Vec<IdnLine>,
    /// The EEPROM is assigned to the PDI.
    pub sii_to_pdi: bool,
    /// Pause in PREOP before SAFEOP, in milliseconds.
    pub wait_before_safeop_ms: u64,
    /// IP parameters by EoE.
    pub ip: Option<IpParameters>,
    /// SYNC signals.
    pub clock: Option<SyncLine>,
}

/// A SyncManager of a declared SubDevice.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeclaredSyncManager {
    /// Its number.
    pub index: u8,
    /// The MainDevice writes it.
    pub is_output: bool,
    /// Watchdog: `None` as in the SII.
    pub watchdog: Option<bool>,
    /// Its PDOs.
    pub pdos: Vec<PdoLine>,
}

/// An SDO download at start-up.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SdoLine {
    /// Index.
    pub index: u16,
    /// Sub-index; `None` for complete access.
    pub sub_index: Option<u8>,
    /// Bytes of all data.
    pub length: u32,
    /// The first [`MOST_STARTUP`](super::MOST_STARTUP) bytes.
    pub data: Vec<u8>,
}

/// A write of an IDN at start-up.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct IdnLine {
    /// Drive.
    pub drive: u8,
    /// IDN.
    pub idn: u16,
    /// Bytes of all data.
    pub length: u32,
    /// The first [`MOST_STARTUP`](super::MOST_STARTUP) bytes.
    pub data: Vec<u8>,
}

/// SYNC signals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SyncLine {
    /// Register AssignActivate.
    pub assign_activate: u16,
    /// Cycles of SYNC0 and SYNC1 in nanoseconds.
    pub cycles_ns: [u32; 2],
    /// Shifts of SYNC0 and SYNC1 in nanoseconds.
    pub shifts_ns: [i32; 2],
}

/// A domain.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DomainLine {
    /// Logical address of the first byte.
    pub logical: u32,
    /// Bytes of its image in the bytes of the message.
    pub bytes: u32,
    /// Working counter.
    pub wkc: u32,
    /// Expected working counter.
    pub expected: u32,
    /// Working counters by link; `None` with one link.
    pub by_link: Option<[u32; 2]>,
    /// Process data of SubDevices in it.
    pub areas: Vec<AreaLine>,
}

/// Process data of a SyncManager in a domain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct AreaLine {
    /// Alias and position of the declared SubDevice.
    pub subdevice: (u16, u16),
    /// The SyncManager.
    pub sync_manager: u8,
    /// The MainDevice writes it.
    pub is_output: bool,
    /// Logical address.
    pub logical: u32,
    /// First byte in the image.
    pub offset: u32,
    /// Bytes.
    pub length: u16,
}

/// A network interface of EoE.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct EthernetLine {
    /// Its name.
    pub name: String,
    /// Position of the SubDevice.
    pub position: u16,
    /// Frames can pass.
    pub is_up: bool,
    /// Bytes received from the SubDevice, and bytes sent to it.
    pub bytes: [u64; 2],
    /// The same in the last second.
    pub rates: [u64; 2],
    /// Frames that wait to be sent, and the most that may.
    pub queue: [u32; 2],
}
