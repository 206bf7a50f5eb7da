//! Error codes of SoE (protocol 6.6).

use core::fmt;

/// The reason for which reading or writing an element failed. Unknown codes are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SoeErrorCode(pub u16);

macro_rules! soe_errors {
    ($($name:ident = $code:literal, $text:literal;)*) => {
        impl SoeErrorCode {
            $(
                #[doc = concat!($text, ".")]
                pub const $name: SoeErrorCode = SoeErrorCode($code);
            )*

            /// Every code of the table, in ascending order.
            pub const ALL: &'static [SoeErrorCode] = &[$(SoeErrorCode::$name),*];

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

soe_errors! {
    NO_IDN = 0x1001, "No such IDN";
    INVALID_ACCESS = 0x1009, "Invalid access to element 1";
    NO_NAME = 0x2001, "No name";
    NAME_TOO_SHORT = 0x2002, "Name too short";
    NAME_TOO_LONG = 0x2003, "Name too long";
    NAME_READ_ONLY = 0x2004, "Name cannot be changed";
    NAME_PROTECTED = 0x2005, "Name is write-protected now";
    ATTRIBUTE_TOO_SHORT = 0x3002, "Attribute too short";
    ATTRIBUTE_TOO_LONG = 0x3003, "Attribute too long";
    ATTRIBUTE_READ_ONLY = 0x3004, "Attribute cannot be changed";
    ATTRIBUTE_PROTECTED = 0x3005, "Attribute is write-protected now";
    NO_UNIT = 0x4001, "No unit";
    UNIT_TOO_SHORT = 0x4002, "Unit too short";
    UNIT_TOO_LONG = 0x4003, "Unit too long";
    UNIT_READ_ONLY = 0x4004, "Unit cannot be changed";
    UNIT_PROTECTED = 0x4005, "Unit is write-protected now";
    NO_MINIMUM = 0x5001, "No minimum";
    MINIMUM_TOO_SHORT = 0x5002, "Minimum too short";
    MINIMUM_TOO_LONG = 0x5003, "Minimum too long";
    MINIMUM_READ_ONLY = 0x5004, "Minimum cannot be changed";
    MINIMUM_PROTECTED = 0x5005, "Minimum is write-protected now";
    NO_MAXIMUM = 0x6001, "No maximum";
    MAXIMUM_TOO_SHORT = 0x6002, "Maximum too short";
    MAXIMUM_TOO_LONG = 0x6003, "Maximum too long";
    MAXIMUM_READ_ONLY = 0x6004, "Maximum cannot be changed";
    MAXIMUM_PROTECTED = 0x6005, "Maximum is write-protected now";
    VALUE_TOO_SHORT = 0x7002, "Value too short";
    VALUE_TOO_LONG = 0x7003, "Value too long";
    VALUE_READ_ONLY = 0x7004, "Value cannot be changed";
    VALUE_PROTECTED = 0x7005, "Value is write-protected now";
    BELOW_MINIMUM = 0x7006, "Value below the minimum";
    ABOVE_MAXIMUM = 0x7007, "Value above the maximum";
    INVALID_VALUE = 0x7008, "Invalid value";
    PASSWORD_PROTECTED = 0x7009, "Value is protected by a password";
    CYCLICALLY_CONFIGURED = 0x700A, "Value is configured for cyclic data";
    INVALID_INDIRECT = 0x700B, "Invalid indirect addressing";
    PROTECTED_BY_SETTINGS = 0x700C, "Value is protected by other settings";
    COMMAND_ACTIVE = 0x7010, "Procedure command is active";
    COMMAND_NOT_INTERRUPTIBLE = 0x7011, "Procedure command cannot be interrupted";
    COMMAND_NOT_EXECUTABLE_NOW = 0x7012, "Procedure command cannot be executed now";
    COMMAND_NOT_EXECUTABLE = 0x7013, "Procedure command cannot be executed";
    NO_DATA_STATE = 0x7014, "No data state";
    NO_DEFAULT = 0x8001, "No default value";
    DEFAULT_TOO_LONG = 0x8002, "Default value too long";
    DEFAULT_READ_ONLY = 0x8004, "Default value cannot be changed";
    INVALID_DRIVE = 0x800A, "Invalid drive number";
    GENERAL = 0x800B, "General error";
    NO_ELEMENT = 0x800C, "No element addressed";
}

impl fmt::Display for SoeErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:#06x} {}", self.0, self.name().unwrap_or("unknown SoE error"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    // covers: 6.6, codec-mailbox
    #[test]
    fn the_table_of_soe_errors_is_complete_and_ascending() {
        assert_eq!(SoeErrorCode::ALL.len(), 48);
        assert!(SoeErrorCode::ALL.is_sorted_by(|a, b| a < b));
        assert!(SoeErrorCode::ALL.iter().all(|code| code.name().is_some()));
        assert_eq!(SoeErrorCode::ABOVE_MAXIMUM.to_string(), "0x7007 Value above the maximum");
        assert_eq!(SoeErrorCode(0x9999).to_string(), "0x9999 unknown SoE error");
    }
}
