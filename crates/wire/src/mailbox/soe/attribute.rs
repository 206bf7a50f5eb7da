//! The attribute of an IDN, element 3 (protocol 6.6; bits of IEC 61491).

/// Length of the data of an IDN.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum IdnLength {
    /// Fixed length: 1, 2, 4 or 8 bytes.
    Fixed(u8),
    /// A list of elements with this number of bytes; before it two 16-bit lengths in bytes: current and maximum.
    List(u8),
}

/// The attribute of an IDN.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct IdnAttribute(pub u32);

const LENGTH_SHIFT: u32 = 16;
const LIST: u32 = 1 << 18;
const COMMAND: u32 = 1 << 19;
const DECIMALS_SHIFT: u32 = 24;

impl IdnAttribute {
    /// Bit: cannot be written in PREOP (communication phase 2).
    pub const PROTECTED_PREOP: u32 = 1 << 28;
    /// Bit: cannot be written in SAFEOP (communication phase 3).
    pub const PROTECTED_SAFEOP: u32 = 1 << 29;
    /// Bit: cannot be written in OP (communication phase 4).
    pub const PROTECTED_OP: u32 = 1 << 30;

    /// An attribute with conversion factor 1 for data of this length. An invalid element size is replaced by 1 byte.
    pub const fn new(length: IdnLength) -> IdnAttribute {
        let (bytes, list) = match length {
            IdnLength::Fixed(bytes) => (bytes, 0),
            IdnLength::List(bytes) => (bytes, LIST),
        };
        let size = match bytes {
            2 => 1,
            4 => 2,
            8 => 3,
            _ => 0,
        };
        IdnAttribute(1 | size << LENGTH_SHIFT | list)
    }

    /// The attribute of a procedure command.
    pub const fn command(self) -> IdnAttribute {
        IdnAttribute(self.0 | COMMAND)
    }

    /// Length of the data.
    pub const fn length(self) -> IdnLength {
        let bytes = 1 << (self.0 >> LENGTH_SHIFT & 0x03);
        if self.0 & LIST != 0 { IdnLength::List(bytes) } else { IdnLength::Fixed(bytes) }
    }

    /// Whether the IDN is a procedure command.
    pub const fn is_command(self) -> bool {
        self.0 & COMMAND != 0
    }

    /// Factor between the number on the wire and the value.
    pub const fn conversion_factor(self) -> u16 {
        self.0 as u16
    }

    /// Display format: 0 binary, 1 unsigned, 2 signed, 3 hexadecimal, 4 text, 5 IDN, 6 floating point.
    pub const fn display_format(self) -> u8 {
        (self.0 >> 20 & 0x07) as u8
    }

    /// Decimal places.
    pub const fn decimals(self) -> u8 {
        (self.0 >> DECIMALS_SHIFT & 0x0F) as u8
    }

    /// Whether all of these bits are set.
    pub const fn has(self, bits: u32) -> bool {
        self.0 & bits == bits
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: 6.6, codec-mailbox
    #[test]
    fn the_length_is_in_bits_18_to_16() {
        for (bits, length) in [
            (0, IdnLength::Fixed(1)),
            (1, IdnLength::Fixed(2)),
            (2, IdnLength::Fixed(4)),
            (3, IdnLength::Fixed(8)),
            (4, IdnLength::List(1)),
            (5, IdnLength::List(2)),
            (6, IdnLength::List(4)),
            (7, IdnLength::List(8)),
        ] {
            assert_eq!(IdnAttribute(bits << 16).length(), length);
            assert_eq!(IdnAttribute::new(length), IdnAttribute(bits << 16 | 1));
        }
    }

    #[test]
    fn format_decimals_and_command_have_their_bits() {
        let attribute = IdnAttribute(0x7329_000A);
        assert_eq!((attribute.conversion_factor(), attribute.display_format(), attribute.decimals()), (10, 2, 3));
        assert!(attribute.is_command() && attribute.has(IdnAttribute::PROTECTED_OP));
        assert!(!IdnAttribute::new(IdnLength::Fixed(2)).is_command());
        assert_eq!(IdnAttribute::new(IdnLength::Fixed(2)).command(), IdnAttribute(0x0009_0001));
    }
}
