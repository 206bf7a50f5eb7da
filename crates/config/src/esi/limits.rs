//! Limits of a device description, above everything that occurs (protocol ES-04). Exceeding one is an error.

/// Bytes of one text.
pub const MAX_TEXT_BYTES: usize = 1 << 20;
/// Bytes of one attribute.
pub const MAX_ATTRIBUTE_BYTES: usize = 64 << 10;
/// Devices or modules of a file.
pub const MAX_DEVICES: usize = 20_000;
/// Elements of an array in a dictionary: subindices are 8 bits wide.
pub const MAX_ELEMENTS: u32 = 0x1_0000;
/// Files that a description refers to, one behind the other.
pub const MAX_REFERENCES: usize = 64;
