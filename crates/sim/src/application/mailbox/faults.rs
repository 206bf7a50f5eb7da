//! Faults of a device's mail for tests.
//!
//! Input: [`MailFault`]s from a test. Output: their effect on the next messages. Faults stay across a reopening of the
//! mailbox, until they are used up or cleared by [`MailFault::Heal`].

use core::time::Duration;

use ringcat_wire::mailbox::Protocol;
use ringcat_wire::mailbox::coe::Emergency;
use ringcat_wire::mailbox::foe::{FoeErrorCode, FoeMessage};
use ringcat_wire::mailbox::sdo::{AbortCode, SdoRequest, SdoResponse};

use crate::application::answer::Answer;
use crate::application::coe::emergency_payload;
use crate::time::SimTime;

/// A fault of a device's mail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MailFault {
    /// The next requests are executed but not answered; `u32::MAX` for a device that no longer answers.
    LoseAnswers {
        /// Number of answers.
        count: u32,
    },
    /// The next requests are accepted and dropped: neither executed nor answered.
    LoseRequests {
        /// Number of requests.
        count: u32,
    },
    /// The next responses are sent twice, with the same counter.
    RepeatAnswers {
        /// Number of answers.
        count: u32,
    },
    /// The next responses are delayed; later responses may overtake them.
    DelayAnswers {
        /// Number of answers.
        count: u32,
        /// Delay.
        by: Duration,
    },
    /// The next responses have this counter; the counter sequence is not affected.
    WrongCounter {
        /// Number of answers.
        count: u32,
        /// The counter, 0..=7.
        counter: u8,
    },
    /// An emergency directly precedes the next responses.
    EmergencyBefore {
        /// Number of answers.
        count: u32,
        /// Error code of the emergency.
        code: u16,
    },
    /// The next requests are answered with a mailbox error reply.
    Refuse {
        /// Number of requests.
        count: u32,
        /// Detail of the error reply.
        detail: u16,
    },
    /// The next SDO requests are answered with an abort.
    AbortSdo {
        /// Number of requests.
        count: u32,
        /// Abort code.
        code: AbortCode,
    },
    /// The next FoE messages are answered with BUSY; the sender has to repeat them.
    BusyFoe {
        /// Number of messages.
        count: u32,
    },
    /// The next FoE message is answered with an error.
    FailFoe {
        /// Error code.
        code: FoeErrorCode,
    },
    /// The device takes no message from the mailbox for some time: it stays full.
    Full {
        /// Duration.
        during: Duration,
    },
    /// Clears all faults.
    Heal,
}

/// Effect on a response.
#[derive(Clone, Debug, Default)]
pub struct ResponseEffect {
    /// Delay.
    pub delay: Duration,
    /// Whether it is sent twice.
    pub twice: bool,
    /// Counter, if replaced.
    pub counter: Option<u8>,
    /// CoE message sent before it.
    pub before: Option<Vec<u8>>,
}

/// Faults for the next messages.
#[derive(Clone, Copy, Debug, Default)]
pub struct MailFaults {
    lose_answers: u32,
    lose_requests: u32,
    repeat: u32,
    delay: (u32, Duration),
    counter: (u32, u8),
    emergency: (u32, u16),
    refuse: (u32, u16),
    abort: (u32, Option<AbortCode>),
    /// Remaining number, and total.
    busy: (u32, u32),
    fail: Option<FoeErrorCode>,
    full_until: Option<SimTime>,
}

/// `entire` field of a BUSY message.
const BUSY_ENTIRE: u16 = 100;

impl MailFaults {
    /// Adds a fault, replacing one of the same kind.
    pub fn add(&mut self, fault: MailFault, now: SimTime) {
        match fault {
            MailFault::LoseAnswers { count } => self.lose_answers = count,
            MailFault::LoseRequests { count } => self.lose_requests = count,
            MailFault::RepeatAnswers { count } => self.repeat = count,
            MailFault::DelayAnswers { count, by } => self.delay = (count, by),
            MailFault::WrongCounter { count, counter } => self.counter = (count, counter),
            MailFault::EmergencyBefore { count, code } => self.emergency = (count, code),
            MailFault::Refuse { count, detail } => self.refuse = (count, detail),
            MailFault::AbortSdo { count, code } => self.abort = (count, Some(code)),
            MailFault::BusyFoe { count } => self.busy = (count, count),
            MailFault::FailFoe { code } => self.fail = Some(code),
            MailFault::Full { during } => self.full_until = Some(now + during),
            MailFault::Heal => *self = MailFaults::default(),
        }
    }

    /// End of the time in which no message is taken.
    pub const fn full_until(&self) -> Option<SimTime> {
        self.full_until
    }

    /// Ends faults that have expired.
    pub fn advance(&mut self, now: SimTime) {
        self.full_until = self.full_until.filter(|until| *until > now);
    }

    /// The response to a request that is not served; `None` if the request is served.
    pub fn instead_of_serving(&mut self, protocol: Protocol, payload: &[u8]) -> Option<Answer> {
        if use_up(&mut self.lose_requests) {
            return Some(Answer::Silence);
        }
        if use_up(&mut self.refuse.0) {
            return Some(Answer::Error(self.refuse.1));
        }
        match protocol {
            Protocol::Coe => self.aborted(payload),
            Protocol::Foe => self.disturbed_file(),
            Protocol::Error | Protocol::Aoe | Protocol::Eoe | Protocol::Soe | Protocol::Voe | Protocol::Other(_) => {
                None
            }
        }
    }

    fn aborted(&mut self, payload: &[u8]) -> Option<Answer> {
        let code = self.abort.1?;
        let (index, sub_index) = match SdoRequest::decode(payload).ok()? {
            SdoRequest::DownloadExpedited { index, sub_index, .. }
            | SdoRequest::DownloadNormal { index, sub_index, .. }
            | SdoRequest::Upload { index, sub_index, .. } => (index, sub_index),
            SdoRequest::DownloadSegment { .. } | SdoRequest::UploadSegment { .. } => (0, 0),
            SdoRequest::Abort { .. } => return None,
        };
        if !use_up(&mut self.abort.0) {
            return None;
        }
        let mut bytes = vec![0; 10];
        SdoResponse::Abort { index, sub_index, code }.encode(&mut bytes)?;
        Some(Answer::payload(bytes))
    }

    fn disturbed_file(&mut self) -> Option<Answer> {
        let (left, of) = self.busy;
        let message = if use_up(&mut self.busy.0) {
            let done = u64::from(BUSY_ENTIRE) * u64::from(of - left) / u64::from(of);
            let done = u16::try_from(done).unwrap_or(BUSY_ENTIRE);
            FoeMessage::Busy { done, entire: BUSY_ENTIRE, text: b"erasing" }
        } else {
            FoeMessage::Error { code: self.fail.take()?, text: b"injected failure" }
        };
        let mut bytes = vec![0; 32];
        let length = message.encode(&mut bytes)?;
        bytes.truncate(length);
        Some(Answer::payload(bytes))
    }

    /// Effect on a response; `None` if the response is lost.
    pub fn answer(&mut self) -> Option<ResponseEffect> {
        if use_up(&mut self.lose_answers) {
            return None;
        }
        let delay = if use_up(&mut self.delay.0) { self.delay.1 } else { Duration::ZERO };
        let counter = use_up(&mut self.counter.0).then_some(self.counter.1);
        let before = use_up(&mut self.emergency.0).then(|| {
            let error_code = self.emergency.1;
            emergency_payload(&Emergency { error_code, error_register: 0x01, data: [0; 5] })
        });
        Some(ResponseEffect { delay, twice: use_up(&mut self.repeat), counter, before })
    }
}

/// Decrements the counter; true if it was not zero. The maximum value never decreases.
fn use_up(count: &mut u32) -> bool {
    if *count != u32::MAX {
        *count = match count.checked_sub(1) {
            Some(left) => left,
            None => return false,
        };
    }
    true
}
