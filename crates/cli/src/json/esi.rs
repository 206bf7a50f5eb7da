//! What `ringcat esi --json` prints.

use serde::Serialize;

/// The devices that a folder describes.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct EsiList {
    /// The devices that match
    pub devices: Vec<Device>,
    /// Files of the folder
    pub files: usize,
    /// Files that were read; the others were in the index
    pub files_read: usize,
    /// Identities that are in several files
    pub duplicates: usize,
    /// Files that were left out
    pub refused: Vec<Refused>,
    /// Time to open the folder, in microseconds
    pub open_us: u64,
}

/// A device.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Device {
    /// Type
    #[serde(rename = "type")]
    pub kind: String,
    /// Name in English, or the first
    pub name: String,
    /// Vendor
    pub vendor_id: u32,
    /// Product code
    pub product_code: u32,
    /// Revision of the description
    pub revision: u32,
    /// File, from the folder on
    pub file: String,
    /// Line of the device in the file
    pub line: u32,
    /// Whether another description hides it from lists
    pub is_hidden: bool,
    /// With `--revision`: exact, older or newer; null without
    pub choice: Option<String>,
}

/// A file that was left out.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Refused {
    /// File, from the folder on
    pub file: String,
    /// Why
    pub reason: String,
}

/// A device of a description.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct EsiShow {
    /// File of the description
    pub esi: String,
    /// Line of the device in the file
    pub line: u32,
    /// Type of the device
    pub device: String,
    /// Name in English, or the first
    pub name: String,
    /// Vendor
    pub vendor_id: u32,
    /// Product code
    pub product_code: u32,
    /// Revision
    pub revision: u32,
    /// Kind of the ports 0 to 3, a letter each: Y MII, K E-bus, H fast hot connect, blank none
    pub ports: String,
    /// Protocols of its mailbox
    pub protocols: Vec<String>,
    /// SyncManagers, the first is SM 0
    pub sync_managers: Vec<ShownSyncManager>,
    /// PDOs, outputs first
    pub pdos: Vec<ShownPdo>,
    /// Operation modes of the clock, the default first
    pub modes: Vec<ShownMode>,
    /// Slots for modules
    pub slots: Vec<ShownSlot>,
    /// Objects of its dictionary
    pub objects: usize,
    /// Start-up commands of CoE
    pub startup_commands: usize,
    /// Parts of the file that are not used
    pub notices: Vec<String>,
}

/// A SyncManager.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct ShownSyncManager {
    /// mailbox out, mailbox in, outputs, inputs or unused
    pub role: String,
    /// Address; null where the file has none
    pub start: Option<u16>,
    /// Bytes by default; null where the file has none
    pub default_bytes: Option<u16>,
    /// It exists in tools only
    pub is_virtual: bool,
    /// It is enabled in OP only
    pub op_only: bool,
}

/// A PDO.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct ShownPdo {
    /// Index
    pub index: u16,
    /// Name in English, or the first
    pub name: String,
    /// The MainDevice sends it
    pub is_output: bool,
    /// Length in bits
    pub bits: u32,
    /// SyncManager to which it is assigned by default; null without
    pub sync_manager: Option<u8>,
    /// It has to be assigned
    pub is_mandatory: bool,
    /// Its entries cannot be changed
    pub is_fixed: bool,
    /// It exists in tools only
    pub is_virtual: bool,
    /// PDOs that are not assigned together with it
    pub excludes: Vec<u16>,
    /// Line in the file
    pub line: u32,
}

/// An operation mode.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct ShownMode {
    /// Name
    pub name: String,
    /// Description
    pub description: String,
    /// Value of the registers 0x0980 and 0x0981
    pub assign_activate: u16,
}

/// A slot.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct ShownSlot {
    /// Name
    pub name: String,
    /// Slots of this kind that have to be filled
    pub least: u16,
    /// Slots of this kind
    pub most: u16,
    /// Types of the modules that fit
    pub modules: Vec<String>,
}

/// A SubDevice of a network file from a description.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct EsiDeclared {
    /// File of the description
    pub esi: String,
    /// Type of the device
    pub device: String,
    /// Revision of the description
    pub revision: u32,
    /// Name of the SubDevice in the network file
    pub name: String,
    /// Operation mode of its clock; null without
    pub mode: Option<String>,
    /// PDOs that are assigned
    pub pdos: usize,
    /// Variables of the SubDevice
    pub variables: usize,
    /// Start-up commands
    pub startup_commands: usize,
    /// Bytes of the network file
    pub bytes: usize,
    /// SHA-256 of the canonical text of the network file, in hexadecimal digits
    pub digest: String,
    /// Parts of the description that are not used
    pub notices: Vec<String>,
}
