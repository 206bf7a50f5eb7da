//! AoE: ADS requests to a SubDevice (protocol 6.7; layout of the public ADS specification).
//!
//! Converts the payload of a mailbox message of protocol AoE: an [`AmsHeader`] and the data of a command,
//! [`AdsRequest`] or [`AdsResponse`].

mod command;
mod error;
mod header;

use super::payload::{FieldWriter, PayloadError, split};

pub use command::{AdsRequest, AdsResponse};
pub use error::AdsErrorCode;
pub use header::{AdsCommand, AmsAddress, AmsHeader, NetId};

/// Index groups of SubDevices (protocol 6.7).
pub mod index_group {
    /// SDO: the offset is index in the upper half, complete access in bit 8, subindex in bits 7:0.
    pub const SDO: u32 = 0xF302;
    /// SDO information: list of objects.
    pub const SDO_INFORMATION_LIST: u32 = 0xF3FC;
    /// SDO information: an object.
    pub const SDO_INFORMATION_OBJECT: u32 = 0xF3FD;
    /// SDO information: an entry.
    pub const SDO_INFORMATION_ENTRY: u32 = 0xF3FE;
    /// FoE, first of six groups.
    pub const FOE: u32 = 0xF401;
    /// SoE.
    pub const SOE: u32 = 0xF420;
    /// VoE.
    pub const VOE: u32 = 0xF430;
}

#[cfg(test)]
mod tests;
