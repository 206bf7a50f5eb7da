//! FoE: files of a SubDevice, read into a sink and written from a source, packet by packet (protocol 6.4).

mod error;
mod read;
mod write;

use alloc::string::String;
use core::time::Duration;

use ringcat_wire::mailbox::foe::{FoeErrorCode, FoeMessage};

pub use error::{FoeError, FoeFailure};
pub use read::read;
pub use write::write;

use super::conversation::{Conversation, Limits};
use super::lane::Lane;
use super::{Mailbox, MailboxError};

/// Parameters of a transfer besides the file name.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct FoeOptions {
    /// Password, 0 for none.
    pub password: u32,
    /// Time limits of one message.
    pub limits: Limits,
    /// Pause before a message is repeated after BUSY.
    pub busy_pause: Duration,
    /// Longest BUSY without progress.
    pub busy_limit: Duration,
}

impl Default for FoeOptions {
    fn default() -> FoeOptions {
        FoeOptions {
            password: 0,
            limits: Limits::new(Duration::from_millis(100), Duration::from_secs(3)),
            busy_pause: Duration::from_millis(5),
            busy_limit: Duration::from_secs(30),
        }
    }
}

impl FoeOptions {
    /// The same options with this password; 0 for none.
    #[must_use]
    pub const fn with_password(mut self, password: u32) -> FoeOptions {
        self.password = password;
        self
    }

    /// The same options with these time limits of one message.
    #[must_use]
    pub const fn with_limits(mut self, limits: Limits) -> FoeOptions {
        self.limits = limits;
        self
    }

    /// The same options with this pause before a message is repeated after BUSY.
    #[must_use]
    pub const fn with_busy_pause(mut self, pause: Duration) -> FoeOptions {
        self.busy_pause = pause;
        self
    }

    /// The same options with this longest BUSY without progress.
    #[must_use]
    pub const fn with_busy_limit(mut self, limit: Duration) -> FoeOptions {
        self.busy_limit = limit;
        self
    }
}

/// Progress of a transfer.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FoeProgress {
    /// Bytes transferred.
    Bytes(u64),
    /// The SubDevice is busy.
    Busy {
        /// Part done.
        done: u16,
        /// Total.
        entire: u16,
        /// Its comment.
        text: String,
    },
}

/// A transfer in progress. When it is dropped before its end, the SubDevice receives an FoE error.
struct Transfer<P> {
    conversation: Conversation,
    options: FoeOptions,
    progress: P,
    /// Payload of a message.
    payload: alloc::vec::Vec<u8>,
    /// The transfer is in progress in the SubDevice.
    busy: bool,
    /// Start of BUSY without progress, and the reported progress.
    since: Option<(crate::time::Instant, u16)>,
}

/// Response of the SubDevice to a message.
enum Response<T> {
    Answer(T),
    Busy,
}

impl<P: FnMut(FoeProgress)> Transfer<P> {
    async fn begin(mailbox: &Mailbox, options: FoeOptions, progress: P) -> Result<Transfer<P>, FoeFailure> {
        let mut conversation = mailbox.conversation(Lane::Foe).await?;
        conversation.settle().await?;
        let payload = alloc::vec![0; conversation.request_capacity()];
        Ok(Transfer { conversation, options, progress, payload, busy: false, since: None })
    }

    /// Sends a message, repeats it while the SubDevice is busy, and returns what `accept` recognises as the answer.
    async fn request<T>(
        &mut self,
        message: &FoeMessage<'_>,
        mut accept: impl FnMut(FoeMessage<'_>) -> Option<T>,
    ) -> Result<T, FoeFailure> {
        self.since = None;
        loop {
            match self.try_once(message, &mut accept).await? {
                Response::Answer(answer) => return Ok(answer),
                Response::Busy => {
                    let pause = self.options.busy_pause;
                    self.conversation.pause(pause).await?;
                }
            }
        }
    }

    async fn try_once<T>(
        &mut self,
        message: &FoeMessage<'_>,
        accept: &mut impl FnMut(FoeMessage<'_>) -> Option<T>,
    ) -> Result<Response<T>, FoeFailure> {
        let Some(length) = message.encode(&mut self.payload) else {
            let bytes = FoeMessage::OVERHEAD + name_of(message).len();
            return Err(MailboxError::TooLong { bytes, limit: self.payload.len() }.into());
        };
        enum Reply<T> {
            Answer(T),
            Busy { done: u16, entire: u16, text: String },
            Error(FoeErrorCode, String),
        }
        let recognise = |payload: &[u8]| match FoeMessage::decode(payload).ok()? {
            FoeMessage::Error { code, text } => Some(Reply::Error(code, to_text(text))),
            FoeMessage::Busy { done, entire, text } => Some(Reply::Busy { done, entire, text: to_text(text) }),
            other => accept(other).map(Reply::Answer),
        };
        self.busy = true;
        let answer =
            self.conversation.request(&self.payload[..length], self.options.limits, recognise).await.inspect_err(
                |error| {
                    // If the SubDevice certainly did not open the file, no abort is needed.
                    let opens = matches!(message, FoeMessage::Read { .. } | FoeMessage::Write { .. });
                    if opens && matches!(error, MailboxError::Error(_)) && self.conversation.late_mark().is_none() {
                        self.busy = false;
                    }
                },
            )?;
        match answer {
            Reply::Answer(answer) => Ok(Response::Answer(answer)),
            Reply::Error(code, text) => {
                self.busy = false;
                Err(FoeFailure::Refused { code, text })
            }
            Reply::Busy { done, entire, text } => {
                let now = self.conversation.now();
                let (since, before) = self.since.unwrap_or((now, done));
                let since = if before == done { since } else { now };
                self.since = Some((since, done));
                if now.since(since) >= self.options.busy_limit {
                    return Err(FoeFailure::BusyForTooLong { limit: self.options.busy_limit });
                }
                (self.progress)(FoeProgress::Busy { done, entire, text });
                Ok(Response::Busy)
            }
        }
    }

    /// Ends the transfer with an FoE error message.
    fn give_up(&mut self, code: FoeErrorCode, text: &[u8]) {
        if !core::mem::take(&mut self.busy) {
            return;
        }
        if let Some(length) = (FoeMessage::Error { code, text }).encode(&mut self.payload) {
            // A closed mailbox needs no message.
            let _ = self.conversation.post(&self.payload[..length]);
        }
    }
}

impl<P> Drop for Transfer<P> {
    fn drop(&mut self) {
        if !self.busy {
            return;
        }
        let message = FoeMessage::Error { code: FoeErrorCode::NOT_DEFINED, text: b"given up" };
        if let Some(length) = message.encode(&mut self.payload) {
            let _ = self.conversation.post(&self.payload[..length]);
        }
    }
}

fn name_of<'a>(message: &FoeMessage<'a>) -> &'a [u8] {
    match *message {
        FoeMessage::Read { name, .. } | FoeMessage::Write { name, .. } => name,
        FoeMessage::Data { data, .. } => data,
        FoeMessage::Acknowledge { .. } | FoeMessage::Error { .. } | FoeMessage::Busy { .. } => &[],
    }
}

fn to_text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}
