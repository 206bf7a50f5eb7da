//! A fault of an EEPROM.

/// Failure of a write to an EEPROM.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpoiltWrite {
    /// The write is acknowledged, and the word stays unchanged: the EEPROM is write-protected.
    NotStored,
    /// The write is not acknowledged: the EEPROM is still busy internally.
    NotAcknowledged,
}
