//! Error codes of ADS (protocol 6.7).

use core::fmt;

/// The reason for which a request failed. Unknown codes are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AdsErrorCode(pub u32);

macro_rules! ads_errors {
    ($($name:ident = $code:literal, $text:literal;)*) => {
        impl AdsErrorCode {
            $(
                #[doc = concat!($text, ".")]
                pub const $name: AdsErrorCode = AdsErrorCode($code);
            )*

            /// Every code of the table, in ascending order.
            pub const ALL: &'static [AdsErrorCode] = &[$(AdsErrorCode::$name),*];

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

ads_errors! {
    NO_ERROR = 0x0000, "No error";
    TARGET_PORT_NOT_FOUND = 0x0006, "Target port not found";
    TARGET_NOT_FOUND = 0x0007, "Target not found";
    UNKNOWN_COMMAND = 0x0008, "Unknown command";
    GENERAL = 0x0700, "General device error";
    SERVICE_NOT_SUPPORTED = 0x0701, "Service not supported";
    INVALID_INDEX_GROUP = 0x0702, "Invalid index group";
    INVALID_INDEX_OFFSET = 0x0703, "Invalid index offset";
    ACCESS_DENIED = 0x0704, "Reading or writing not permitted";
    INVALID_SIZE = 0x0705, "Invalid size";
    INVALID_DATA = 0x0706, "Invalid data";
    NOT_READY = 0x0707, "Not ready";
    BUSY = 0x0708, "Busy";
    NO_MEMORY = 0x070A, "Out of memory";
    INVALID_PARAMETER = 0x070B, "Invalid parameter";
    NOT_FOUND = 0x070C, "Not found";
    TIMEOUT = 0x0719, "Timeout";
}

impl fmt::Display for AdsErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:#06x} {}", self.0, self.name().unwrap_or("unknown ADS error"))
    }
}
