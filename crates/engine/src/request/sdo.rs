//! SDO requests of a cyclic thread.

use super::slot::{AcyclicSide, Request, RequestRefused, Subject, pair};
use crate::declared::Address;
use crate::request_counter::RequestCounter;

/// A request for objects of one SubDevice. It may be moved to the cyclic thread.
#[derive(Debug)]
pub struct SdoRequest {
    pub(super) request: Request,
}

impl SdoRequest {
    /// A request of `size` bytes for an object of a SubDevice, and its acyclic side.
    pub(crate) fn new(subdevice: Address, size: usize, request_counter: &RequestCounter) -> (SdoRequest, AcyclicSide) {
        let subject = Subject::Object { index: 0, sub_index: 0, complete_access: false };
        let (request, served) = pair(subdevice, size, subject, request_counter);
        (SdoRequest { request }, served)
    }

    /// Changes to another object of the same SubDevice.
    pub fn set_object(&mut self, index: u16, sub_index: u8, complete_access: bool) -> Result<(), RequestRefused> {
        self.request.set_subject(Subject::Object { index, sub_index, complete_access })
    }

    /// Starts to read.
    pub fn read(&mut self) -> Result<(), RequestRefused> {
        self.request.start_read()
    }

    /// Starts to write.
    pub fn write(&mut self, data: &[u8]) -> Result<(), RequestRefused> {
        self.request.start_write(data)
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec;
    use core::time::Duration;

    use ringcat_wire::mailbox::sdo::AbortCode;

    use super::*;
    use crate::declared::SubDeviceId;
    use crate::request::{Access, RequestFailure, RequestState};

    // covers: jobs, sdo
    #[test]
    fn a_request_is_executed_by_the_acyclic_side_and_returns_the_read_data() {
        let (mut request, served) = SdoRequest::new(SubDeviceId(3).into(), 8, &RequestCounter::default());
        assert_eq!((request.state(), served.take()), (RequestState::Unused, None));
        request.set_object(0x2000, 7, true).unwrap();
        request.set_timeout(Duration::from_millis(5)).unwrap();
        request.read().unwrap();
        assert_eq!(request.state(), RequestState::Busy);
        let order = served.take().unwrap();
        assert_eq!(order.subject, Subject::Object { index: 0x2000, sub_index: 7, complete_access: true });
        assert_eq!((order.timeout, order.capacity), (Duration::from_millis(5), 8));
        assert_eq!(order.subdevice, SubDeviceId(3).into());
        assert_eq!((order.access, served.take()), (Access::Read, None));
        assert_eq!(request.set_object(1, 1, false), Err(RequestRefused::Busy));
        assert_eq!(request.read(), Err(RequestRefused::Busy));
        let mut out = [0; 8];
        assert_eq!(request.data(&mut out), 0);
        served.succeed(Some(&[1, 2, 3]), None);
        assert_eq!((request.state(), request.data(&mut out)), (RequestState::Success, 3));
        assert_eq!(out[..3], [1, 2, 3]);
        request.set_object(0x2001, 0, false).unwrap();
        assert_eq!(request.state(), RequestState::Unused);
    }

    #[test]
    fn data_beyond_the_capacity_is_refused_and_failures_are_returned() {
        let (mut request, served) = SdoRequest::new(SubDeviceId(0).into(), 2, &RequestCounter::default());
        assert_eq!(request.write(&[1, 2, 3]), Err(RequestRefused::TooLong { bytes: 3, limit: 2 }));
        request.write(&[1, 2]).unwrap();
        assert_eq!(served.take().unwrap().access, Access::Write(vec![1, 2]));
        served.fail(RequestFailure::Aborted(AbortCode::READ_ONLY));
        assert_eq!(request.failure(), Some(RequestFailure::Aborted(AbortCode::READ_ONLY)));
        request.read().unwrap();
        served.take().unwrap();
        served.succeed(Some(&[1, 2, 3]), None);
        assert_eq!(request.failure(), Some(RequestFailure::TooLong));
        request.read().unwrap();
        served.end();
        assert_eq!(request.failure(), Some(RequestFailure::Failed));
        assert!(!served.is_abandoned());
        drop(request);
        assert!(served.is_abandoned());
    }

    #[test]
    fn only_a_request_in_progress_is_cancelled() {
        let (mut request, served) = SdoRequest::new(SubDeviceId(0).into(), 2, &RequestCounter::default());
        request.cancel();
        assert!(!served.is_cancelled());
        request.read().unwrap();
        request.cancel();
        assert!(served.is_cancelled());
        served.fail(RequestFailure::Cancelled);
        request.read().unwrap();
        assert!(!served.is_cancelled(), "the next request is not cancelled");
    }
}
