//! SDO abort codes (protocol 6.3).

use core::fmt;

/// The reason for which an SDO transfer was refused or aborted. Unknown codes are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AbortCode(pub u32);

macro_rules! abort_codes {
    ($($name:ident = $code:literal, $text:literal;)*) => {
        impl AbortCode {
            $(
                #[doc = concat!($text, ".")]
                pub const $name: AbortCode = AbortCode($code);
            )*

            /// Every code of the table, in ascending order.
            pub const ALL: &'static [AbortCode] = &[$(AbortCode::$name),*];

            /// The meaning of the code; `None` for a code that is not in the table.
            pub const fn name(self) -> Option<&'static str> {
                match self.0 {
                    $($code => Some($text),)*
                    _ => None,
                }
            }
        }
    };
}

abort_codes! {
    TOGGLE_NOT_ALTERNATED = 0x0503_0000, "Toggle bit not alternated";
    PROTOCOL_TIMEOUT = 0x0504_0000, "SDO protocol timeout";
    UNKNOWN_COMMAND = 0x0504_0001, "Command specifier unknown";
    INVALID_BLOCK_SIZE = 0x0504_0002, "Invalid block size";
    INVALID_SEQUENCE_NUMBER = 0x0504_0003, "Invalid sequence number";
    CRC_ERROR = 0x0504_0004, "CRC error";
    OUT_OF_MEMORY = 0x0504_0005, "Out of memory";
    UNSUPPORTED_ACCESS = 0x0601_0000, "Unsupported access";
    WRITE_ONLY = 0x0601_0001, "Read of a write-only object";
    READ_ONLY = 0x0601_0002, "Write of a read-only object";
    SUB_INDEX_0_FIRST = 0x0601_0003, "Subindex cannot be written, subindex 0 must be 0 first";
    COMPLETE_ACCESS_NOT_SUPPORTED = 0x0601_0004, "Complete access not supported for this object";
    OBJECT_EXCEEDS_MAILBOX = 0x0601_0005, "Object exceeds the mailbox size";
    MAPPED_TO_RX_PDO = 0x0601_0006, "Object mapped to an RxPDO, download blocked";
    OBJECT_DOES_NOT_EXIST = 0x0602_0000, "Object does not exist";
    CANNOT_BE_MAPPED = 0x0604_0041, "Object cannot be mapped to a PDO";
    MAPPING_LENGTH_EXCEEDED = 0x0604_0042, "Mapped objects exceed the PDO length";
    PARAMETER_INCOMPATIBLE = 0x0604_0043, "Parameter incompatibility";
    INTERNAL_INCOMPATIBLE = 0x0604_0047, "Internal incompatibility";
    HARDWARE_ERROR = 0x0606_0000, "Hardware error";
    LENGTH_MISMATCH = 0x0607_0010, "Length of the parameter does not match";
    LENGTH_TOO_LONG = 0x0607_0012, "Length of the parameter too long";
    LENGTH_TOO_SHORT = 0x0607_0013, "Length of the parameter too short";
    SUB_INDEX_DOES_NOT_EXIST = 0x0609_0011, "Subindex does not exist";
    VALUE_RANGE = 0x0609_0030, "Value range exceeded";
    VALUE_TOO_HIGH = 0x0609_0031, "Value too high";
    VALUE_TOO_LOW = 0x0609_0032, "Value too low";
    MODULE_LIST_MISMATCH = 0x0609_0033, "Detected modules do not match the configured list";
    MAX_LESS_THAN_MIN = 0x0609_0036, "Maximum less than minimum";
    RESOURCE_NOT_AVAILABLE = 0x060A_0023, "Resource not available";
    GENERAL = 0x0800_0000, "General error";
    CANNOT_BE_STORED = 0x0800_0020, "Data cannot be transferred or stored";
    CANNOT_BE_STORED_LOCAL_CONTROL = 0x0800_0021, "Data cannot be stored because of local control";
    CANNOT_BE_STORED_DEVICE_STATE = 0x0800_0022, "Data cannot be stored in the present device state";
    NO_DICTIONARY = 0x0800_0023, "No object dictionary";
    NO_DATA = 0x0800_0024, "No data available";
}

impl fmt::Display for AbortCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:#010x} {}", self.0, self.name().unwrap_or("unknown abort code"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn an_unknown_code_is_kept_and_displayed() {
        assert_eq!(AbortCode(0x1234_5678).to_string(), "0x12345678 unknown abort code");
        assert_eq!(AbortCode::OBJECT_DOES_NOT_EXIST.to_string(), "0x06020000 Object does not exist");
    }

    // covers: 6.3, codec-mailbox
    #[test]
    fn the_table_of_sdo_abort_codes_is_complete_and_ascending() {
        assert_eq!(AbortCode::ALL.len(), 36);
        assert!(AbortCode::ALL.is_sorted_by(|a, b| a < b));
        assert!(AbortCode::ALL.iter().all(|code| code.name().is_some()));
    }
}
