//! Errors of services as refusals that name the kind of failure.

use ringcat_control::refusal::{Refusal, ServiceFault};
use ringcat_engine::mail::MailboxError;
use ringcat_engine::mail::coe::SdoFailure;
use ringcat_engine::mail::coe::information::InformationError;
use ringcat_engine::mail::foe::FoeFailure;
use ringcat_engine::mail::soe::SoeFailure;

use crate::error::Error;
use crate::subdevice::SubDeviceFailure;

/// The refusal of a service that has failed.
pub(super) fn refusal(error: &Error) -> Refusal {
    let text = error.to_string();
    match error {
        Error::SubDevice(error) => Refusal::Service { fault: fault(&error.failure), text },
        _ => Refusal::Failed(text),
    }
}

fn fault(failure: &SubDeviceFailure) -> ServiceFault {
    match failure {
        SubDeviceFailure::NoPosition { .. } | SubDeviceFailure::NotScanned => ServiceFault::NoSubDevice,
        SubDeviceFailure::NoMailbox => ServiceFault::NoProtocol,
        SubDeviceFailure::TimedOut { .. } => ServiceFault::NoAnswer,
        SubDeviceFailure::Sdo(error) => match &error.cause {
            SdoFailure::Aborted(code) => ServiceFault::Aborted(code.0),
            SdoFailure::TooLong(_) => ServiceFault::TooLong,
            SdoFailure::Mailbox(error) => of_mailbox(error),
            _ => ServiceFault::Other,
        },
        SubDeviceFailure::Information(InformationError::Refused(code)) => ServiceFault::Aborted(code.0),
        SubDeviceFailure::Information(InformationError::Mailbox(error)) => of_mailbox(error),
        SubDeviceFailure::Foe(error) => match &error.cause {
            FoeFailure::Refused { code, .. } => ServiceFault::Aborted(code.modern().0),
            FoeFailure::TooLong(_) => ServiceFault::TooLong,
            FoeFailure::Mailbox(error) => of_mailbox(error),
            FoeFailure::BusyForTooLong { .. } => ServiceFault::NoAnswer,
            _ => ServiceFault::Other,
        },
        SubDeviceFailure::Soe(error) => match &error.cause {
            SoeFailure::Refused(code) => ServiceFault::Aborted(code.0.into()),
            SoeFailure::TooLong(_) => ServiceFault::TooLong,
            SoeFailure::Mailbox(error) => of_mailbox(error),
            _ => ServiceFault::Other,
        },
        SubDeviceFailure::Mailbox(error) => of_mailbox(error),
        _ => ServiceFault::Other,
    }
}

fn of_mailbox(error: &MailboxError) -> ServiceFault {
    match error {
        MailboxError::TooLong { .. } => ServiceFault::TooLong,
        MailboxError::Full { .. } | MailboxError::NoAnswer { .. } => ServiceFault::NoAnswer,
        // The SubDevice does not support the protocol, or not in this form.
        MailboxError::Error(_) => ServiceFault::NoProtocol,
        _ => ServiceFault::Other,
    }
}
