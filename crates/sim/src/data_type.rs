//! CoE data type codes used by the models (protocol 6.3).

/// One bit.
pub const BOOL: u8 = 0x01;
/// Signed 8 bits.
pub const I8: u8 = 0x02;
/// Signed 16 bits.
pub const I16: u8 = 0x03;
/// Signed 32 bits.
pub const I32: u8 = 0x04;
/// Unsigned 8 bits.
pub const U8: u8 = 0x05;
/// Unsigned 16 bits.
pub const U16: u8 = 0x06;
/// Unsigned 32 bits.
pub const U32: u8 = 0x07;
/// Characters without terminating NUL.
pub const VISIBLE_STRING: u8 = 0x09;
/// Any bytes.
pub const OCTET_STRING: u8 = 0x0A;
