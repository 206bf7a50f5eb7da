//! Every fault of a device's mail and of its frames, with every protocol: recoverable faults have no visible effect;
//! other faults are reported with their cause, and the next request succeeds (protocol 6.1, 6.2).

use std::time::Duration;

use ringcat::Limits;
use ringcat_sim::application::mailbox::faults::MailFault;
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::mailbox::ErrorReply;
use ringcat_wire::mailbox::foe::FoeErrorCode;
use ringcat_wire::mailbox::sdo::AbortCode;
use scenarios::loss::Loss;
use scenarios::mailbox_requests::{KINDS, Kind, Requester};
use scenarios::segments::{descriptions, ring};
use scenarios::world::World;

const LIMITS: Limits = Limits::new(Duration::from_millis(100), Duration::from_millis(60));
const PLANT: [&str; 2] = ["digital-input-8", "all-protocols"];
/// The device with all protocols, and the addresses of its mailboxes.
const ALL: usize = 1;
const RECEIVE: u16 = 0x1000;
const SEND: u16 = 0x1400;

/// The fault.
#[derive(Clone, Copy, Debug)]
enum Trouble {
    Mail(MailFault),
    /// Both copies of a frame are lost: writes or reads, on the way out or back.
    Frame {
        read: bool,
        back: bool,
    },
}

/// Result of a request meanwhile.
#[derive(Clone, Copy, Debug)]
enum Outcome {
    Answer,
    /// Text of the error.
    Error(&'static str),
}

fn troubles() -> Vec<(Trouble, Outcome)> {
    use Outcome::{Answer, Error};
    let mail = |fault, outcome| (Trouble::Mail(fault), outcome);
    let frame = |read, back| (Trouble::Frame { read, back }, Answer);
    let emergency = MailFault::EmergencyBefore { count: 2, code: 0x8130 };
    vec![
        frame(false, false),
        frame(false, true),
        frame(true, false),
        frame(true, true),
        mail(MailFault::DelayAnswers { count: 1, by: Duration::from_millis(30) }, Answer),
        mail(MailFault::RepeatAnswers { count: 3 }, Answer),
        mail(MailFault::WrongCounter { count: 1, counter: 6 }, Answer),
        mail(emergency, Answer),
        mail(MailFault::Full { during: Duration::from_millis(40) }, Answer),
        mail(MailFault::Refuse { count: 1, detail: ErrorReply::NO_MORE_MEMORY }, Error("mailbox error 0x0007")),
        mail(MailFault::LoseAnswers { count: 1 }, Error("no answer within 60 ms")),
        mail(MailFault::LoseRequests { count: 1 }, Error("no answer within 60 ms")),
        // Later than the time limit: the response to the previous request.
        mail(MailFault::DelayAnswers { count: 1, by: Duration::from_millis(90) }, Error("no answer within 60 ms")),
        mail(MailFault::LoseAnswers { count: u32::MAX }, Error("no answer within 60 ms")),
        mail(MailFault::AbortSdo { count: 1, code: AbortCode::GENERAL }, Error("aborted by the SubDevice")),
        mail(MailFault::BusyFoe { count: 3 }, Answer),
        mail(MailFault::FailFoe { code: FoeErrorCode::DISK_FULL }, Error("refused by the SubDevice")),
    ]
}

/// Whether a fault affects this kind of request.
fn concerns(trouble: Trouble, kind: Kind) -> bool {
    match trouble {
        Trouble::Mail(MailFault::AbortSdo { .. }) => matches!(kind, Kind::Object | Kind::LargeObject),
        Trouble::Mail(MailFault::BusyFoe { .. } | MailFault::FailFoe { .. }) => kind == Kind::File,
        Trouble::Mail(_) | Trouble::Frame { .. } => true,
    }
}

/// A request; returns the requester again.
fn question(world: &mut World, mut requester: Requester, number: u32) -> (Result<(), String>, Requester) {
    world.run(async move { (requester.ask(number).await, requester) })
}

// covers: 6.1, mailbox-faults
#[test]
fn every_protocol_recovers_from_every_fault_of_mail_and_frames() {
    let mut seen = 0;
    for kind in KINDS {
        let options = NetworkOptions::default().with_detection_delay(Duration::from_micros(10));
        let mut world = World::in_op(1, ring(descriptions(&PLANT), options));
        let (mailbox, station) = (world.mailbox(ALL), world.station_of(ALL));
        let mut requester = Requester::new(kind, mailbox.clone(), LIMITS, false);
        let mut number = 1;
        let mut result;
        (result, requester) = question(&mut world, requester, number);
        assert_eq!(result, Ok(()), "{kind:?}");
        for (trouble, outcome) in troubles().into_iter().filter(|(trouble, _)| concerns(*trouble, kind)) {
            world.say(format!("{kind:?}: {trouble:?}"));
            let before = mailbox.counters();
            match trouble {
                Trouble::Mail(fault) => world.fault(Fault::Mail(DeviceIndex(ALL), fault)),
                Trouble::Frame { read, back } => {
                    let loss = if read { Loss::of_read(station, SEND) } else { Loss::of_write(station, RECEIVE) };
                    world.lose(if back { loss.on_the_way_back() } else { loss }.times(2, 0));
                }
            }
            number += 1;
            (result, requester) = question(&mut world, requester, number);
            let reports = result.err().unwrap_or_default();
            match (outcome, trouble) {
                (Outcome::Answer, _) => assert_eq!(reports, "", "{kind:?}, {trouble:?}"),
                // The first fragment is discarded, the second one is an invalid request.
                (Outcome::Error(_), Trouble::Mail(MailFault::LoseRequests { .. })) if kind == Kind::IdnList => {
                    assert!(reports.contains("refused by the drive"), "{reports}");
                }
                (Outcome::Error(words), _) => assert!(reports.contains(words), "{kind:?}, {trouble:?}: {reports}"),
            }
            // A second copy of the last response is found by the poll for unsolicited mail.
            world.run_cycles(10);
            let after = mailbox.counters();
            match trouble {
                Trouble::Frame { read: false, .. } => assert_eq!(after.rewritten, before.rewritten + 1, "{kind:?}"),
                Trouble::Frame { read: true, .. } => assert_eq!(after.repeats, before.repeats + 1, "{kind:?}"),
                Trouble::Mail(MailFault::RepeatAnswers { .. }) => assert!(after.duplicates > before.duplicates),
                Trouble::Mail(MailFault::EmergencyBefore { .. }) => {
                    let kept = std::iter::from_fn(|| mailbox.pop_emergency());
                    assert!(kept.filter(|received| received.emergency.error_code == 0x8130).count() > 0, "{kind:?}");
                }
                Trouble::Mail(_) => {}
            }
            world.fault(Fault::Mail(DeviceIndex(ALL), MailFault::Heal));
            number += 1;
            (result, requester) = question(&mut world, requester, number);
            assert_eq!(result, Ok(()), "{kind:?}, after {trouble:?}");
            seen += 1;
        }
        world.run_cycles(150);
        assert!(mailbox.is_idle(), "{kind:?}");
    }
    assert_eq!(seen, 9 * 14 + 2 + 2, "each fault with each protocol");
}
