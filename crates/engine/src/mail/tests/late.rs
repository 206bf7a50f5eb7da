//! Late mail: fragments of the answer to an abandoned request, and error replies that may belong to another message.

use alloc::vec;
use alloc::vec::Vec;
use core::future::{Future, poll_fn};
use core::pin::pin;
use core::task::Poll;
use core::time::Duration;

use ringcat_wire::mailbox::sdo::AbortCode;
use ringcat_wire::mailbox::soe::Idn;
use ringcat_wire::mailbox::{ErrorReply, Protocol};

use super::device::pattern;
use super::{Bench, Fate, LIMITS};
use crate::link::LinkSet;
use crate::mail::coe::{SdoAddress, write};
use crate::mail::foe::FoeOptions;
use crate::mail::soe::SoeAddress;
use crate::mail::stream::Bytes;
use crate::mail::voe::Voe;
use crate::mail::{Lane, Limits, MailboxError, Unsolicited, foe, raw, soe, voe};

const MS: Duration = Duration::from_millis(1);

fn message(text: &[u8]) -> Voe {
    Voe { vendor_id: 1, vendor_type: 1, data: text.to_vec() }
}

impl Bench {
    /// Starts the exchange of a vendor message, and gives it up after a time.
    fn begin_exchange(&mut self, text: &[u8], time: Duration, limits: Limits) -> Outcome {
        let (mailbox, bus, message) = (self.mailbox.clone(), self.supervisor.bus(), message(text));
        self.start(async move { bus.within(time, voe::exchange(&mailbox, &message, limits)).await.ok() })
    }

    /// Sends a message of a vendor-specific protocol without an answer.
    fn send_unanswered(&mut self) {
        let mailbox = self.mailbox.clone();
        assert_eq!(self.run(async move { raw::send(&mailbox, Lane::of(9), &[0], LIMITS.request).await }), Ok(()));
    }

    fn refuse(&mut self, detail: u16) -> ErrorReply {
        let reply = ErrorReply::new(detail);
        self.device.queue_mail(Protocol::Error, &reply.encode(), self.now);
        reply
    }

    fn until_served(&mut self, count: usize) {
        while self.device.served.len() < count {
            self.step(|| Fate::Passes);
        }
    }
}

type Outcome = alloc::rc::Rc<core::cell::RefCell<Option<Option<Result<Voe, MailboxError>>>>>;

// covers: 6.6, mailbox
#[test]
fn late_fragments_before_the_next_request_do_not_answer_it() {
    let mut bench = Bench::new(LinkSet::Single, 64);
    let (old, new) = (pattern(1, 150), pattern(2, 150));
    let address = SoeAddress::value(1, Idn::standard(0, 7));
    bench.device.server.idns.insert((1, 7), old);
    let (mailbox, bus) = (bench.mailbox.clone(), bench.supervisor.bus());
    bench.start(async move { bus.within(MS / 5, soe::read(&mailbox, address, LIMITS, 1000)).await.is_ok() });
    bench.until_served(1);
    bench.pass(MS);
    bench.device.server.idns.insert((1, 7), new.clone());
    // One of the three fragments is read before the next request.
    bench.mailbox.mail_available();
    while bench.mailbox.counters().unclaimed == 0 {
        bench.step(|| Fate::Passes);
    }
    assert_eq!(bench.mailbox.counters().unclaimed, 1);
    let mailbox = bench.mailbox.clone();
    assert_eq!(bench.run(async move { soe::read(&mailbox, address, LIMITS, 1000).await }), Ok(new));
    assert_eq!(bench.mailbox.counters().unclaimed, 3);
}

// The SubDevice accepted the write, the frame was late, and the reader read the first fragment meanwhile.
// covers: mailbox
#[test]
fn late_fragments_before_the_confirmed_write_do_not_answer_the_next_request() {
    let mut bench = Bench::new(LinkSet::Single, 64);
    let (old, new) = (pattern(1, 150), pattern(2, 150));
    let address = SoeAddress::value(1, Idn::standard(0, 7));
    bench.device.server.idns.insert((1, 7), old);
    let (mailbox, bus) = (bench.mailbox.clone(), bench.supervisor.bus());
    let given_up =
        bench.start(async move { bus.within(2 * MS, soe::read(&mailbox, address, LIMITS, 1000)).await.is_err() });
    // Only frames with reads come back.
    let mailbox = bench.mailbox.clone();
    let fate = || if mailbox.shared().state().reading { Fate::Passes } else { Fate::LostBack };
    while bench.device.served.is_empty() {
        bench.step(fate);
    }
    bench.device.server.idns.insert((1, 7), new.clone());
    while given_up.borrow().is_none() {
        if mailbox.counters().read == 0 {
            mailbox.mail_available();
        }
        bench.step(fate);
    }
    let counters = mailbox.counters();
    assert_eq!((counters.written, counters.read), (0, 1), "the answer begins before the write is confirmed");
    assert_eq!(given_up.take(), Some(true));
    let mailbox = bench.mailbox.clone();
    assert_eq!(bench.run(async move { soe::read(&mailbox, address, LIMITS, 1000).await }), Ok(new));
    assert_eq!(bench.mailbox.counters().unclaimed, 3);
}

// covers: mailbox
#[test]
fn the_answer_to_a_request_abandoned_before_its_write_is_not_the_next_answer() {
    let limits = Limits::new(Duration::from_secs(1), 10 * MS);
    let mut bench = Bench::new(LinkSet::Single, 64);
    let given_up = bench.begin_exchange(b"before", MS, limits);
    // All frames are lost for longer than the time limit of an answer.
    let end = bench.now + 40 * MS;
    while given_up.borrow().is_none() {
        bench.step(|| Fate::LostOut);
    }
    let next = bench.begin_exchange(b"after", 10 * LIMITS.answer, limits);
    while bench.now < end {
        bench.step(|| Fate::LostOut);
    }
    bench.pass(100 * MS);
    assert_eq!(given_up.take(), Some(None));
    assert_eq!(next.take(), Some(Some(Ok(message(b"after")))));
    assert_eq!(bench.device.served, [1, 2], "both were written");
}

// covers: 6.1, mailbox
#[test]
fn after_an_ambiguous_error_reply_a_late_answer_is_expected() {
    let mut bench = Bench::new(LinkSet::Single, 64);
    bench.device.delay = 3 * MS;
    bench.send_unanswered();
    let first = bench.begin_exchange(b"first", LIMITS.answer, LIMITS);
    bench.until_served(2);
    let at = bench.now;
    let reply = ErrorReply::new(ErrorReply::NO_MORE_MEMORY);
    bench.device.queue_first(Protocol::Error, &reply.encode(), at);
    while first.borrow().is_none() {
        bench.step(|| Fate::Passes);
    }
    assert_eq!(first.take(), Some(Some(Err(MailboxError::Error(reply)))));
    let mailbox = bench.mailbox.clone();
    let second = bench.run(async move { voe::exchange(&mailbox, &message(b"second"), LIMITS).await });
    assert_eq!(second, Ok(message(b"second")));
}

// covers: 6.3, mailbox
#[test]
fn a_download_is_aborted_after_an_ambiguous_error_reply() {
    for ambiguous in [false, true] {
        let mut bench = Bench::new(LinkSet::Single, 64);
        bench.device.delay = 3 * MS;
        if ambiguous {
            bench.send_unanswered();
        }
        let before = bench.device.served.len();
        let mailbox = bench.mailbox.clone();
        let object = SdoAddress::new(0x2000, 1);
        let written = bench.start(async move { write(&mailbox, object, &pattern(1, 300), LIMITS).await });
        bench.until_served(before + 1);
        let at = bench.now;
        let reply = ErrorReply::new(ErrorReply::NO_MORE_MEMORY);
        bench.device.queue_first(Protocol::Error, &reply.encode(), at);
        bench.pass(50 * MS);
        assert!(written.take().is_some_and(|result| result.is_err()), "ambiguous: {ambiguous}");
        let aborts: &[AbortCode] = if ambiguous { &[AbortCode::GENERAL] } else { &[] };
        assert_eq!(bench.device.server.aborts, aborts, "ambiguous: {ambiguous}");
    }
}

// covers: 6.4, mailbox
#[test]
fn a_file_transfer_is_aborted_only_after_an_ambiguous_error_reply() {
    for ambiguous in [false, true] {
        let mut bench = Bench::new(LinkSet::Single, 64);
        bench.device.delay = 3 * MS;
        if ambiguous {
            bench.send_unanswered();
        }
        let before = bench.device.served.len();
        let mailbox = bench.mailbox.clone();
        let written = bench.start(async move {
            foe::write(&mailbox, "a", FoeOptions::default(), &mut Bytes::new(b"abc"), |_| ()).await
        });
        bench.until_served(before + 1);
        let at = bench.now;
        bench.device.queue_first(Protocol::Error, &ErrorReply::new(ErrorReply::NO_MORE_MEMORY).encode(), at);
        bench.pass(50 * MS);
        assert!(written.take().is_some_and(|result| result.is_err()), "ambiguous: {ambiguous}");
        assert_eq!(bench.device.server.foe_errors.len(), usize::from(ambiguous), "ambiguous: {ambiguous}");
    }
}

// covers: 6.1, mailbox
#[test]
fn the_refusal_of_ethernet_frames_does_not_end_a_request_of_a_proven_protocol() {
    let mut bench = Bench::new(LinkSet::Single, 64);
    bench.device.delay = 3 * MS;
    let mailbox = bench.mailbox.clone();
    assert_eq!(
        bench.run(async move { voe::exchange(&mailbox, &message(b"first"), LIMITS).await }),
        Ok(message(b"first"))
    );
    // The server does not support EoE; its error reply arrives before the answer.
    let mailbox = bench.mailbox.clone();
    bench.start(async move { mailbox.conversation(Lane::Frames).await?.send(&[0; 12], LIMITS.request).await });
    let second = bench.begin_exchange(b"second", LIMITS.answer, LIMITS);
    bench.pass(20 * MS);
    assert_eq!(second.take(), Some(Some(Ok(message(b"second")))));
    let kept = bench.mailbox.pop_unsolicited(Unsolicited::Other).map(|mail| mail.protocol);
    assert_eq!(kept, Some(Protocol::Error));
}

// covers: 6.1, mailbox
#[test]
fn an_error_reply_to_another_message_does_not_end_the_wait_for_a_late_answer() {
    let mut bench = Bench::new(LinkSet::Single, 64);
    bench.device.delay = 3 * MS;
    bench.send_unanswered();
    bench.begin_exchange(b"first", MS / 5, LIMITS);
    bench.until_served(2);
    bench.pass(MS / 2);
    let second = bench.begin_exchange(b"second", LIMITS.answer, LIMITS);
    let at = bench.now;
    bench.device.queue_first(Protocol::Error, &ErrorReply::new(ErrorReply::NO_MORE_MEMORY).encode(), at);
    bench.pass(100 * MS);
    assert_eq!(second.take(), Some(Some(Ok(message(b"second")))));
}

// covers: mailbox
#[test]
fn an_error_reply_at_the_end_of_its_conversation_is_kept_as_unsolicited_mail() {
    let mut bench = Bench::new(LinkSet::Single, 64);
    let (mailbox, asking) = (bench.mailbox.clone(), bench.mailbox.clone());
    // This message has no answer; the conversation has ended when the error reply is delivered.
    let ended = bench.start(async move {
        let mut exchange = pin!(raw::exchange(&asking, Lane::of(9), &[0], LIMITS));
        poll_fn(|context| {
            let has_arrived =
                mailbox.shared().state_mut().lanes.of(Lane::of(9)).is_some_and(|lane| lane.has_arrivals());
            if has_arrived { Poll::Ready(true) } else { exchange.as_mut().poll(context).map(|_| false) }
        })
        .await
    });
    bench.until_served(1);
    let reply = bench.refuse(ErrorReply::NO_MORE_MEMORY);
    bench.pass(20 * MS);
    assert_eq!(ended.take(), Some(true));
    let kept: Vec<_> =
        core::iter::from_fn(|| bench.mailbox.pop_unsolicited(Unsolicited::Other)).map(|mail| mail.payload).collect();
    assert_eq!(kept, vec![reply.encode().to_vec()]);
}
