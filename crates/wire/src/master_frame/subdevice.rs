//! State of a declared SubDevice in one byte.

/// State of a declared SubDevice: AL state in bits 0 to 3, error indication in bit 4, and three bits of the ACTIVE.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SubDeviceRecord(pub u8);

impl SubDeviceRecord {
    const ANSWERS: u8 = 0x20;
    const SETTLED: u8 = 0x40;
    const FRESH: u8 = 0x80;
    /// Bits of AL status.
    const AL_STATUS: u8 = 0x1F;

    /// With the lower byte of AL status.
    #[must_use]
    pub const fn new(al_status: u8) -> SubDeviceRecord {
        SubDeviceRecord(al_status & Self::AL_STATUS)
    }

    /// Sets whether it answers.
    #[must_use]
    pub const fn with_answers(self, answers: bool) -> SubDeviceRecord {
        self.with(Self::ANSWERS, answers)
    }

    /// Sets whether it has reached its target state with its configuration.
    #[must_use]
    pub const fn with_settled(self, settled: bool) -> SubDeviceRecord {
        self.with(Self::SETTLED, settled)
    }

    /// Sets whether its inputs are those of the cycle.
    #[must_use]
    pub const fn with_fresh(self, fresh: bool) -> SubDeviceRecord {
        self.with(Self::FRESH, fresh)
    }

    const fn with(self, bit: u8, set: bool) -> SubDeviceRecord {
        SubDeviceRecord(if set { self.0 | bit } else { self.0 & !bit })
    }

    /// AL state and error indication, as in the lower byte of AL status.
    pub const fn al_status(self) -> u8 {
        self.0 & Self::AL_STATUS
    }

    /// Whether it answers.
    pub const fn answers(self) -> bool {
        self.0 & Self::ANSWERS != 0
    }

    /// Whether it has reached its target state with its configuration.
    pub const fn is_settled(self) -> bool {
        self.0 & Self::SETTLED != 0
    }

    /// Whether its inputs are those of the cycle.
    pub const fn is_fresh(self) -> bool {
        self.0 & Self::FRESH != 0
    }
}
