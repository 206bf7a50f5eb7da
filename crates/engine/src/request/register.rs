//! Register requests of a cyclic thread (seed 004: register requests).

use core::time::Duration;

use ringcat_wire::address::RegisterAddress;

use super::slot::{Owned, RequestFailure, RequestRefused, RequestState, Served, Subject, pair};

/// A request for registers of one SubDevice. It may be moved to the cyclic thread.
///
/// It travels in a frame of the acyclic half, within a millisecond or so: the frames of a cycle are built once at
/// activation, are checked against what was sent, and are expected back at a known time; a guest in them would make
/// each cycle's length a matter of who asks.
#[derive(Debug)]
pub struct RegisterRequest {
    owned: Owned,
}

impl RegisterRequest {
    /// A request of up to `size` bytes to a declared SubDevice, and its other side.
    pub(crate) fn new(subdevice: usize, size: usize) -> (RegisterRequest, Served) {
        let (owned, served) = pair(subdevice, size, Subject::Register { address: 0, length: 0 });
        (RegisterRequest { owned }, served)
    }

    /// Starts to read `length` bytes from an address on.
    ///
    /// # Errors
    /// It is under way, or its memory is shorter.
    pub fn read(&mut self, address: RegisterAddress, length: usize) -> Result<(), RequestRefused> {
        self.turn(address, length)?;
        self.owned.read()
    }

    /// Starts to write from an address on.
    ///
    /// # Errors
    /// It is under way, or its memory is shorter than the data.
    pub fn write(&mut self, address: RegisterAddress, data: &[u8]) -> Result<(), RequestRefused> {
        self.turn(address, data.len())?;
        self.owned.write(data)
    }

    fn turn(&mut self, address: RegisterAddress, length: usize) -> Result<(), RequestRefused> {
        let limit = self.owned.room().min(usize::from(u16::MAX));
        if length > limit {
            return Err(RequestRefused::TooLong { bytes: length, limit });
        }
        self.owned.set_subject(Subject::Register { address: address.0, length: length as u16 })
    }

    /// How far it is.
    pub fn state(&self) -> RequestState {
        self.owned.state()
    }

    /// Sets the time that the request may take in all, for all later uses, up to an hour.
    pub fn set_timeout(&mut self, timeout: Duration) -> Result<(), RequestRefused> {
        self.owned.set_timeout(timeout)
    }

    /// Has a request that is under way end as soon as the acyclic half looks, with [`RequestFailure::Cancelled`].
    pub fn cancel(&self) {
        self.owned.cancel();
    }

    /// Bytes that were read or written last.
    pub fn len(&self) -> usize {
        self.owned.len()
    }

    /// Whether nothing was read or written.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Copies the data out, as much as fits, and returns how much that is. Nothing while the request is busy.
    pub fn data(&self, out: &mut [u8]) -> usize {
        self.owned.data(out)
    }

    /// Why it failed, where it did.
    pub fn failure(&self) -> Option<RequestFailure> {
        self.owned.failure()
    }
}
