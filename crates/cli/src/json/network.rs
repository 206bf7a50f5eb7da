//! What `ringcat init --json` and `ringcat compare --json` print.

use serde::Serialize;

/// A network file from a scan.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Init {
    /// SubDevices in the file
    pub subdevices: usize,
    /// Variables of the process image
    pub variables: usize,
    /// SubDevices that a description describes; null without descriptions
    pub described: Option<usize>,
    /// Modules in slots of SubDevices that a description describes; null without descriptions
    pub modules: Option<usize>,
    /// Names of PDOs and entries that come from descriptions
    pub named: usize,
    /// Bytes of the file
    pub bytes: usize,
    /// Time of the scan, and of firmware versions where they are read, in microseconds
    pub scan_us: u64,
    /// Time until the file was written, in microseconds
    pub file_us: u64,
    /// SHA-256 of the canonical text of the file, in hexadecimal digits
    pub digest: String,
}

/// A network compared with a file.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Compare {
    /// SubDevices in the file
    pub declared: usize,
    /// SubDevices that were found
    pub found: usize,
    /// The differences, in the order of the file
    pub differences: Vec<Difference>,
    /// Positions of SubDevices whose modules are in the file, but not compared: they do not list them (0xF050), or
    /// their list was not read
    pub modules_not_compared: Vec<u16>,
}

/// A difference.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Difference {
    /// missing, additional, order, ambiguous, device, revision, serial, identification, pdos, mailbox, protocols, sync
    /// manager, ports, process data, firmware, cable, modules, clocks or ring
    pub kind: String,
    /// Index of the SubDevice in the file, from 0; null for a SubDevice that is not in the file, and for a ring
    pub subdevice: Option<usize>,
    /// Its name in the file; null for one that is not in it
    pub name: Option<String>,
    /// Its position on the bus, from 0; null for one that was not found
    pub position: Option<u16>,
    /// The network cannot reach OP with this difference
    pub prevents_op: bool,
    /// The difference in words, with the names of PDOs, entries and objects that the file, the SubDevice or its
    /// description (`--esi`) gives
    pub text: String,
}
