//! Mail that the application composes, and mail that arrives while another answer is awaited.

use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::mailbox::voe::VoeMessage;
use ringcat_wire::mailbox::{ErrorReply, Protocol};

use super::{Bench, LIMITS};
use crate::link::LinkSet;
use crate::mail::voe::{self, Voe};
use crate::mail::{Lane, MailboxError, Unsolicited, raw};

/// The only type that the SubDevice supports besides those of the lanes.
const OWN: u8 = 9;

impl Bench {
    fn unsolicited(&self, kind: Unsolicited) -> Vec<(Protocol, Vec<u8>)> {
        core::iter::from_fn(|| self.mailbox.pop_unsolicited(kind)).map(|mail| (mail.protocol, mail.payload)).collect()
    }

    fn exchange(&mut self, code: u8, payload: &'static [u8]) -> Result<Vec<u8>, MailboxError> {
        let mailbox = self.mailbox.clone();
        self.run(async move { raw::exchange(&mailbox, Lane::of(code), payload, LIMITS).await })
    }
}

// covers: 6.1, pdo-mail
#[test]
fn mail_of_any_type_is_exchanged_refused_and_received_unsolicited() {
    let mut bench = Bench::new(LinkSet::Single, 64);
    let own = Protocol::Other(OWN);
    assert_eq!(bench.exchange(OWN, b"question"), Ok(b"question".to_vec()));
    // The number of a type with its own lane selects that lane.
    let mailbox = bench.mailbox.clone();
    let coe = bench.run(async move { raw::exchange(&mailbox, Lane::Other(3), &[0, 0x90, 7, 7], LIMITS).await });
    assert_eq!(coe, Ok(vec![0, 0x90, 7, 7]), "an unknown service of CoE");
    for code in 6..15 {
        if code != OWN {
            let refused = bench.exchange(code, b"?");
            let reply = ErrorReply::new(ErrorReply::UNSUPPORTED_PROTOCOL);
            assert_eq!(refused, Err(MailboxError::Error(reply)), "type {code}");
        }
    }
    assert_eq!(bench.unsolicited(Unsolicited::Other), []);
    // Unsolicited mail, and an answer without a waiting request.
    bench.device.queue_mail(own, b"note", bench.now);
    bench.device.queue_mail(Protocol::Other(12), b"more", bench.now);
    let mailbox = bench.mailbox.clone();
    let sent = bench.run(async move { raw::send(&mailbox, Lane::of(OWN), b"echo", LIMITS.request).await });
    assert_eq!(sent, Ok(()));
    bench.pass(Duration::from_millis(5));
    bench.mailbox.mail_available();
    bench.pass(Duration::from_millis(5));
    let more = (Protocol::Other(12), b"more".to_vec());
    assert_eq!(bench.unsolicited(Unsolicited::Other), [(own, b"note".to_vec()), more, (own, b"echo".to_vec())]);
    // Another type is not an answer.
    bench.device.queue_mail(Protocol::Other(12), b"more", bench.now);
    assert_eq!(bench.exchange(OWN, &[0]), Err(MailboxError::NoAnswer { limit: LIMITS.answer }));
    assert_eq!(bench.unsolicited(Unsolicited::Other), [(Protocol::Other(12), b"more".to_vec())]);
    assert_eq!(bench.exchange(OWN, b"again"), Ok(b"again".to_vec()));
    assert!(bench.mailbox.is_idle());
}

// covers: pdo-mail
#[test]
fn an_error_reply_without_a_waiting_request_is_kept_as_unsolicited_mail() {
    let mut bench = Bench::new(LinkSet::Single, 64);
    let mailbox = bench.mailbox.clone();
    bench.run(async move { raw::send(&mailbox, Lane::of(7), b"?", LIMITS.request).await }).unwrap();
    bench.pass(Duration::from_millis(5));
    bench.mailbox.mail_available();
    bench.pass(Duration::from_millis(5));
    let reply = ErrorReply::new(ErrorReply::UNSUPPORTED_PROTOCOL).encode().to_vec();
    assert_eq!(bench.unsolicited(Unsolicited::Other), [(Protocol::Error, reply)]);
}

// covers: 6.8, pdo-mail
#[test]
fn vendor_messages_that_are_no_answer_are_kept_before_and_after_the_answer() {
    let message = |vendor_id, data: &[u8]| Voe { vendor_id, vendor_type: 1, data: data.to_vec() };
    let payload = |message: &Voe| {
        let mut bytes = vec![0; 58];
        let Voe { vendor_id, vendor_type, ref data } = *message;
        let length = VoeMessage { vendor_id, vendor_type, data }.encode(&mut bytes).unwrap();
        bytes.truncate(length);
        bytes
    };
    // Before the answer, and directly after it.
    for behind in [false, true] {
        for other in [message(1, b"a"), message(2, b"b")] {
            let mut bench = Bench::new(LinkSet::Single, 64);
            let request = message(1, b"question");
            if !behind && other.vendor_id == request.vendor_id {
                // This message cannot be distinguished from the answer.
                continue;
            }
            if !behind {
                bench.device.queue_mail(Protocol::Voe, &payload(&other), bench.now);
            }
            let (mailbox, sent) = (bench.mailbox.clone(), request.clone());
            let answer = bench.start(async move { voe::exchange(&mailbox, &sent, LIMITS).await });
            while bench.device.served.is_empty() {
                bench.step(|| super::Fate::Passes);
            }
            if behind {
                bench.device.queue_mail(Protocol::Voe, &payload(&other), bench.now);
            }
            for _ in 0..20 {
                bench.pass(Duration::from_millis(1));
                bench.mailbox.mail_available();
            }
            assert_eq!(answer.take(), Some(Ok(request)));
            assert_eq!(bench.unsolicited(Unsolicited::Voe), [(Protocol::Voe, payload(&other))], "behind: {behind}");
        }
    }
}
