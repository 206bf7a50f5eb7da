//! Slots of modular devices and their modules (MDP, protocol ES-64 to ES-71).

use std::sync::Arc;

use super::dictionary::Profile;
use super::mailbox::{CoeCommand, Transition};
use super::names::Names;
use super::pdo::Pdo;

/// Distances of the indices of neighbouring slots or slot groups.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SlotDistances {
    /// Distance between the PDOs of neighbouring slots.
    pub pdo: Option<u16>,
    /// Distance between the objects of neighbouring slots.
    pub object: Option<u16>,
    /// Distance between the PDOs of neighbouring slot groups.
    pub group_pdo: Option<u16>,
    /// Distance between the objects of neighbouring slot groups.
    pub group_object: Option<u16>,
}

/// `Slots` of a device.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Slots {
    /// Line in the file.
    pub line: u32,
    /// Distances of indices.
    pub distances: SlotDistances,
    /// Maximum number of slots.
    pub most: Option<u16>,
    /// The list of module idents is written to 0xF030.
    pub download_idents: bool,
    /// When it is written.
    pub download_transition: Transition,
    /// The list of module addresses is written to 0xF020.
    pub download_addresses: bool,
    /// Slots in document order.
    pub slots: Vec<Slot>,
    /// Packing of PDOs by slot group.
    pub groups: Vec<SlotGroupData>,
}

/// A slot definition.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Slot {
    /// Line in the file.
    pub line: u32,
    /// Name.
    pub name: Names,
    /// Number of these slots that have to be filled.
    pub least: u16,
    /// Number of these slots.
    pub most: u16,
    /// Slot group.
    pub group: Option<u16>,
    /// Distances that override those of the device.
    pub distances: SlotDistances,
    /// Modules by ident.
    pub modules: Vec<AllowedModule>,
    /// Modules by class.
    pub classes: Vec<ModuleClass>,
}

/// A module that fits a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AllowedModule {
    /// Its ident.
    pub ident: u32,
    /// It is the preset of the slot.
    pub is_default: bool,
}

/// A class of modules that fit a slot.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ModuleClass {
    /// The class.
    pub class: String,
    /// Vendor of the modules, if another one.
    pub vendor_id: Option<u32>,
}

/// Packing of the PDOs of a slot group.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SlotGroupData {
    /// The slot group.
    pub group: u16,
    /// Groups of PDOs in their order, with the alignment in bits.
    pub pdo_groups: Vec<(String, u16)>,
}

/// A module.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Module {
    /// Line in the file.
    pub line: u32,
    /// Type.
    pub kind: String,
    /// Ident.
    pub ident: u32,
    /// Class.
    pub class: Option<String>,
    /// Name.
    pub name: Names,
    /// PDOs from the MainDevice.
    pub rx_pdos: Vec<Pdo>,
    /// PDOs to the MainDevice.
    pub tx_pdos: Vec<Pdo>,
    /// Start-up commands.
    pub commands: Vec<CoeCommand>,
    /// Profiles with their dictionaries.
    pub profiles: Vec<Profile>,
    /// The operation mode that it selects.
    pub op_mode: Option<String>,
    /// Vendor of the file.
    pub vendor_id: u32,
    /// The file with the module.
    pub file: Arc<str>,
}
