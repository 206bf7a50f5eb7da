//! What `ringcat esi --json` prints.

use serde::Serialize;

/// The devices that a folder describes.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct EsiList {
    /// The devices that were asked for
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
    /// With a revision asked for: exact, older or newer; null without
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
