//! Where the PDOs of a SubDevice are known from.

/// Where the PDOs of a SubDevice are known from, and whether its object dictionary may hold others.
///
/// A dictionary that was written may be back at that of power-on whenever the SubDevice has been in INIT: manufacturers
/// differ. So what is not as at power-on is compared each time that a SubDevice comes from INIT.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum PdoSource {
    /// The SII. The dictionary has not been written since power-on.
    #[default]
    Sii,
    /// The dictionary, which has not been written since power-on.
    Dictionary,
    /// The dictionary, as it was read or written last. It was written since power-on.
    Written,
    /// The SII, or an earlier dictionary: another program may have written others since, or an attempt to write them
    /// has failed.
    Outdated,
}

impl PdoSource {
    /// Whether the dictionary is as at power-on.
    pub const fn is_of_power_on(self) -> bool {
        matches!(self, PdoSource::Sii | PdoSource::Dictionary)
    }

    /// Whether the PDOs are those of the dictionary.
    pub const fn is_of_dictionary(self) -> bool {
        matches!(self, PdoSource::Dictionary | PdoSource::Written)
    }

    /// The same, after the dictionary was read or written.
    pub(crate) const fn held(self) -> PdoSource {
        if self.is_of_power_on() { PdoSource::Dictionary } else { PdoSource::Written }
    }
}
