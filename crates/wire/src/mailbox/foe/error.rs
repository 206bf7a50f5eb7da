//! Error codes of FoE (protocol 6.4).

use core::fmt;

/// The reason for which a file transfer failed. Unknown codes are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FoeErrorCode(pub u32);

/// First code; old stacks start at 0 instead.
const BASE: u32 = 0x8000;
/// Last code of old stacks, without [`BASE`].
const LAST_OLD: u32 = 9;

macro_rules! foe_errors {
    ($($name:ident = $code:literal, $text:literal;)*) => {
        impl FoeErrorCode {
            $(
                #[doc = concat!($text, ".")]
                pub const $name: FoeErrorCode = FoeErrorCode($code);
            )*

            /// Every code of the table, in ascending order.
            pub const ALL: &'static [FoeErrorCode] = &[$(FoeErrorCode::$name),*];

            /// The meaning of the code, also of an old stack; `None` for a code that is not in the table.
            pub const fn name(self) -> Option<&'static str> {
                match self.modern().0 {
                    $($code => Some($text),)*
                    _ => None,
                }
            }
        }
    };
}

foe_errors! {
    NOT_DEFINED = 0x8000, "Not defined";
    NOT_FOUND = 0x8001, "Not found";
    ACCESS_DENIED = 0x8002, "Access denied";
    DISK_FULL = 0x8003, "Disk full";
    ILLEGAL = 0x8004, "Illegal";
    PACKET_NUMBER_WRONG = 0x8005, "Packet number wrong";
    ALREADY_EXISTS = 0x8006, "Already exists";
    NO_USER = 0x8007, "No user";
    BOOTSTRAP_ONLY = 0x8008, "Bootstrap only";
    NOT_BOOTSTRAP = 0x8009, "Not in bootstrap";
    NO_RIGHTS = 0x800A, "No rights";
    PROGRAM_ERROR = 0x800B, "Program error";
    CHECKSUM_WRONG = 0x800C, "Checksum wrong";
    FIRMWARE_DOES_NOT_FIT = 0x800D, "Firmware does not fit";
}

impl FoeErrorCode {
    /// The code as sent today: old stacks omitted 0x8000.
    pub const fn modern(self) -> FoeErrorCode {
        if self.0 <= LAST_OLD { FoeErrorCode(BASE | self.0) } else { self }
    }
}

impl fmt::Display for FoeErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:#06x} {}", self.0, self.name().unwrap_or("unknown FoE error"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    // covers: 6.4
    #[test]
    fn the_table_of_foe_errors_is_complete_and_ascending() {
        assert_eq!(FoeErrorCode::ALL.len(), 14);
        assert!(FoeErrorCode::ALL.is_sorted_by(|a, b| a < b));
        assert!(FoeErrorCode::ALL.iter().all(|code| code.name().is_some()));
        assert_eq!(FoeErrorCode::BOOTSTRAP_ONLY.to_string(), "0x8008 Bootstrap only");
    }

    // covers: 6.4, codec-mailbox
    #[test]
    fn codes_of_old_stacks_are_translated() {
        assert_eq!(FoeErrorCode(1).to_string(), "0x0001 Not found");
        assert_eq!(FoeErrorCode(9).modern(), FoeErrorCode::NOT_BOOTSTRAP);
        assert_eq!(FoeErrorCode(10).name(), None);
        assert_eq!(FoeErrorCode(0xDEAD).to_string(), "0xdead unknown FoE error");
    }
}
