//! A SubDevice that does not answer for a time, and answers again with its mailbox unchanged or reset.

use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::mailbox::Protocol;
use ringcat_wire::mailbox::coe::Emergency;
use ringcat_wire::mailbox::soe::Idn;

use super::device::{STATION, pattern};
use super::{Bench, Fate, LIMITS};
use crate::link::LinkSet;
use crate::mail::coe::{SdoAddress, read};
use crate::mail::soe::{self, SoeAddress};
use crate::mail::voe::{self, Voe};
use crate::mail::{MailboxError, soe::SoeFailure};

fn emergency(code: u16) -> Vec<u8> {
    let mut mail = vec![0x00, 0x10];
    mail.extend(Emergency { error_code: code, error_register: 0, data: [0; 5] }.encode());
    mail
}

impl Bench {
    /// The SubDevice does not answer for 200 ms; the MainDevice detects this after `noticed`.
    fn stops_answering(&mut self, noticed: Duration) {
        let (until, end) = (self.now + noticed, self.now + Duration::from_millis(200));
        while self.now < until {
            self.step(|| Fate::LostOut);
        }
        self.mailbox.suspend();
        while self.now < end {
            self.step(|| Fate::LostOut);
        }
        self.mailbox.resume();
    }

    fn codes(&self) -> Vec<u16> {
        core::iter::from_fn(|| self.mailbox.pop_emergency()).map(|received| received.emergency.error_code).collect()
    }
}

// covers: 6.2, mailbox
#[test]
fn a_mail_lost_at_an_outage_is_read_when_the_subdevice_answers_again() {
    for noticed in (0..4000).step_by(50) {
        let mut bench = Bench::new(LinkSet::Single, 64);
        for code in 1..=3 {
            bench.device.queue_mail(Protocol::Coe, &emergency(code), bench.now);
        }
        bench.mailbox.mail_available();
        // The first read reaches the SubDevice; its answer and all later frames are lost.
        bench.step(|| Fate::LostBack);
        bench.stops_answering(Duration::from_micros(noticed));
        bench.mailbox.mail_available();
        bench.pass(Duration::from_millis(50));
        assert_eq!(bench.codes(), [1, 2, 3], "noticed after {noticed} us: {:?}", bench.mailbox.counters());
    }
}

// covers: 6.1, mailbox
#[test]
fn an_answer_from_before_an_outage_does_not_answer_another_request() {
    let message = |text: &[u8]| Voe { vendor_id: 1, vendor_type: 1, data: text.to_vec() };
    let address = |idn| SoeAddress::value(1, Idn::standard(0, idn));
    let object = SdoAddress::new(0x2000, 1);
    for noticed in [0, 100, 300, 700] {
        let mut bench = Bench::new(LinkSet::Single, 128);
        let (old, new) = (pattern(1, 20), pattern(2, 20));
        bench.device.server.idns.insert((1, 7), old.clone());
        bench.device.server.objects.insert((0x2000, 1), old);
        // One request per protocol; all reach the SubDevice, and no answer is read.
        bench.device.delay = Duration::from_millis(2);
        let [a, b, c] = core::array::from_fn(|_| bench.mailbox.clone());
        let lost = (
            bench.start(async move { voe::exchange(&a, &message(b"before"), LIMITS).await }),
            bench.start(async move { soe::read(&b, address(7), LIMITS, 100).await }),
            bench.start(async move { read(&c, object, LIMITS, 100).await }),
        );
        while bench.device.served.len() < 3 {
            bench.step(|| Fate::Passes);
        }
        bench.stops_answering(Duration::from_micros(noticed));
        assert_eq!(lost.0.take(), Some(Err(MailboxError::Closed)), "noticed after {noticed} us");
        assert!(matches!(lost.1.take(), Some(Err(error)) if error.cause == SoeFailure::Mailbox(MailboxError::Closed)));
        assert!(lost.2.take().is_some_and(|result| result.is_err()));
        // The values have changed.
        bench.device.server.idns.insert((1, 7), new.clone());
        bench.device.server.objects.insert((0x2000, 1), new.clone());
        let [a, b, c] = core::array::from_fn(|_| bench.mailbox.clone());
        let after = (
            bench.start(async move { voe::exchange(&a, &message(b"after"), LIMITS).await }),
            bench.start(async move { soe::read(&b, address(7), LIMITS, 100).await }),
        );
        assert_eq!(bench.run(async move { read(&c, object, LIMITS, 100).await }), Ok(new.clone()));
        bench.pass(Duration::from_secs(2));
        assert_eq!(after.0.take(), Some(Ok(message(b"after"))), "noticed after {noticed} us");
        assert_eq!(after.1.take(), Some(Ok(new)), "noticed after {noticed} us");
    }
}

// covers: mailbox
#[test]
fn mail_that_was_read_before_a_restart_is_dropped_after_it() {
    let mut bench = Bench::new(LinkSet::Single, 64);
    bench.device.queue_mail(Protocol::Coe, &emergency(1), bench.now);
    bench.mailbox.mail_available();
    bench.step(|| Fate::Late(Duration::from_millis(60)));
    // Shorter than the time limit of the frame, after which the mail is read again.
    bench.pass(Duration::from_millis(4));
    // The SubDevice lost its power and is in PREOP again; the first mail of the new session is another mail.
    bench.mailbox.suspend();
    let layout = bench.device.layout;
    bench.mailbox.open(StationAddress(STATION), layout, 1);
    bench.device.queue_mail(Protocol::Coe, &emergency(2), bench.now);
    for _ in 0..10 {
        bench.mailbox.mail_available();
        bench.pass(Duration::from_millis(10));
    }
    assert_eq!(bench.codes(), [2], "{:?}", bench.mailbox.counters());
}
