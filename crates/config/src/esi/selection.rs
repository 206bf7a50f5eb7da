//! A device with what was chosen for it.

use super::error::Notice;
use super::model::{Device, Esi, OpMode, Pdo, SyncManager, Transition};
use super::modules::PlacedModule;

/// A device of a description with its modules, operation mode, process data and start-up commands.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Selection<'a> {
    /// The description.
    pub esi: &'a Esi,
    /// The device.
    pub device: &'a Device,
    /// Its modules.
    pub modules: Vec<PlacedModule<'a>>,
    /// The operation mode of its clock.
    pub mode: Option<&'a OpMode>,
    /// SyncManagers with process data, those without PDOs included, virtual ones not.
    pub sync_managers: Vec<SelectedSyncManager<'a>>,
    /// Start-up commands in the order in which they are sent.
    pub commands: Vec<SelectedCommand>,
    /// What is not used, or in another way than chosen.
    pub notices: Vec<Notice>,
}

/// A SyncManager with its PDOs.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SelectedSyncManager<'a> {
    /// Its number.
    pub number: u8,
    /// It has outputs of the MainDevice.
    pub outputs: bool,
    /// Its definition.
    pub definition: &'a SyncManager,
    /// Its PDOs in order, with the indices of their slots and the entries that were chosen.
    pub pdos: Vec<Pdo>,
    /// PDOs of it whose entries are not those of the description.
    pub mapped: Vec<u16>,
}

impl SelectedSyncManager<'_> {
    /// Bytes of its process data.
    pub fn bytes(&self) -> u32 {
        self.pdos.iter().fold(0, |bits: u32, pdo| bits.saturating_add(pdo.bit_length())).div_ceil(8)
    }
}

/// A start-up command.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SelectedCommand {
    /// When it is sent.
    pub transition: Transition,
    /// What is sent.
    pub message: SelectedMessage,
    /// Its purpose.
    pub comment: String,
    /// It is sent before the PDOs of the same transition are written (protocol ES-125).
    pub before_pdos: bool,
}

/// The message of a start-up command.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SelectedMessage {
    /// A download by SDO: index, subindex, complete access, data.
    Sdo(u16, u8, bool, Vec<u8>),
    /// A write of an IDN: drive, IDN, data.
    Idn(u8, u16, Vec<u8>),
    /// A message of EoE as bytes.
    Eoe(Vec<u8>),
    /// A message of AoE as bytes.
    Aoe(Vec<u8>),
}
