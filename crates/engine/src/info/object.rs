//! Objects and entries of a dictionary, as a SubDevice describes them (protocol 6.3).

use alloc::string::String;
use alloc::vec::Vec;

use ringcat_wire::mailbox::coe::{AccessRights, DataType, ObjectCode};

/// An object of the dictionary.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Object {
    /// Index.
    pub index: u16,
    /// Data type.
    pub data_type: DataType,
    /// Largest subindex.
    pub max_sub_index: u8,
    /// Object code.
    pub code: ObjectCode,
    /// Name.
    pub name: String,
}

/// An entry of an object.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Entry {
    /// Index.
    pub index: u16,
    /// Subindex.
    pub sub_index: u8,
    /// Data type.
    pub data_type: DataType,
    /// Length in bits.
    pub bit_length: u16,
    /// Access rights.
    pub access: AccessRights,
    /// Unit, if the SubDevice reports one.
    pub unit: Option<u16>,
    /// Default value, if the SubDevice reports one.
    pub default: Option<Vec<u8>>,
    /// Smallest value, if the SubDevice reports one.
    pub minimum: Option<Vec<u8>>,
    /// Largest value, if the SubDevice reports one.
    pub maximum: Option<Vec<u8>>,
    /// Name.
    pub name: String,
}
