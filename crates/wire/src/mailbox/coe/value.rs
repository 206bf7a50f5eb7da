//! Data types of CoE objects (protocol 6.3).

use core::fmt;

/// Data type of an object or entry. Unknown codes are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct DataType(pub u16);

macro_rules! data_types {
    ($($name:ident = $code:literal, $text:literal, $bits:expr;)*) => {
        impl DataType {
            $(
                #[doc = concat!($text, ".")]
                pub const $name: DataType = DataType($code);
            )*

            /// Every type of the table, in ascending order of the codes.
            pub const ALL: &'static [DataType] = &[$(DataType::$name),*];

            /// Name of the type; `None` for a code that is not in the table.
            pub const fn name(self) -> Option<&'static str> {
                match self.0 {
                    $($code => Some($text),)*
                    _ => None,
                }
            }

            /// Bits of a value; `None` if the type has no fixed length.
            pub const fn bits(self) -> Option<u16> {
                match self.0 {
                    $($code => $bits,)*
                    _ => None,
                }
            }
        }
    };
}

data_types! {
    BOOLEAN = 0x01, "BOOLEAN", Some(1);
    INTEGER8 = 0x02, "INTEGER8", Some(8);
    INTEGER16 = 0x03, "INTEGER16", Some(16);
    INTEGER32 = 0x04, "INTEGER32", Some(32);
    UNSIGNED8 = 0x05, "UNSIGNED8", Some(8);
    UNSIGNED16 = 0x06, "UNSIGNED16", Some(16);
    UNSIGNED32 = 0x07, "UNSIGNED32", Some(32);
    REAL32 = 0x08, "REAL32", Some(32);
    VISIBLE_STRING = 0x09, "VISIBLE_STRING", None;
    OCTET_STRING = 0x0A, "OCTET_STRING", None;
    UNICODE_STRING = 0x0B, "UNICODE_STRING", None;
    TIME_OF_DAY = 0x0C, "TIME_OF_DAY", Some(48);
    TIME_DIFFERENCE = 0x0D, "TIME_DIFFERENCE", Some(48);
    DOMAIN = 0x0F, "DOMAIN", None;
    INTEGER24 = 0x10, "INTEGER24", Some(24);
    REAL64 = 0x11, "REAL64", Some(64);
    INTEGER40 = 0x12, "INTEGER40", Some(40);
    INTEGER48 = 0x13, "INTEGER48", Some(48);
    INTEGER56 = 0x14, "INTEGER56", Some(56);
    INTEGER64 = 0x15, "INTEGER64", Some(64);
    UNSIGNED24 = 0x16, "UNSIGNED24", Some(24);
    UNSIGNED40 = 0x18, "UNSIGNED40", Some(40);
    UNSIGNED48 = 0x19, "UNSIGNED48", Some(48);
    UNSIGNED56 = 0x1A, "UNSIGNED56", Some(56);
    UNSIGNED64 = 0x1B, "UNSIGNED64", Some(64);
    GUID = 0x1D, "GUID", Some(128);
    BYTE = 0x1E, "BYTE", Some(8);
    WORD = 0x1F, "WORD", Some(16);
    DWORD = 0x20, "DWORD", Some(32);
    PDO_MAPPING = 0x21, "PDO_MAPPING", None;
    IDENTITY = 0x23, "IDENTITY", None;
    BITARR8 = 0x2D, "BITARR8", Some(8);
    BITARR16 = 0x2E, "BITARR16", Some(16);
    BITARR32 = 0x2F, "BITARR32", Some(32);
    BIT1 = 0x30, "BIT1", Some(1);
    BIT2 = 0x31, "BIT2", Some(2);
    BIT3 = 0x32, "BIT3", Some(3);
    BIT4 = 0x33, "BIT4", Some(4);
    BIT5 = 0x34, "BIT5", Some(5);
    BIT6 = 0x35, "BIT6", Some(6);
    BIT7 = 0x36, "BIT7", Some(7);
    BIT8 = 0x37, "BIT8", Some(8);
    BIT9 = 0x38, "BIT9", Some(9);
    BIT10 = 0x39, "BIT10", Some(10);
    BIT11 = 0x3A, "BIT11", Some(11);
    BIT12 = 0x3B, "BIT12", Some(12);
    BIT13 = 0x3C, "BIT13", Some(13);
    BIT14 = 0x3D, "BIT14", Some(14);
    BIT15 = 0x3E, "BIT15", Some(15);
    BIT16 = 0x3F, "BIT16", Some(16);
}

impl fmt::Display for DataType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.name() {
            Some(name) => f.write_str(name),
            None => write!(f, "data type {:#06x}", self.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    // covers: 6.3, codec-mailbox
    #[test]
    fn data_types_have_names_and_sizes() {
        assert_eq!(DataType::ALL.len(), 50);
        assert!(DataType::ALL.is_sorted_by(|a, b| a < b));
        for (code, name, bits) in [
            (0x01, "BOOLEAN", Some(1)),
            (0x09, "VISIBLE_STRING", None),
            (0x11, "REAL64", Some(64)),
            (0x1D, "GUID", Some(128)),
            (0x37, "BIT8", Some(8)),
            (0x3F, "BIT16", Some(16)),
        ] {
            assert_eq!((DataType(code).name(), DataType(code).bits()), (Some(name), bits));
        }
        assert_eq!((DataType(0x0800).to_string(), DataType(0x0800).bits()), ("data type 0x0800".into(), None));
        for (place, bits) in (0x30..=0x3F).zip(1..) {
            assert_eq!(DataType(place).bits(), Some(bits));
        }
    }
}
