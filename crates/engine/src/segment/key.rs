//! The key of a SubDevice in the model.

use ringcat_wire::address::StationAddress;

/// The key of a SubDevice in the model: its station address, and the version of the addresses in which it got it. A
/// temporary address is used again after all others, its key never: a finding about a SubDevice that has left is not
/// stored for the next one with its address.
///
/// A declared SubDevice keeps its key until the application ends. Clocks are addressed by the station address alone: it
/// does not change as long as the clock is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SubDeviceKey {
    /// Its station address.
    pub station: StationAddress,
    /// The version of the addresses ([`Versions::addresses`](super::Versions)) in which it got this address.
    pub since: u32,
}
