//! Rare mailbox services: PDOs, raw messages of the application, procedure commands of drives.

use std::time::Duration;

use ringcat::SubDeviceId;
use ringcat_engine::mail::coe::pdo_mail::{self, PdoMailError};
use ringcat_engine::mail::coe::{self, SdoAddress};
use ringcat_engine::mail::soe::command;
use ringcat_engine::mail::{Lane, Limits, MailboxError, Unsolicited, raw};
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::mailbox::ErrorReply;
use ringcat_wire::mailbox::soe::Idn;
use scenarios::segments::{descriptions, ring};
use scenarios::world::World;

const LIMITS: Limits = Limits::new(Duration::from_millis(500), Duration::from_secs(2));
const KINDS: [&str; 3] = ["coupler", "all-protocols", "servo"];
const ALL: usize = 1;
const SERVO: usize = 2;

fn world(seed: u64) -> World {
    let options = NetworkOptions::default().with_detection_delay(Duration::from_micros(10));
    World::in_op(seed, ring(descriptions(&KINDS), options))
}

// covers: 6.3, pdo-mail
#[test]
fn pdos_are_sent_and_requested_by_mailbox() {
    let mut world = world(1);
    let mailbox = world.mailbox(SERVO);
    let directory = world.application().directory().clone();
    let inputs = directory.areas(SubDeviceId(SERVO)).iter().find(|area| area.direction == ringcat::Direction::Inputs);
    let length = usize::from(inputs.expect("it has inputs").placed.area.length);
    let own = mailbox.clone();
    let sent = world.run(async move {
        let tx = pdo_mail::receive(&own, 0x1A00, LIMITS).await;
        let rx = pdo_mail::receive(&own, 0x1600, LIMITS).await?;
        // After an SDO whose response must not be mistaken for it, and the reverse.
        let sdo = coe::read(&own, SdoAddress::new(0x1018, 1), LIMITS, 4).await;
        pdo_mail::send(&own, 0x1600, &rx, LIMITS.request).await?;
        let again = pdo_mail::receive(&own, 0x1600, LIMITS).await?;
        Ok::<_, PdoMailError>((tx?.len(), rx.len(), sdo.map(|sdo| sdo.len()), again.len()))
    });
    let (tx, rx, sdo, again) = sent.expect("the device has them");
    assert_eq!((tx, sdo, again), (length, Ok(4), rx));
    let own = mailbox.clone();
    let unknown = world.run(async move { pdo_mail::receive(&own, 0x1BFF, LIMITS).await });
    let refused = |error: &PdoMailError| match *error {
        PdoMailError::Mailbox(MailboxError::Error(reply)) => reply.detail == ErrorReply::SERVICE_NOT_SUPPORTED,
        _ => false,
    };
    assert!(unknown.as_ref().is_err_and(refused), "{unknown:?}");
    let own = mailbox.clone();
    let wrong = world.run(async move { pdo_mail::send(&own, 0x1A00, &[], LIMITS.request).await });
    assert_eq!(wrong, Err(PdoMailError::Index { pdo: 0x1A00 }));
    assert_eq!(mailbox.counters().unclaimed, 0);
}

// covers: pdo-mail
#[test]
fn raw_messages_get_the_next_response_or_none() {
    let mut world = world(2);
    let mailbox = world.mailbox(ALL);
    let own = mailbox.clone();
    // SDO request, upload of 0x1000:0.
    let answer = world.run(async move {
        raw::exchange(&own, Lane::Coe, &[0x00, 0x20, 0x40, 0x00, 0x10, 0, 0, 0, 0, 0], LIMITS).await
    });
    let answer = answer.expect("it answers");
    assert_eq!(answer[..6], [0x00, 0x30, 0x43, 0x00, 0x10, 0x00]);
    let own = mailbox.clone();
    let voe = [0x47, 0x0C, 0, 0, 1, 0, 0xAA, 0xBB];
    let sent = world.run(async move { raw::send(&own, Lane::Voe, &voe, LIMITS.request).await });
    assert_eq!(sent, Ok(()));
    let own = mailbox.clone();
    let unasked = world.run(async move { own.unsolicited(Unsolicited::Voe).await });
    assert_eq!(unasked.payload, voe);
    let own = mailbox.clone();
    let refused = world.run(async move { raw::exchange(&own, Lane::Coe, &[0x00, 0x90], LIMITS).await });
    assert!(matches!(refused, Err(MailboxError::Error(_))), "{refused:?}");
}

// covers: 6.6, pdo-mail
#[test]
fn a_procedure_command_is_started_and_aborted() {
    let mut world = world(3);
    let mailbox = world.mailbox(ALL);
    let idn = Idn::standard(0, 99);
    let own = mailbox.clone();
    world.run(async move {
        assert!(!command::state(&own, 0, idn, LIMITS).await.unwrap().is_set());
        command::start(&own, 0, idn, LIMITS).await.unwrap();
        assert!(command::state(&own, 0, idn, LIMITS).await.unwrap().is_running());
        command::abort(&own, 0, idn, LIMITS).await.unwrap();
        let state = command::state(&own, 0, idn, LIMITS).await.unwrap();
        assert!(!state.is_set() && !state.is_running() && !state.has_failed());
        // A command that is not aborted finishes, is notified and acknowledged.
        command::start(&own, 0, idn, LIMITS).await.unwrap();
        own.unsolicited(Unsolicited::Soe).await;
        assert!(command::state(&own, 0, idn, LIMITS).await.unwrap().is_done());
        command::abort(&own, 0, idn, LIMITS).await.unwrap();
        assert!(!command::state(&own, 0, idn, LIMITS).await.unwrap().is_set());
    });
    world.run_cycles(20);
    assert_eq!(mailbox.pop_unsolicited(Unsolicited::Soe), None, "the aborted command was never notified");
}
