//! Limits of a transfer by mailbox, by name.

use std::time::Duration;

use ringcat_engine::config::Timeouts;
use ringcat_engine::mail::Limits;

/// Largest number of bytes of a read by default.
const DEFAULT_BYTES: usize = 1 << 20;

/// How long one message of a transfer may take, and how much a read takes.
///
/// ```
/// use std::time::Duration;
/// use ringcat::TransferLimits;
///
/// let patient = TransferLimits::default().answer(Duration::from_secs(10)).bytes(64);
/// assert_eq!((patient.request, patient.bytes), (Duration::from_millis(100), 64));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct TransferLimits {
    /// Until the SubDevice's mailbox takes a message; 100 ms unless set.
    pub request: Duration,
    /// Until the answer to a message is there; 1 s unless set.
    pub answer: Duration,
    /// Most bytes that a read takes; 1 MiB unless set. A longer object or file is an error.
    pub bytes: usize,
}

impl Default for TransferLimits {
    fn default() -> TransferLimits {
        let Timeouts { mailbox_request, sdo, .. } = Timeouts::default();
        TransferLimits::new(mailbox_request, sdo)
    }
}

impl TransferLimits {
    /// These times for a message to be taken and for an answer, and at most 1 MiB to be read.
    pub const fn new(request: Duration, answer: Duration) -> TransferLimits {
        TransferLimits { request, answer, bytes: DEFAULT_BYTES }
    }

    /// The same, with this time for a message to be taken.
    #[must_use]
    pub const fn request(mut self, limit: Duration) -> TransferLimits {
        self.request = limit;
        self
    }

    /// The same, with this time for an answer.
    #[must_use]
    pub const fn answer(mut self, limit: Duration) -> TransferLimits {
        self.answer = limit;
        self
    }

    /// The same, with at most so many bytes to be read.
    #[must_use]
    pub const fn bytes(mut self, limit: usize) -> TransferLimits {
        self.bytes = limit;
        self
    }

    pub(crate) const fn of_message(self) -> Limits {
        Limits::new(self.request, self.answer)
    }
}
