//! A fault of an EEPROM.

/// How a write to an EEPROM goes wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpoiltWrite {
    /// It is acknowledged, and the word stays as it was: the EEPROM is write-protected.
    NotStored,
    /// It is not acknowledged: the EEPROM is still busy inside.
    NotAcknowledged,
}
