//! SoE requests of a cyclic thread (IgH manual: SoE requests).

use ringcat_wire::mailbox::soe::{Idn, SoeElements};

use super::slot::{AcyclicSide, Request, RequestRefused, Subject, pair};
use crate::declared::Address;
use crate::request_counter::RequestCounter;

/// A request for elements of IDNs of one SubDevice. It may be moved to the cyclic thread.
#[derive(Debug)]
pub struct SoeRequest {
    pub(super) request: Request,
}

impl SoeRequest {
    /// A request of up to `size` bytes to a SubDevice, and its acyclic side.
    pub(crate) fn new(subdevice: Address, size: usize, request_counter: &RequestCounter) -> (SoeRequest, AcyclicSide) {
        let subject = Subject::Idn { drive: 0, idn: 0, elements: SoeElements::VALUE.0 };
        let (request, served) = pair(subdevice, size, subject, request_counter);
        (SoeRequest { request }, served)
    }

    /// Changes to the value of another IDN of a drive, 0..=7, of the same SubDevice.
    ///
    /// # Errors
    /// It is in progress.
    pub fn set_idn(&mut self, drive: u8, idn: Idn) -> Result<(), RequestRefused> {
        self.set_elements(drive, idn, SoeElements::VALUE)
    }

    /// Changes to other elements of an IDN: one, or several to be read at once.
    ///
    /// # Errors
    /// It is in progress.
    pub fn set_elements(&mut self, drive: u8, idn: Idn, elements: SoeElements) -> Result<(), RequestRefused> {
        self.request.set_subject(Subject::Idn { drive, idn: idn.0, elements: elements.0 })
    }

    /// Starts to read.
    ///
    /// # Errors
    /// It is in progress.
    pub fn read(&mut self) -> Result<(), RequestRefused> {
        self.request.start_read()
    }

    /// Starts to write.
    ///
    /// # Errors
    /// It is in progress, or its memory is shorter than the data.
    pub fn write(&mut self, data: &[u8]) -> Result<(), RequestRefused> {
        self.request.start_write(data)
    }
}
