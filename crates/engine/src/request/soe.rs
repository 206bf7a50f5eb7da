//! SoE requests of a cyclic thread (seed 004: SoE requests).

use core::time::Duration;

use ringcat_wire::mailbox::soe::{Idn, SoeElements};

use super::slot::{Owned, RequestFailure, RequestRefused, RequestState, Served, Subject, pair};

/// A request for elements of IDNs of one SubDevice. It may be moved to the cyclic thread.
#[derive(Debug)]
pub struct SoeRequest {
    owned: Owned,
}

impl SoeRequest {
    /// A request of up to `size` bytes to a declared SubDevice, and its other side.
    pub(crate) fn new(subdevice: usize, size: usize) -> (SoeRequest, Served) {
        let subject = Subject::Idn { drive: 0, idn: 0, elements: SoeElements::VALUE.0 };
        let (owned, served) = pair(subdevice, size, subject);
        (SoeRequest { owned }, served)
    }

    /// Turns to the value of another IDN of a drive, 0..=7, of the same SubDevice.
    ///
    /// # Errors
    /// It is under way.
    pub fn set_idn(&mut self, drive: u8, idn: Idn) -> Result<(), RequestRefused> {
        self.set_elements(drive, idn, SoeElements::VALUE)
    }

    /// Turns to other elements of an IDN: one, or several to be read at once.
    ///
    /// # Errors
    /// It is under way.
    pub fn set_elements(&mut self, drive: u8, idn: Idn, elements: SoeElements) -> Result<(), RequestRefused> {
        self.owned.set_subject(Subject::Idn { drive, idn: idn.0, elements: elements.0 })
    }

    /// Starts to read.
    ///
    /// # Errors
    /// It is under way.
    pub fn read(&mut self) -> Result<(), RequestRefused> {
        self.owned.read()
    }

    /// Starts to write.
    ///
    /// # Errors
    /// It is under way, or its memory is shorter than the data.
    pub fn write(&mut self, data: &[u8]) -> Result<(), RequestRefused> {
        self.owned.write(data)
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
