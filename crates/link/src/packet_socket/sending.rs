//! The side of a packet socket that sends.

use std::os::fd::{AsRawFd, OwnedFd};

use super::counters::LinkCounters;
use crate::kernel;

/// The side of a socket that sends.
#[derive(Debug)]
pub struct SendingSide<'a> {
    fd: &'a OwnedFd,
    counters: &'a mut LinkCounters,
}

impl<'a> SendingSide<'a> {
    #[inline(always)]
    pub(super) fn new(fd: &'a OwnedFd, counters: &'a mut LinkCounters) -> SendingSide<'a> {
        SendingSide { fd, counters }
    }

    /// As [`PacketSocket::send`](super::PacketSocket::send).
    #[inline(always)]
    pub fn send(&mut self, frame: &[u8]) -> bool {
        let result = kernel::send(self.fd.as_raw_fd(), frame);
        if result.is_ok() {
            self.counters.sent += 1;
        }
        result.is_ok() || self.send_again(frame, result)
    }

    #[cold]
    fn send_again(&mut self, frame: &[u8], mut result: Result<(), i32>) -> bool {
        if result == Err(libc::ENETDOWN) {
            // The error may be pending since the interface went down, although the interface is up again.
            kernel::clear_error(self.fd);
            result = kernel::send(self.fd.as_raw_fd(), frame);
        }
        match result {
            Ok(()) => self.counters.sent += 1,
            Err(libc::ENETDOWN | libc::ENXIO | libc::ENODEV) => self.counters.down += 1,
            Err(libc::ENOBUFS | libc::EAGAIN | libc::ENOMEM) => self.counters.busy += 1,
            Err(_) => self.counters.refused += 1,
        }
        result.is_ok()
    }
}
