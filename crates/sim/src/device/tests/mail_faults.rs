//! Injected faults of the mailbox.

use core::time::Duration;

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::sdo::{AbortCode, SdoRequest, SdoResponse};
use ringcat_wire::mailbox::{ErrorReply, Protocol};

use super::client::{ANSWER, Client};
use crate::application::mailbox::faults::MailFault;

const REQUEST: SdoRequest<'_> = SdoRequest::Upload { index: 0x1018, sub_index: 1, complete_access: false };

fn disturbed(fault: MailFault) -> Client {
    let mut client = Client::new("servo", AlState::PreOp);
    let now = client.bench.now;
    client.bench.device.disturb_mail(fault, now);
    client
}

/// Sends the request; returns the counter of the response if one arrives within a millisecond.
fn counter(client: &mut Client) -> Option<u8> {
    client.post_sdo(&REQUEST);
    client.bench.pass(ANSWER);
    client.bench.fetch_mail().map(|(header, _)| header.counter)
}

// covers: sim-mailbox
#[test]
fn a_request_with_a_lost_response_is_executed_and_a_lost_request_is_not() {
    for (fault, value) in [(MailFault::LoseAnswers { count: 1 }, 7), (MailFault::LoseRequests { count: 1 }, 1)] {
        let mut client = disturbed(fault);
        let data = 7u32.to_le_bytes();
        client.post_sdo(&SdoRequest::DownloadExpedited {
            index: 0x6065,
            sub_index: 0,
            complete_access: false,
            data: &data,
        });
        client.bench.pass(ANSWER);
        assert!(client.bench.fetch_mail().is_none(), "{fault:?}");
        let expected = if value == 7 { 7u32 } else { 1000 };
        assert_eq!(client.upload(0x6065, 0), Ok(expected.to_le_bytes().to_vec()), "{fault:?}");
    }
}

#[test]
fn a_device_may_stop_answering_until_the_fault_is_cleared() {
    let mut client = disturbed(MailFault::LoseAnswers { count: u32::MAX });
    for _ in 0..20 {
        assert_eq!(counter(&mut client), None);
    }
    let now = client.bench.now;
    client.bench.device.disturb_mail(MailFault::Heal, now);
    assert_eq!(counter(&mut client), Some(1));
}

// covers: sim-mailbox
#[test]
fn a_repeated_response_has_the_same_counter() {
    let mut client = disturbed(MailFault::RepeatAnswers { count: 1 });
    client.post_sdo(&REQUEST);
    let first = client.answer();
    assert_eq!(client.bench.fetch_mail(), Some(first));
    assert!(client.bench.fetch_mail().is_none());
    assert_eq!(counter(&mut client), Some(2));
}

// covers: sim-mailbox
#[test]
fn a_delayed_response_is_overtaken_by_the_next() {
    let mut client = disturbed(MailFault::DelayAnswers { count: 1, by: Duration::from_millis(50) });
    assert_eq!(counter(&mut client), None);
    assert_eq!(client.upload(0x1018, 0), Ok(vec![4]));
    client.bench.pass(Duration::from_millis(48));
    assert!(client.bench.fetch_mail().is_none());
    client.bench.pass(Duration::from_millis(3));
    let (header, payload) = client.bench.fetch_mail().unwrap();
    assert_eq!(header.counter, 2, "the counter is assigned when the response is sent");
    assert!(matches!(SdoResponse::decode(&payload), Ok(SdoResponse::UploadExpedited { sub_index: 1, .. })));
}

// covers: sim-mailbox
#[test]
fn a_wrong_counter_affects_one_response_only() {
    let mut client = disturbed(MailFault::WrongCounter { count: 1, counter: 5 });
    assert_eq!([counter(&mut client), counter(&mut client)], [Some(5), Some(1)]);
}

// covers: sim-mailbox
#[test]
fn requests_are_refused_or_aborted() {
    let mut client = disturbed(MailFault::Refuse { count: 1, detail: ErrorReply::SERVICE_IN_WORK });
    client.post_sdo(&REQUEST);
    let (header, payload) = client.answer();
    assert_eq!(header.protocol, Protocol::Error);
    assert_eq!(ErrorReply::decode(payload.first_chunk().unwrap()).detail, ErrorReply::SERVICE_IN_WORK);
    let now = client.bench.now;
    let code = AbortCode::HARDWARE_ERROR;
    client.bench.device.disturb_mail(MailFault::AbortSdo { count: 2, code }, now);
    assert_eq!([client.upload(0x1018, 1), client.upload(0x1018, 2)], [Err(code), Err(code)]);
    assert_eq!(client.upload(0x1018, 0), Ok(vec![4]));
}

// covers: 6.1, sim-mailbox
#[test]
fn a_full_mailbox_accepts_nothing_for_some_time() {
    let mut client = disturbed(MailFault::Full { during: Duration::from_millis(30) });
    client.post_sdo(&REQUEST);
    client.bench.pass(Duration::from_millis(20));
    let header = ringcat_wire::mailbox::Header::new(Protocol::Coe, 2, 0);
    assert!(!client.bench.send_mail(header, &[]), "WKC 0");
    assert!(client.bench.fetch_mail().is_none());
    client.bench.pass(Duration::from_millis(12));
    assert!(client.bench.fetch_mail().is_some());
}

// covers: 6.3, sim-mailbox
#[test]
fn an_emergency_directly_precedes_a_response() {
    let mut client = disturbed(MailFault::EmergencyBefore { count: 1, code: 0x8130 });
    client.post_sdo(&REQUEST);
    let (first, emergency) = client.answer();
    assert_eq!((first.counter, &emergency[..5]), (1, &[0x00, 0x10, 0x30, 0x81, 0x01][..]));
    let (second, answer) = client.answer();
    assert_eq!(second.counter, 2);
    assert!(matches!(SdoResponse::decode(&answer), Ok(SdoResponse::UploadExpedited { sub_index: 1, .. })));
    assert_eq!(counter(&mut client), Some(3));
}
