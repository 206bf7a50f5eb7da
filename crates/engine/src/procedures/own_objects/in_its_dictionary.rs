//! Entries whose values are read from the object dictionary of a SubDevice, by mailbox, at each request of a client
//! (protocol 6.3, 10.2).

use core::time::Duration;

use ringcat_wire::mailbox::coe::DiagnosisHistory;
use ringcat_wire::sii::MailboxProtocols;

use crate::mail::coe::{SdoAddress, SdoFailure, read};
use crate::mail::{Limits, Mailbox};
use crate::procedures::shared_segment::SharedSegment;

/// Short limits: other clients of address 0 wait meanwhile.
const LIMITS: Limits = Limits::new(Duration::from_millis(100), Duration::from_millis(300));
const DEVICE_TYPE: SdoAddress = SdoAddress::new(0x1000, 0);
/// Maximum bytes of these entries.
const ROOM: usize = 4;

/// A SubDevice, and the requested entries.
pub(super) struct Requested<W> {
    /// The mailbox, if the SubDevice supports CoE.
    mailbox: Option<Mailbox>,
    is_requested: W,
}

impl<W: Fn(u8) -> bool> Requested<W> {
    /// `is_requested` returns whether a subindex is requested; others are not read.
    pub fn of(segment: &SharedSegment, index: usize, is_requested: W) -> Requested<W> {
        let view = segment.view();
        let info = view.member(index).and_then(|member| member.info);
        let has_coe = info.is_some_and(|info| info.protocols.0 & MailboxProtocols::COE != 0);
        Requested { mailbox: segment.mailbox(index).filter(|_| has_coe).filter(Mailbox::is_open), is_requested }
    }

    /// The value read; `None` also without an answer.
    async fn value(&self, sub_index: u8, object: SdoAddress) -> Option<u32> {
        let mailbox = self.mailbox.as_ref().filter(|_| (self.is_requested)(sub_index))?;
        let before = mailbox.last_protocol_error();
        let answer = read(mailbox, object, LIMITS, ROOM).await;
        if answer.as_ref().is_err_and(|error| matches!(error.cause, SdoFailure::Aborted(_))) {
            // A missing object is not an error of the SubDevice.
            mailbox.forget_protocol_error(before);
        }
        let mut bytes = answer.ok()?;
        bytes.resize(ROOM, 0);
        bytes.first_chunk().map(|bytes| u32::from_le_bytes(*bytes))
    }

    /// Its device type (0x1000); 0 if it has none.
    pub async fn device_type(&self, sub_index: u8) -> u32 {
        self.value(sub_index, DEVICE_TYPE).await.unwrap_or(0)
    }

    /// Whether it has a diagnosis history.
    pub async fn has_history(&self, sub_index: u8) -> bool {
        let maximum = SdoAddress::new(DiagnosisHistory::INDEX, DiagnosisHistory::MAXIMUM_MESSAGES);
        self.value(sub_index, maximum).await.is_some()
    }

    /// Whether it contains messages that are not acknowledged.
    pub async fn has_new_message(&self, sub_index: u8) -> bool {
        let new_available = SdoAddress::new(DiagnosisHistory::INDEX, DiagnosisHistory::NEW_AVAILABLE);
        self.value(sub_index, new_available).await.is_some_and(|flag| flag != 0)
    }
}
