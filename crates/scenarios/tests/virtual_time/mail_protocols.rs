//! Every mailbox protocol with a device that supports all of them, alone and all at once, with faults.

use std::time::Duration;

use ringcat::SubDeviceId;
use ringcat_engine::mail::aoe::{self, AoeRoute};
use ringcat_engine::mail::coe::{self, SdoAddress, history, information};
use ringcat_engine::mail::foe::{self, FoeFailure, FoeOptions, FoeProgress};
use ringcat_engine::mail::soe::{self, SoeAddress};
use ringcat_engine::mail::stream::{Bounded, Bytes};
use ringcat_engine::mail::voe::{self, Voe};
use ringcat_engine::mail::{Limits, Mailbox, MailboxError, Unsolicited};
use ringcat_sim::application::aoe::MEMORY;
use ringcat_sim::application::mailbox::faults::MailFault;
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::mailbox::ErrorReply;
use ringcat_wire::mailbox::aoe::{AmsAddress, NetId};
use ringcat_wire::mailbox::coe::{Emergency, ListType, ValueInfo};
use ringcat_wire::mailbox::foe::FoeErrorCode;
use ringcat_wire::mailbox::soe::Idn;
use ringcat_wire::register::{Fmmu, map};
use scenarios::loss::Loss;
use scenarios::mailbox_requests::{Kind, Requester};
use scenarios::segments::{descriptions, ring};
use scenarios::world::World;

const LIMITS: Limits = Limits::new(Duration::from_millis(500), Duration::from_secs(2));
/// The device with all protocols.
const ALL: usize = 2;
const KINDS: [&str; 5] = ["coupler", "digital-input-8", "all-protocols", "servo", "digital-output-8"];
const LARGE: SdoAddress = SdoAddress::new(0x2002, 0);
const LARGE_BYTES: usize = 100_000;
const VENDOR: u32 = 0x0C47;

fn world(seed: u64) -> World {
    let options = NetworkOptions::default().with_detection_delay(Duration::from_micros(10));
    World::in_op(seed, ring(descriptions(&KINDS), options))
}

fn pattern(length: usize) -> Vec<u8> {
    (0..length).map(|at| (at * 7 % 253) as u8).collect()
}

fn route() -> AoeRoute {
    let address = |port| AmsAddress { net_id: NetId([5, 18, 2, 3, 2, 1]), port };
    AoeRoute::new(address(1000), address(0x8000))
}

async fn objects(mailbox: Mailbox) {
    let data = pattern(LARGE_BYTES);
    coe::write(&mailbox, LARGE, &data, LIMITS).await.unwrap();
    assert_eq!(coe::read(&mailbox, LARGE, LIMITS, LARGE_BYTES).await.unwrap(), data);
}

async fn files(mailbox: Mailbox) {
    let options = FoeOptions::default().with_limits(LIMITS);
    // A multiple of the packet size, and one more byte.
    for length in [20 * 1012, 20 * 1012 + 1] {
        let data = pattern(length);
        foe::write(&mailbox, "recipe", options, &mut Bytes::new(&data), |_| ()).await.unwrap();
        let mut sink = Bounded::new(length);
        foe::read(&mailbox, "recipe", options, &mut sink, |_| ()).await.unwrap();
        assert_eq!(sink.into_bytes(), data);
    }
}

async fn idns(mailbox: Mailbox) {
    for drive in [0, 1, 0, 1] {
        let address = SoeAddress::value(drive, Idn::product(0, 1));
        // A list begins with its length and its maximum length.
        let list = soe::read(&mailbox, address, LIMITS, 30_000).await.unwrap();
        assert!(list.len() >= 5000, "{} bytes", list.len());
        soe::write(&mailbox, address, &list, LIMITS).await.unwrap();
        assert_eq!(soe::read(&mailbox, address, LIMITS, 30_000).await.unwrap(), list);
    }
}

async fn ads(mailbox: Mailbox) {
    for round in 0..10 {
        let data = pattern(500 + round);
        aoe::write(&mailbox, route(), (MEMORY, 16), &data, LIMITS).await.unwrap();
        let read = aoe::read(&mailbox, route(), (MEMORY, 16), data.len() as u32, LIMITS).await.unwrap();
        assert_eq!(read, data);
    }
}

async fn vendor(mailbox: Mailbox) {
    for round in 0..20 {
        let message = Voe { vendor_id: VENDOR, vendor_type: round, data: pattern(usize::from(round) * 40) };
        assert_eq!(voe::exchange(&mailbox, &message, LIMITS).await.unwrap(), message);
    }
}

/// All protocols at once.
fn start_all(world: &mut World) -> Vec<ringcat_engine::main_device::Pending<()>> {
    let mailbox = world.mailbox(ALL);
    vec![
        world.start(objects(mailbox.clone())),
        world.start(files(mailbox.clone())),
        world.start(idns(mailbox.clone())),
        world.start(ads(mailbox.clone())),
        world.start(vendor(mailbox)),
    ]
}

// covers: mailbox-faults
#[test]
fn all_protocols_of_one_device_work_at_once_beside_process_data() {
    let mut world = world(1);
    let mark = world.mark();
    let works = start_all(&mut world);
    for work in works {
        world.finish(Duration::from_secs(20), work);
    }
    let counters = world.mailbox(ALL).counters();
    assert_eq!((counters.unclaimed, counters.duplicates, counters.repeats), (0, 0, 0));
    assert_eq!((world.incomplete(mark), world.left_op(mark)), (0, Vec::new()));
}

// covers: mailbox-faults
#[test]
fn all_protocols_recover_from_cuts_lost_reads_and_lost_writes() {
    let mut world = world(2);
    let station = world.station_of(ALL);
    let works = start_all(&mut world);
    for round in 0..12 {
        let cable = CableId([2, 3, 0, 5, 1, 4][round as usize % 6]);
        world.lose(Loss::of_write(station, 0x1000).times(2, 3));
        world.lose(Loss::of_read(station, 0x1400).on_the_way_back().times(2, 5));
        world.lose(Loss::of_read(station, 0x1400).times(2, 11));
        world.run_cycles(5);
        world.cut(cable);
        world.run_cycles(7);
        world.heal(cable);
        world.run_cycles(5);
    }
    for work in works {
        world.finish(Duration::from_secs(20), work);
    }
    let counters = world.mailbox(ALL).counters();
    println!("{counters:?}");
    assert!(counters.rewritten > 0 && counters.repeats > 0);
    assert_eq!(counters.unclaimed, 0);
}

// covers: 6.1, mailbox-faults
#[test]
fn duplicated_late_and_miscounted_responses_are_distinguished() {
    let mut world = world(3);
    let faults = [
        MailFault::RepeatAnswers { count: 20 },
        MailFault::DelayAnswers { count: 3, by: Duration::from_millis(30) },
        MailFault::WrongCounter { count: 5, counter: 6 },
        MailFault::Full { during: Duration::from_millis(50) },
    ];
    for fault in faults {
        world.fault(Fault::Mail(DeviceIndex(ALL), fault));
        let mailbox = world.mailbox(ALL);
        world.run(async move {
            for round in 0..10u8 {
                let object = SdoAddress::new(0x2001, round + 1);
                coe::write(&mailbox, object, &[round, 1], LIMITS).await.unwrap();
                assert_eq!(coe::read(&mailbox, object, LIMITS, 2).await.unwrap(), [round, 1]);
            }
        });
    }
    let counters = world.mailbox(ALL).counters();
    assert!(counters.duplicates >= 20, "{counters:?}");
}

// covers: mailbox-faults
#[test]
fn a_silent_device_is_given_up_in_time_and_works_again_later() {
    let mut world = world(4);
    world.fault(Fault::Mail(DeviceIndex(ALL), MailFault::LoseAnswers { count: 1 }));
    let limits = Limits::new(LIMITS.request, Duration::from_millis(50));
    let mailbox = world.mailbox(ALL);
    let result = world.run(async move { coe::read(&mailbox, LARGE, limits, LARGE_BYTES).await });
    let error = result.unwrap_err();
    assert!(error.to_string().ends_with("no answer within 50 ms"), "{error}");
    world.fault(Fault::Mail(DeviceIndex(ALL), MailFault::LoseRequests { count: 1 }));
    let mailbox = world.mailbox(ALL);
    let result = world.run(async move {
        voe::exchange(&mailbox, &Voe { vendor_id: VENDOR, vendor_type: 1, data: vec![] }, limits).await
    });
    assert_eq!(result, Err(MailboxError::NoAnswer { limit: limits.answer }));
    for work in start_all(&mut world) {
        world.finish(Duration::from_secs(20), work);
    }
}

// covers: 6.1, mailbox-faults
#[test]
fn an_error_reply_ends_the_request_that_it_belongs_to() {
    let mut world = world(5);
    let detail = ErrorReply::NO_MORE_MEMORY;
    world.fault(Fault::Mail(DeviceIndex(ALL), MailFault::Refuse { count: 1, detail }));
    let mailbox = world.mailbox(ALL);
    let result = world.run(async move { coe::read(&mailbox, LARGE, LIMITS, LARGE_BYTES).await });
    assert!(result.unwrap_err().to_string().ends_with("mailbox error 0x0007: no memory"));
    let mailbox = world.mailbox(ALL);
    world.run(objects(mailbox));
}

/// The first of two waiting requests is refused late; a third request follows the second at once.
fn refused_beside_another(world: &mut World, first_is_dropped: bool) -> [Result<(), String>; 2] {
    let by = Duration::from_millis(8);
    world.fault(Fault::Mail(DeviceIndex(ALL), MailFault::DelayAnswers { count: 3, by }));
    world.fault(Fault::Mail(DeviceIndex(ALL), MailFault::Refuse { count: 1, detail: ErrorReply::NO_MORE_MEMORY }));
    let mut idn = Requester::new(Kind::Idn, world.mailbox(ALL), LIMITS, true);
    let first = world.start(async move { idn.ask(1).await });
    world.run_cycles(2);
    let mut vendor = Requester::new(Kind::Vendor, world.mailbox(ALL), LIMITS, true);
    let second = world.start(async move { [vendor.ask(2).await, vendor.ask(3).await] });
    if first_is_dropped {
        drop(first);
        world.finish(Duration::from_secs(5), second)
    } else {
        let both = world.finish(Duration::from_secs(5), second);
        assert!(world.finish(Duration::from_secs(5), first).is_err(), "it has no response");
        both
    }
}

// The error reply is assigned to the waiting request, whose response is still under way.
// covers: 6.1, mailbox
#[test]
fn an_ambiguous_error_reply_does_not_shift_later_responses() {
    for first_is_dropped in [false, true] {
        let mut world = world(5);
        // The drive has responded before in SoE, but not yet in VoE.
        let mut idn = Requester::new(Kind::Idn, world.mailbox(ALL), LIMITS, true);
        assert_eq!(world.run(async move { idn.ask(7).await }), Ok(()));
        let [second, third] = refused_beside_another(&mut world, first_is_dropped);
        assert!(second.is_err_and(|error| error.contains("no memory")), "dropped: {first_is_dropped}");
        assert_eq!(third, Ok(()), "dropped: {first_is_dropped}");
        let mailbox = world.mailbox(ALL);
        world.run(objects(mailbox));
    }
}

// covers: 6.3
#[test]
fn the_dictionary_is_listed_and_described() {
    let mut world = world(6);
    let mailbox = world.mailbox(ALL);
    let (lengths, list) = world.run(async move {
        let lengths = information::lengths(&mailbox, LIMITS).await.unwrap();
        (lengths, information::list(&mailbox, ListType::All, LIMITS).await.unwrap())
    });
    assert_eq!(usize::from(lengths[0]), list.len());
    assert!(list.is_sorted() && list.contains(&0x2002) && list.contains(&0x1018));
    let mailbox = world.mailbox(ALL);
    world.run(async move {
        for index in list {
            let object = information::object(&mailbox, index, LIMITS).await.unwrap();
            assert_eq!(object.index, index);
            for sub_index in 0..=object.max_sub_index.min(3) {
                if let Ok(entry) = information::entry(&mailbox, (index, sub_index), ValueInfo::ALL, LIMITS).await {
                    assert_eq!((entry.index, entry.sub_index), (index, sub_index));
                }
            }
        }
        let entry = information::entry(&mailbox, (0x2003, 1), ValueInfo::ALL, LIMITS).await.unwrap();
        assert_eq!((entry.name.as_str(), entry.minimum, entry.bit_length), ("Offset", Some(vec![0x9C, 0xFF]), 16));
    });
}

// covers: 6.3, mailbox-faults
#[test]
fn emergencies_are_events_and_kept_with_the_mailbox() {
    let mut world = world(7);
    let mark = world.mark();
    let emergency = |code| Emergency { error_code: code, error_register: 1, data: [1, 2, 3, 4, 5] };
    let mailbox = world.mailbox(ALL);
    let reading = world.start(objects(mailbox.clone()));
    for code in 1..=10 {
        assert!(world.network_mut().device_mut(DeviceIndex(ALL)).application.emergency(&emergency(code)));
        world.run_cycles(10);
    }
    world.finish(Duration::from_secs(5), reading);
    let reports = world.events(mark).iter().filter_map(|timed| match timed.event {
        ringcat::Event::Emergency { subdevice: ringcat::Address::Declared(SubDeviceId(ALL)), emergency } => {
            Some(emergency.error_code)
        }
        _ => None,
    });
    let reports: Vec<u16> = reports.collect();
    assert_eq!(reports, (1..=10).collect::<Vec<_>>());
    let kept: Vec<_> = std::iter::from_fn(|| mailbox.pop_emergency()).map(|received| received.emergency).collect();
    assert_eq!(kept, (1..=10).map(emergency).collect::<Vec<_>>());
    assert_eq!(mailbox.emergencies().overruns(), 0);
}

// covers: 6.4, mailbox-faults
#[test]
fn a_refused_file_names_code_and_text_and_busy_is_waited_for() {
    let mut world = world(8);
    let mailbox = world.mailbox(ALL);
    let missing = world.run(async move {
        foe::read(&mailbox, "nothing", FoeOptions::default(), &mut Bounded::new(1), |_| ()).await.unwrap_err()
    });
    assert!(matches!(&missing.cause, FoeFailure::Refused { code: FoeErrorCode::NOT_FOUND, text } if !text.is_empty()));
    world.fault(Fault::Mail(DeviceIndex(ALL), MailFault::BusyFoe { count: 7 }));
    let mailbox = world.mailbox(ALL);
    let busy = world.run(async move {
        let mut busy = 0;
        let note = |progress| busy += u32::from(matches!(progress, FoeProgress::Busy { .. }));
        foe::write(&mailbox, "recipe", FoeOptions::default(), &mut Bytes::new(&pattern(5000)), note).await.unwrap();
        busy
    });
    assert_eq!(busy, 7);
    let written = world.network().device(DeviceIndex(ALL)).application.files().file(b"recipe").map(<[u8]>::to_vec);
    assert_eq!(written, Some(pattern(5000)));
}

// covers: 6.4, foe
#[test]
fn one_mebibyte_by_foe_takes_few_round_trips_per_packet_at_any_cycle() {
    for cycle in [Duration::from_millis(1), Duration::from_millis(10)] {
        let network = ring(descriptions(&KINDS), NetworkOptions::default());
        let declare = |scan: &ringcat::Scan| ringcat::automatic(&scan.subdevices, cycle);
        let mut world = World::with(9, network, &ringcat::Options::default(), declare).expect("activation");
        world.settle();
        let mailbox = world.mailbox(ALL);
        let (before, start) = (mailbox.counters(), world.now());
        let data = pattern(1 << 20);
        let own = mailbox.clone();
        let packets = world.run(async move {
            let options = FoeOptions::default();
            let mut packets = 0u32;
            let mut count = |_| packets += 1;
            foe::write(&own, "large", options, &mut Bytes::new(&data), &mut count).await.unwrap();
            packets
        });
        let took = (world.now() - start) / packets;
        let after = mailbox.counters();
        let trips = after.written + after.read + after.polls + after.empty_reads
            - (before.written + before.read + before.polls + before.empty_reads);
        println!(
            "cycle {} ms: {packets} packets, {:.1} round trips and {} us each",
            cycle.as_millis(),
            trips as f64 / f64::from(packets),
            took.as_micros()
        );
        assert!(took <= Duration::from_millis(3), "{took:?} per packet");
    }
}

// covers: mailbox-faults
#[test]
fn unsolicited_mail_is_kept_for_the_application() {
    let mut world = world(10);
    let post = |world: &mut World, payload: &[u8]| {
        let device = world.network_mut().device_mut(DeviceIndex(ALL));
        assert!(device.application.post(ringcat_wire::mailbox::Protocol::Voe, payload.to_vec()));
        world.run_cycles(20);
    };
    let message = [0x47, 0x0C, 0, 0, 1, 0, b'h', b'i'];
    post(&mut world, &message);
    let mailbox = world.mailbox(ALL);
    let own = mailbox.clone();
    let received = world.run(async move { voe::receive(&own, LIMITS.answer).await });
    assert_eq!(received, Ok(Voe { vendor_id: VENDOR, vendor_type: 1, data: b"hi".to_vec() }));
    for _ in 0..40 {
        post(&mut world, &message);
    }
    assert_eq!(mailbox.unsolicited_overruns(Unsolicited::Voe), 8);
}

// covers: 6.3, sdo-information
#[test]
fn the_diagnosis_history_is_read_and_acknowledged() {
    let mut world = world(11);
    let mailbox = world.mailbox(ALL);
    let empty = world.run(async move { history::read_history(&mailbox, LIMITS).await }).unwrap();
    assert_eq!((empty.maximum, empty.messages.len(), empty.new_available), (20, 0, false));
    let message = ringcat_wire::mailbox::coe::DiagnosisMessage::decode(&[
        0, 0xE8, 0x34, 0x12, 2, 0, 7, 0, 0, 0, 0, 0, 0, 0, 0, 0,
    ]);
    let message = message.unwrap();
    for _ in 0..25 {
        assert!(world.network_mut().device_mut(DeviceIndex(ALL)).application.diagnose(&message, &[]));
        world.run_cycles(2);
    }
    let mailbox = world.mailbox(ALL);
    let (full, left) = world.run(async move {
        let full = history::read_history(&mailbox, LIMITS).await.unwrap();
        history::acknowledge(&mailbox, full.newest, LIMITS).await.unwrap();
        (full, history::read_history(&mailbox, LIMITS).await.unwrap())
    });
    assert_eq!((full.messages.len(), full.new_available), (20, true));
    let times: Vec<_> = full
        .messages
        .iter()
        .map(|message| ringcat_wire::mailbox::coe::DiagnosisMessage::decode(&message.bytes).unwrap().time_ns)
        .collect();
    assert!(times.is_sorted(), "the oldest first: {times:?}");
    assert!(!left.new_available);
}

// covers: 6.1, mailbox
#[test]
fn mail_of_all_mapped_mailboxes_is_found_with_one_read() {
    let mut world = world(12);
    // The two devices with mailboxes map a bit each: 0x080D.3 through their third FMMU.
    for device in [ALL, 3] {
        let registers = world.network().device(DeviceIndex(device)).controller.register(map::fmmu(2), Fmmu::LEN);
        let fmmu = Fmmu::decode(registers[..].try_into().unwrap());
        assert_eq!((fmmu.physical_start, fmmu.physical_start_bit, fmmu.active), (0x080D, 3, true));
        assert_eq!((fmmu.logical_start.0, fmmu.logical_start_bit), (0xF000_0000, device as u8));
    }
    let before = world.application().acyclic_counters();
    world.run_cycles(900);
    let datagrams = world.application().acyclic_counters().datagrams - before.datagrams;
    // 180 reads of the bits, and the reads of the supervision once a second.
    assert!((170..200).contains(&datagrams), "{datagrams} datagrams in 900 ms");
    let emergency = Emergency { error_code: 1, error_register: 1, data: [0; 5] };
    let mark = world.mark();
    assert!(world.network_mut().device_mut(DeviceIndex(ALL)).application.emergency(&emergency));
    world.run_cycles(9);
    assert!(world.saw(mark, |event| matches!(
        event,
        ringcat::Event::Emergency { subdevice: ringcat::Address::Declared(SubDeviceId(ALL)), .. }
    )));
}
