//! What `pdos --json` prints.

use ringcat_control::tool::{Description, PdoEntryLine, PdoLine, SyncManagerLine};
use serde::Serialize;

use super::values::{Direction, List};

/// SyncManagers of a master's SubDevices.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Pdos<'a> {
    /// Number of the master
    pub master: u32,
    /// The selected SubDevices that have SyncManagers, in the order of their positions
    pub subdevices: List<'a, (u16, Description), (), SubDevice<'a>>,
}

/// SyncManagers of a SubDevice.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SubDevice<'a> {
    /// Position on the bus, from 0
    pub position: u16,
    /// Its SyncManagers, from SM 0 on
    pub sync_managers: List<'a, SyncManagerLine, (), SyncManager<'a>>,
}

/// A SyncManager.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SyncManager<'a> {
    /// Number of the SyncManager
    pub sync_manager: usize,
    /// Physical start address
    pub start_address: u16,
    /// Default length, in bytes
    pub default_bytes: u16,
    /// Control register
    pub control: u8,
    /// Enable byte
    pub enable: u8,
    /// `outputs` if the MainDevice writes it, `inputs` if it reads it
    pub direction: Direction,
    /// The PDOs that are assigned to it
    pub pdos: PdoList<'a>,
}

/// A PDO.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Pdo<'a> {
    /// Index of the PDO
    pub index: u16,
    /// Its name; empty where it has none
    pub name: &'a str,
    /// Its entries
    pub entries: List<'a, PdoEntryLine, (), Entry<'a>>,
}

/// An entry of a PDO.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Entry<'a> {
    /// Index of the object; 0: a gap
    pub index: u16,
    /// Sub-index of the object
    pub subindex: u8,
    /// Length, in bits
    pub length_bits: u8,
    /// Its name; empty where it has none
    pub name: &'a str,
}

/// PDOs.
pub type PdoList<'a> = List<'a, PdoLine, (), Pdo<'a>>;

impl<'a> Pdos<'a> {
    /// SubDevices by position.
    pub fn new(master: u32, all: &'a [(u16, Description)]) -> Pdos<'a> {
        Pdos { master, subdevices: List { all, context: (), make: subdevice } }
    }
}

fn subdevice<'a>(_: usize, (position, details): &'a (u16, Description), _: ()) -> SubDevice<'a> {
    let all = &details.sync_managers[..];
    SubDevice { position: *position, sync_managers: List { all, context: (), make: sync_manager } }
}

fn sync_manager(sync_manager: usize, line: &SyncManagerLine, _: ()) -> SyncManager<'_> {
    SyncManager {
        sync_manager,
        start_address: line.start,
        default_bytes: line.length,
        control: line.control,
        enable: line.enable,
        direction: Direction::of(line.is_output),
        pdos: pdos(&line.pdos),
    }
}

/// PDOs with their entries.
pub fn pdos(all: &[PdoLine]) -> PdoList<'_> {
    List { all, context: (), make: pdo }
}

fn pdo(_: usize, line: &PdoLine, _: ()) -> Pdo<'_> {
    Pdo { index: line.index, name: &line.name, entries: List { all: &line.entries, context: (), make: entry } }
}

fn entry(_: usize, line: &PdoEntryLine, _: ()) -> Entry<'_> {
    Entry { index: line.index, subindex: line.sub_index, length_bits: line.bits, name: &line.name }
}
