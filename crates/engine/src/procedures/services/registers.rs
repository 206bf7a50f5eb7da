//! Registers and memory of one SubDevice, any number of bytes (protocol 3).

use alloc::vec::Vec;

use ringcat_wire::address::{RegisterAddress, StationAddress};
use ringcat_wire::datagram::MAX_DATA;

use super::ServiceError;
use crate::procedures::junction::ordering;
use crate::procedures::shared_segment::SharedSegment;
use crate::supervisor::Bus;

/// When a datagram of a service is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Urgency {
    /// In the order of requests.
    InOrder,
    /// Before all datagrams that wait. Only datagrams that are on the wire are not overtaken.
    First,
}

/// Address space of a SubDevice.
const MEMORY: usize = 1 << 16;

/// Reads bytes from an address on, in as many datagrams as needed.
pub async fn read(
    bus: &Bus,
    station: StationAddress,
    address: RegisterAddress,
    length: usize,
) -> Result<Vec<u8>, ServiceError> {
    check(address, length)?;
    let mut bytes = Vec::with_capacity(length);
    while bytes.len() < length {
        let at = address.offset(bytes.len() as u16);
        let piece = (length - bytes.len()).min(MAX_DATA);
        bytes.extend(bus.fprd(station, at, piece).await?);
    }
    Ok(bytes)
}

/// Writes bytes from an address on, in as many datagrams as needed. A datagram of a lost frame is sent again: a
/// register may be written twice.
pub async fn write(
    bus: &Bus,
    segment: &SharedSegment,
    station: StationAddress,
    address: RegisterAddress,
    data: &[u8],
    urgency: Urgency,
) -> Result<(), ServiceError> {
    check(address, data.len())?;
    let _order = ordering(segment, station, address, data);
    for (number, piece) in data.chunks(MAX_DATA).enumerate() {
        let at = address.offset((number * MAX_DATA) as u16);
        match urgency {
            Urgency::InOrder => bus.fpwr(station, at, piece).await?,
            Urgency::First => bus.fpwr_first(station, at, piece).await?,
        }
    }
    Ok(())
}

fn check(address: RegisterAddress, length: usize) -> Result<(), ServiceError> {
    let fits = length <= MEMORY - usize::from(address.0);
    if fits { Ok(()) } else { Err(ServiceError::Range { address: address.0, length }) }
}
