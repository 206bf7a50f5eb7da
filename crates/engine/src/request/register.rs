//! Register requests of a cyclic thread (IgH manual: register requests).

use ringcat_wire::address::RegisterAddress;

use super::slot::{AcyclicSide, Request, RequestRefused, Subject, pair};
use crate::declared::Address;
use crate::request_counter::RequestCounter;

/// A request for registers of one SubDevice. It may be moved to the cyclic thread.
///
/// The acyclic half sends it in a frame of its own, within about a millisecond. Cyclic frames are built once at
/// activation, compared with what was sent, and expected back at a known time; with a register datagram in them, the
/// length of a cycle would depend on requests.
#[derive(Debug)]
pub struct RegisterRequest {
    pub(super) request: Request,
}

impl RegisterRequest {
    /// A request of up to `size` bytes to a SubDevice, and its acyclic side.
    pub(crate) fn new(
        subdevice: Address,
        size: usize,
        request_counter: &RequestCounter,
    ) -> (RegisterRequest, AcyclicSide) {
        let (request, served) = pair(subdevice, size, Subject::Register { address: 0, length: 0 }, request_counter);
        (RegisterRequest { request }, served)
    }

    /// Starts to read `length` bytes from an address on.
    ///
    /// # Errors
    /// It is in progress, or its memory is shorter.
    pub fn read(&mut self, address: RegisterAddress, length: usize) -> Result<(), RequestRefused> {
        self.turn(address, length)?;
        self.request.start_read()
    }

    /// Starts to write from an address on.
    ///
    /// # Errors
    /// It is in progress, or its memory is shorter than the data.
    pub fn write(&mut self, address: RegisterAddress, data: &[u8]) -> Result<(), RequestRefused> {
        self.turn(address, data.len())?;
        self.request.start_write(data)
    }

    fn turn(&mut self, address: RegisterAddress, length: usize) -> Result<(), RequestRefused> {
        let limit = self.request.capacity().min(usize::from(u16::MAX));
        if length > limit {
            return Err(RequestRefused::TooLong { bytes: length, limit });
        }
        self.request.set_subject(Subject::Register { address: address.0, length: length as u16 })
    }
}
