//! The versions of the model when a procedure starts: its results are outdated when these have changed.

/// Versions of the model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Versions {
    /// Version of the cabling to which positions belong.
    pub cabling: u32,
    /// Number of times that SubDevices had been put out of reach on purpose.
    pub isolations: u32,
    /// Number of times that station addresses had been assigned or taken away.
    pub addresses: u32,
}
