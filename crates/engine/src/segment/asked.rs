//! What a question was about: an answer to another one is out of date.

/// Versions of what answers may be about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Asked {
    /// Positions mean places in this cabling.
    pub cabling: u32,
    /// So often SubDevices had been put out of reach on purpose.
    pub isolations: u32,
}
