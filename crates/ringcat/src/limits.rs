//! Limits of a mailbox transfer.

use std::time::Duration;

use ringcat_engine::config::Timeouts;
use ringcat_engine::mail::Limits;

/// Largest number of bytes of a read by default.
const DEFAULT_BYTES: usize = 1 << 20;

/// Limits of a transfer: times of one message, and size of a read.
///
/// ```
/// use std::time::Duration;
/// use ringcat::TransferLimits;
///
/// let patient = TransferLimits::default().with_answer(Duration::from_secs(10)).with_bytes(64);
/// assert_eq!((patient.request, patient.bytes), (Duration::from_millis(100), 64));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct TransferLimits {
    /// Limit until the SubDevice's mailbox accepts a message; 100 ms unless set.
    pub request: Duration,
    /// Limit until the answer to a message arrives; 1 s unless set.
    pub answer: Duration,
    /// Maximum number of bytes of a read; 1 MiB unless set. A longer object or file is an error.
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

    /// Sets [`TransferLimits::request`].
    #[must_use]
    pub const fn with_request(mut self, limit: Duration) -> TransferLimits {
        self.request = limit;
        self
    }

    /// Sets [`TransferLimits::answer`].
    #[must_use]
    pub const fn with_answer(mut self, limit: Duration) -> TransferLimits {
        self.answer = limit;
        self
    }

    /// Sets [`TransferLimits::bytes`].
    #[must_use]
    pub const fn with_bytes(mut self, limit: usize) -> TransferLimits {
        self.bytes = limit;
        self
    }

    pub(crate) const fn of_message(self) -> Limits {
        Limits::new(self.request, self.answer)
    }
}
