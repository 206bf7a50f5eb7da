//! What `ringcat scan --json` prints.

use serde::Serialize;

use super::values::Port;

/// A segment as a scan found it.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Scan {
    /// SubDevices that answer on the main interface
    pub main_subdevices: usize,
    /// SubDevices that answer on the redundant interface; 0 without one, and where the ring is closed
    pub redundant_subdevices: usize,
    /// The SubDevices, in the order of their positions
    pub subdevices: Vec<SubDevice>,
}

/// A SubDevice that was found.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SubDevice {
    /// Position on the bus, from 0
    pub position: u16,
    /// Station address that the scan has given it
    pub station: u16,
    /// Station alias, of register 0x0012 or, on a bus of a daemon, usually of its EEPROM; 0: none
    pub alias: u16,
    /// Name of its EEPROM, else of its description (`--esi`)
    pub name: String,
    /// Vendor ID
    pub vendor_id: u32,
    /// Product code
    pub product_code: u32,
    /// Revision number
    pub revision: u32,
    /// Serial number
    pub serial: u32,
    /// Bytes of cyclic outputs according to its EEPROM; null where the EEPROM contradicts itself
    pub output_bytes: Option<u32>,
    /// Bytes of cyclic inputs according to its EEPROM; null where the EEPROM contradicts itself
    pub input_bytes: Option<u32>,
    /// The port on the way to the main interface that its entry port is connected to; null at an interface
    pub connected_to: Option<Port>,
    /// Its PDOs with `--pdos`; null without it
    pub pdos: Option<Vec<Pdo>>,
}

/// A PDO.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Pdo {
    /// Index of its mapping object
    pub index: u16,
    /// outputs or inputs
    pub direction: &'static str,
    /// SyncManager to which it is assigned; null without one
    pub sync_manager: Option<u8>,
    /// Its name; empty without one
    pub name: String,
    /// Its entries in order
    pub entries: Vec<PdoEntry>,
}

/// An entry of a PDO.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct PdoEntry {
    /// Index of its object; 0 for a gap
    pub index: u16,
    /// Subindex of its object
    pub sub_index: u8,
    /// Length in bits
    pub bits: u8,
    /// Type of CoE; empty where it is not known
    pub data_type: String,
    /// Its name; empty without one
    pub name: String,
}
