//! VoE handlers of a cyclic thread (IgH manual: VoE handlers).

use super::slot::{AcyclicSide, Request, RequestRefused, RequestState, Subject, pair};
use crate::declared::Address;
use crate::request_counter::RequestCounter;

/// Header of a vendor message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct VoeHeader {
    /// Vendor, as in the identity.
    pub vendor_id: u32,
    /// Message type, defined by the vendor.
    pub vendor_type: u16,
}

/// Vendor messages to and from one SubDevice. It may be moved to the cyclic thread.
#[derive(Debug)]
pub struct VoeHandler {
    pub(super) request: Request,
}

impl VoeHandler {
    /// A handler of messages of up to `size` bytes, without their header, and its acyclic side.
    pub(crate) fn new(subdevice: Address, size: usize, request_counter: &RequestCounter) -> (VoeHandler, AcyclicSide) {
        let (request, served) = pair(subdevice, size, Subject::Vendor { id: 0, kind: 0 }, request_counter);
        (VoeHandler { request }, served)
    }

    /// Sets the header of all messages that are written from now on.
    ///
    /// # Errors
    /// It is in progress.
    pub fn set_send_header(&mut self, vendor_id: u32, vendor_type: u16) -> Result<(), RequestRefused> {
        self.request.set_subject(Subject::Vendor { id: vendor_id, kind: vendor_type })
    }

    /// Header of the read message.
    pub fn received_header(&self) -> Option<VoeHeader> {
        match self.request.answered() {
            Some(Subject::Vendor { id, kind }) => Some(VoeHeader { vendor_id: id, vendor_type: kind }),
            Some(Subject::Object { .. } | Subject::Register { .. } | Subject::Idn { .. }) | None => None,
        }
    }

    /// Starts to read the oldest kept message of the SubDevice, otherwise its next one. The status of its mailbox is
    /// polled for messages.
    ///
    /// # Errors
    /// It is in progress.
    pub fn read(&mut self) -> Result<(), RequestRefused> {
        self.request.start_read()
    }

    /// As [`VoeHandler::read`], but reads the mailbox at once and repeatedly, without polling its status: for
    /// SubDevices that answer at once, or with an unreliable mailbox status.
    ///
    /// # Errors
    /// It is in progress.
    #[doc(alias = "read_nosync")]
    pub fn read_directly(&mut self) -> Result<(), RequestRefused> {
        self.request.start_read_directly()
    }

    /// Starts to send a message with the header that was set.
    ///
    /// # Errors
    /// It is in progress, or its memory is shorter than the data.
    pub fn write(&mut self, data: &[u8]) -> Result<(), RequestRefused> {
        self.request.start_write(data)
    }

    /// Returns the state; call this once per cycle while it is busy. The acyclic half executes the request.
    pub fn execute(&mut self) -> RequestState {
        self.state()
    }
}
