//! A temporary station address that was given to a SubDevice.

use ringcat_wire::address::StationAddress;

use crate::info::PdoSource;

/// A temporary station address that was given to a SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TemporaryAddress {
    /// The address.
    pub station: StationAddress,
    /// Its address before; 0 since power-on.
    pub before: StationAddress,
}

impl TemporaryAddress {
    /// Where the PDOs of its SII are known from: without an address no MainDevice has written its dictionary since
    /// power-on.
    pub fn pdo_source(&self) -> PdoSource {
        if self.before == StationAddress(0) { PdoSource::Sii } else { PdoSource::Outdated }
    }
}
