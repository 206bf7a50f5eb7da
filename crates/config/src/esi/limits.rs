//! Limits of a device description, above everything that occurs (protocol ES-04). Exceeding one is an error.

/// Bytes of one text.
pub const MAX_TEXT_BYTES: usize = 1 << 20;
/// Bytes of one attribute.
pub const MAX_ATTRIBUTE_BYTES: usize = 64 << 10;
/// Devices or modules of a file; also modules of a file with those of the files to which it refers.
pub const MAX_DEVICES: usize = 20_000;
/// Elements of an array in a dictionary: subindices are 8 bits wide.
pub const MAX_ELEMENTS: u32 = 0x1_0000;
/// Parts that the type of an object names: subindices are 8 bits wide, and some files name one several times.
pub const MAX_PARTS: usize = 1024;
/// Bytes of values and names in the objects of a device with its modules.
pub const MAX_PARTS_BYTES: usize = 16 << 20;
/// Files of modules that a description refers to, directly and one behind the other.
pub const MAX_REFERENCES: usize = 64;
/// Files of dictionaries that a description refers to.
pub const MAX_DICTIONARIES: usize = 1024;
/// Bytes of all files that a description refers to.
pub const MAX_REFERENCED_BYTES: usize = 64 << 20;
