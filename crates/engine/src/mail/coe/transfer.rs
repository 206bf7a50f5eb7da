//! Common parts of uploads and downloads: the lane, aborts, and the detection of late answers.

use alloc::vec;

use ringcat_wire::mailbox::sdo::{AbortCode, INITIATE_LEN, SdoRequest, SdoResponse};

use super::address::SdoAddress;
use super::error::{SdoError, SdoFailure};
use crate::mail::lane::Lane;
use crate::mail::{Conversation, Limits, Mailbox, MailboxError};

/// Objects of every CoE device; the abort for a missing object is an answer, too.
const DEVICE_TYPE: u16 = 0x1000;
const IDENTITY: u16 = 0x1018;
/// Attempts to read one of them, if error replies may belong to other messages.
const FENCES: usize = 3;

/// A transfer in progress. If it ends early, by an error or because it is dropped, it is aborted.
pub(super) struct Transfer {
    pub conversation: Conversation,
    pub object: SdoAddress,
    limits: Limits,
    /// The SubDevice may wait for the next message.
    busy: bool,
    payload: alloc::vec::Vec<u8>,
}

impl Transfer {
    pub(super) async fn begin(mailbox: &Mailbox, object: SdoAddress, limits: Limits) -> Result<Transfer, SdoError> {
        let failed = |error| SdoError { object, cause: SdoFailure::Mailbox(error) };
        let mut conversation = mailbox.conversation(Lane::Coe).await.map_err(failed)?;
        settle(&mut conversation, limits).await.map_err(failed)?;
        conversation.mark(object.index);
        let payload = vec![0; conversation.request_capacity().max(INITIATE_LEN)];
        Ok(Transfer { conversation, object, limits, busy: false, payload })
    }

    /// Sends a request and waits for an abort or for the response that `accept` recognises.
    pub(super) async fn exchange<T>(
        &mut self,
        request: &SdoRequest<'_>,
        mut accept: impl FnMut(SdoResponse<'_>) -> Option<T>,
    ) -> Result<T, SdoError> {
        let object = self.object;
        let Some(length) = request.encode(&mut self.payload) else {
            let (bytes, limit) = (INITIATE_LEN, self.payload.len());
            return Err(self.failed(SdoFailure::Mailbox(MailboxError::TooLong { bytes, limit })));
        };
        // Segments do not name the object; there an abort without an object is accepted, too.
        let in_segments = matches!(request, SdoRequest::DownloadSegment { .. } | SdoRequest::UploadSegment { .. });
        let accept = |payload: &[u8]| match SdoResponse::decode(payload).ok()? {
            SdoResponse::Abort { index, sub_index, code } => {
                let ours = index == object.index && sub_index == object.sub_index;
                (ours || in_segments).then_some(Err(code))
            }
            response => accept(response).map(Ok),
        };
        self.busy = true;
        match self.conversation.request(&self.payload[..length], self.limits, accept).await {
            Ok(Ok(answer)) => Ok(answer),
            Ok(Err(code)) => {
                self.busy = false;
                Err(self.failed(SdoFailure::Aborted(code)))
            }
            Err(error @ MailboxError::NoAnswer { .. }) => {
                Err(self.abort(AbortCode::PROTOCOL_TIMEOUT, SdoFailure::Mailbox(error)))
            }
            Err(error) => {
                // A request that the SubDevice refused or never received is not in progress.
                let doubtful = self.conversation.late_mark().is_some();
                self.busy = in_segments || doubtful || matches!(error, MailboxError::Bus(_));
                Err(self.failed(SdoFailure::Mailbox(error)))
            }
        }
    }

    /// The transfer is complete.
    pub(super) fn done(&mut self) {
        self.busy = false;
    }

    pub(super) fn failed(&self, cause: SdoFailure) -> SdoError {
        SdoError { object: self.object, cause }
    }

    /// Aborts the transfer.
    pub(super) fn abort(&mut self, code: AbortCode, cause: SdoFailure) -> SdoError {
        self.post_abort(code);
        self.failed(cause)
    }

    fn post_abort(&mut self, code: AbortCode) {
        if !core::mem::take(&mut self.busy) {
            return;
        }
        let SdoAddress { index, sub_index, .. } = self.object;
        if let Some(length) = (SdoRequest::Abort { index, sub_index, code }).encode(&mut self.payload) {
            // A closed mailbox has no transfer to abort.
            let _ = self.conversation.post(&self.payload[..length]);
        }
    }
}

impl Drop for Transfer {
    fn drop(&mut self) {
        self.post_abort(AbortCode::GENERAL);
    }
}

/// Excludes the late answer to a request that was given up: it may still arrive and could be confused with the answer
/// to the next request for the same object. So another object is read first: a SubDevice answers in order, so no older
/// answer can arrive after that.
pub(in crate::mail) async fn settle(conversation: &mut Conversation, limits: Limits) -> Result<(), MailboxError> {
    let mut result = Ok(());
    for _ in 0..FENCES {
        let Some(late) = conversation.late_mark() else { return Ok(()) };
        let fence = if late == DEVICE_TYPE { IDENTITY } else { DEVICE_TYPE };
        conversation.mark(fence);
        conversation.forget_late();
        result = read_fence(conversation, fence, limits).await;
        match result {
            Ok(()) => return Ok(()),
            // A refusal that certainly belongs to this request is an answer, too.
            Err(MailboxError::Error(_)) => {}
            Err(error) => {
                // The request was not sent: the late answer may still arrive.
                if conversation.late_mark().is_none() {
                    conversation.mark(late);
                    conversation.expect_late(limits.answer);
                }
                return Err(error);
            }
        }
    }
    if conversation.late_mark().is_some() { result } else { Ok(()) }
}

async fn read_fence(conversation: &mut Conversation, fence: u16, limits: Limits) -> Result<(), MailboxError> {
    let request = SdoRequest::Upload { index: fence, sub_index: 0, complete_access: false };
    let mut payload = [0; INITIATE_LEN];
    let length = request.encode(&mut payload).unwrap_or(0);
    let accept = |payload: &[u8]| match SdoResponse::decode(payload).ok()? {
        SdoResponse::UploadExpedited { index, .. }
        | SdoResponse::UploadNormal { index, .. }
        | SdoResponse::Abort { index, .. } => (index == fence).then_some(()),
        SdoResponse::DownloadDone { .. }
        | SdoResponse::DownloadSegmentDone { .. }
        | SdoResponse::UploadSegment { .. } => None,
    };
    conversation.request(&payload[..length], limits, accept).await
}
