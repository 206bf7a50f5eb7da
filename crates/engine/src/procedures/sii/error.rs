//! Why an SII cannot be read, and the time limit.

use core::fmt;
use core::time::Duration;

use ringcat_wire::register::SiiControl;

use crate::supervisor::BusError;

/// How long reading one SII may take: 64 KiB at 3 ms per command.
pub(super) const LIMIT: Duration = Duration::from_secs(30);

/// Why an SII cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SiiReadError {
    /// The bus failed.
    Bus(BusError),
    /// The EEPROM stayed busy.
    Busy {
        /// Word address.
        word: u32,
    },
    /// Reading the whole SII took too long.
    TooSlow {
        /// Word address of the next read.
        word: u32,
    },
    /// The controller repeatedly does not take the read command.
    Refused {
        /// Word address.
        word: u32,
    },
    /// The EEPROM reported an error.
    Command {
        /// Word address.
        word: u32,
        /// Value of the control register.
        control: SiiControl,
    },
}

impl SiiReadError {
    /// A change of the segment or lost frames may be the cause, so another attempt is useful.
    pub(in crate::procedures) const fn is_passing(&self) -> bool {
        matches!(self, SiiReadError::Bus(_) | SiiReadError::Refused { .. })
    }
}

impl fmt::Display for SiiReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SiiReadError::Bus(error) => error.fmt(f),
            SiiReadError::Busy { word } => write!(f, "EEPROM still busy with word {word:#06x} after 100 ms"),
            SiiReadError::TooSlow { word } => {
                write!(f, "the EEPROM is slow: at word {word:#06x} after {} s", LIMIT.as_secs())
            }
            SiiReadError::Refused { word } => write!(
                f,
                "the controller does not take the command to read EEPROM word {word:#06x}: does the PDI hold the \
                 EEPROM?"
            ),
            SiiReadError::Command { word, control } => {
                write!(f, "EEPROM error at word {word:#06x}: control register 0x0502 is {:#06x}", control.bits())
            }
        }
    }
}

impl core::error::Error for SiiReadError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            SiiReadError::Bus(error) => Some(error),
            _ => None,
        }
    }
}

impl From<BusError> for SiiReadError {
    fn from(error: BusError) -> SiiReadError {
        SiiReadError::Bus(error)
    }
}
