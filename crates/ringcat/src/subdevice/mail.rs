//! The mailbox itself: messages that the application composes, mail without a request, state and counters.

use ringcat_engine::mail::voe::{self, Voe};
use ringcat_engine::mail::{Lane, MailCounters, Mailbox, MailboxError, Unclaimed, Unsolicited, raw};

use super::{SubDevice, SubDeviceError};
use crate::services::Services;
use crate::services::key::EngineKey;

/// State and counters of a mailbox.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct MailboxStatus {
    /// Whether it is in use: the SubDevice answers, in PREOP or above, or in BOOT.
    pub is_open: bool,
    /// Whether no message is under way, and no service waits for one.
    pub is_idle: bool,
    /// Counters since the beginning.
    pub counters: MailCounters,
    /// Code of the last error that the SubDevice has reported in any protocol, in the protocol's own numbers: an SDO
    /// abort, the detail of an error reply, an error of FoE, SoE or AoE; 0 for none.
    pub last_protocol_error: u32,
}

impl MailboxStatus {
    fn of(mailbox: &Mailbox) -> MailboxStatus {
        MailboxStatus {
            is_open: mailbox.is_open(),
            is_idle: mailbox.is_idle(),
            counters: mailbox.counters(),
            last_protocol_error: mailbox.last_protocol_error(),
        }
    }
}

impl<S: Services> SubDevice<S> {
    /// Sends a message that the application has composed, without its mailbox header, and waits until the SubDevice has
    /// accepted it. [`Lane::of`] has the lane of a mail type. An answer is kept as unsolicited mail.
    pub fn mail_send(self, lane: Lane, payload: Vec<u8>) -> S::Outcome<(), SubDeviceError> {
        let limit = self.limits.request;
        self.ask_mailbox(move |mailbox| async move { raw::send(&mailbox, lane, &payload, limit).await })
    }

    /// Sends a message that the application has composed, and waits for the next mail in the lane, whatever its
    /// content, except mail that is certainly unsolicited: emergencies and PDOs (CoE), notifications (SoE), requests
    /// (AoE), Ethernet frames (EoE).
    pub fn mail_exchange(self, lane: Lane, payload: Vec<u8>) -> S::Outcome<Vec<u8>, SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { raw::exchange(&mailbox, lane, &payload, limits).await })
    }

    /// State and counters of the mailbox; `None` where it has none.
    pub fn mailbox_status(self) -> S::Immediate<Option<MailboxStatus>> {
        let address = self.address;
        self.services.immediately(EngineKey, move |engine| Some(MailboxStatus::of(&engine.mailbox(address)?)))
    }

    /// Takes the oldest kept mail of a kind that no request waited for: notifications of drives and ADS, vendor
    /// messages, late answers, mail of unknown types. `None` if there is none. The SubDevice's mailbox keeps 32 of each
    /// kind.
    pub fn take_unsolicited(self, kind: Unsolicited) -> S::Immediate<Option<Unclaimed>> {
        let address = self.address;
        self.services.immediately(EngineKey, move |engine| engine.mailbox(address)?.pop_unsolicited(kind))
    }

    /// Waits for mail of a kind that no request waits for, or takes the oldest kept one. The time limit is that of an
    /// answer, see [`SubDevice::limits`].
    pub fn receive_unsolicited(self, kind: Unsolicited) -> S::Outcome<Unclaimed, SubDeviceError> {
        let limit = self.limits.answer;
        self.ask_mailbox(move |mailbox| async move {
            let mail = mailbox.bus().within(limit, mailbox.unsolicited(kind)).await;
            mail.map_err(|_| MailboxError::NoAnswer { limit })
        })
    }

    /// Number of mails of a kind that were not kept, because 32 waited; `None` where it has no mailbox.
    pub fn unsolicited_overruns(self, kind: Unsolicited) -> S::Immediate<Option<u64>> {
        let address = self.address;
        self.services.immediately(EngineKey, move |engine| Some(engine.mailbox(address)?.unsolicited_overruns(kind)))
    }

    /// Waits for a vendor message that the SubDevice sends without a request, or takes the oldest kept one. The time
    /// limit is that of an answer, see [`SubDevice::limits`].
    pub fn voe_receive(self) -> S::Outcome<Voe, SubDeviceError> {
        let limit = self.limits.answer;
        self.ask_mailbox(move |mailbox| async move { voe::receive(&mailbox, limit).await })
    }

    /// As [`SubDevice::voe_receive`], but reads the mailbox at once instead of asking for its status first: for a
    /// SubDevice whose status shows no mail.
    pub fn voe_receive_directly(self) -> S::Outcome<Voe, SubDeviceError> {
        let limit = self.limits.answer;
        self.ask_mailbox(move |mailbox| async move { voe::receive_directly(&mailbox, limit).await })
    }
}
