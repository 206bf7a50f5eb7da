//! The versions that a read was about: its findings are out of date when these have changed.

/// The versions that findings are about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Asked {
    /// Positions mean places in this cabling.
    pub cabling: u32,
    /// So often SubDevices had been put out of reach on purpose.
    pub isolations: u32,
}
