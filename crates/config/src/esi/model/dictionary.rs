//! Profiles and object dictionaries (protocol ES-20 to ES-24, ES-72 to ES-76).

use std::sync::Arc;

use super::names::Names;
use super::pdo::SlotIndex;
use super::reference::Reference;

/// A profile of a device or module.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Profile {
    /// Number of each channel's profile, with the additional information.
    pub channels: Vec<(u32, Option<u32>)>,
    /// The dictionary.
    pub dictionary: Option<Arc<Dictionary>>,
    /// File with the dictionary, as written.
    pub dictionary_file: Option<Reference>,
}

/// An object dictionary with its own data types.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Dictionary {
    /// Line in the file.
    pub line: u32,
    /// The file, if it is one of its own.
    pub file: Option<Arc<str>>,
    /// Data types, sorted by name.
    pub data_types: Vec<DataType>,
    /// Objects in document order.
    pub objects: Vec<Object>,
}

impl Dictionary {
    /// The data type of a name.
    pub fn data_type(&self, name: &str) -> Option<&DataType> {
        let at = self.data_types.binary_search_by(|of| of.name.as_str().cmp(name)).ok()?;
        self.data_types.get(at)
    }
}

/// A data type.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DataType {
    /// Line in the file.
    pub line: u32,
    /// Name.
    pub name: String,
    /// Type of the elements of an array, or of an enumeration.
    pub base: Option<String>,
    /// Bits of the whole.
    pub bit_size: u32,
    /// Bounds of an array.
    pub array: Option<ArrayBounds>,
    /// Parts of a record.
    pub sub_items: Vec<SubItem>,
    /// Values of an enumeration.
    pub choices: Vec<(i64, Names)>,
}

/// Bounds of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ArrayBounds {
    /// First index.
    pub first: u32,
    /// Number of elements.
    pub elements: u32,
}

/// A part of a record.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SubItem {
    /// Subindex; `None` for the elements of an array.
    pub sub_index: Option<u8>,
    /// Name.
    pub name: String,
    /// Its type.
    pub data_type: String,
    /// Bits.
    pub bit_size: u32,
    /// First bit.
    pub bit_offset: u32,
    /// Flags; `None`: those of the object.
    pub flags: Option<Flags>,
}

/// States in which a value can be read or written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Access {
    /// Readable in PREOP, SAFEOP, OP: bits 0 to 2.
    pub read: u8,
    /// Writable in PREOP, SAFEOP, OP: bits 0 to 2.
    pub write: u8,
}

/// Flags of an object or of a part of it; each has its own default (protocol ES-72).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Flags {
    /// Access; `ro` by default.
    pub access: Access,
    /// It can be mapped to a TxPDO.
    pub tx_mappable: bool,
    /// It can be mapped to an RxPDO.
    pub rx_mappable: bool,
    /// It is part of a backup.
    pub is_backup: bool,
    /// It is a setting.
    pub is_setting: bool,
}

impl Default for Flags {
    fn default() -> Flags {
        let access = Access { read: 7, write: 0 };
        Flags { access, tx_mappable: false, rx_mappable: false, is_backup: false, is_setting: false }
    }
}

impl Flags {
    /// The access word of SDO information (protocol ES-74).
    pub const fn access_word(&self) -> u16 {
        self.access.read as u16
            | (self.access.write as u16) << 3
            | (self.rx_mappable as u16) << 6
            | (self.tx_mappable as u16) << 7
            | (self.is_backup as u16) << 8
            | (self.is_setting as u16) << 9
    }
}

/// An object.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Object {
    /// Line in the file.
    pub line: u32,
    /// Index.
    pub index: SlotIndex,
    /// A module's object of the same index replaces it.
    pub overwritten_by_module: bool,
    /// Name.
    pub name: Names,
    /// Its type.
    pub data_type: String,
    /// Bits of the whole.
    pub bit_size: u32,
    /// Values.
    pub info: ObjectInfo,
    /// Values of the parts, by name.
    pub sub_items: Vec<SubItemInfo>,
    /// Flags.
    pub flags: Flags,
}

/// Values of an object or of a part of it, little-endian.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ObjectInfo {
    /// Default.
    pub default: Option<Vec<u8>>,
    /// Smallest value.
    pub minimum: Option<Vec<u8>>,
    /// Largest value.
    pub maximum: Option<Vec<u8>>,
    /// Unit.
    pub unit: Option<u32>,
}

/// Values of a part.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SubItemInfo {
    /// Name of the part.
    pub name: String,
    /// Its values.
    pub info: ObjectInfo,
}
