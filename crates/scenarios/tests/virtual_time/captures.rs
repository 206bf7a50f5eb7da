//! Captures of a MainDevice, recorded by a tee in virtual time and checked from the file alone; modified captures show
//! that the checks detect faults.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::tee::Tee;
use ringcat::{Application, LastOutputs, MainDevice, Options, SubDeviceId, automatic};
use ringcat_link::Recorder;
use ringcat_sim::cable::{CableId, DeviceIndex, Direction};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::al::AlState;
use ringcat_wire::register::map;
use scenarios::capture::ethercat::Frame;
use scenarios::capture::pcapng::{Capture, Packet};
use scenarios::capture::{Verdict, evaluate, evaluate_frames};
use scenarios::dice::Dice;
use scenarios::segments::{descriptions, line, ring_of_16};

const CYCLE: Duration = Duration::from_millis(1);
const LIMIT: Duration = Duration::from_secs(5);
const LRD: u8 = 10;
const LWR: u8 = 11;

type Recorded = Application<Tee<SimulatedSegment>>;

/// Records scan, OP, `work` and stop; returns the file.
fn recorded(network: Network, ring: bool, work: impl FnOnce(&mut Recorded)) -> Vec<u8> {
    recorded_as(network, ring, false, work)
}

/// As [`recorded`], with lost frames sent again or not.
fn recorded_as(network: Network, ring: bool, again: bool, work: impl FnOnce(&mut Recorded)) -> Vec<u8> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let number = COUNT.fetch_add(1, Ordering::Relaxed);
    let path: PathBuf = std::env::temp_dir().join(format!("ringcat-capture-{}-{number}.pcapng", std::process::id()));
    let names = [("sim-main", "main link"), ("sim-redundant", "redundant link")];
    let recorder = Recorder::start(&path, &names[..1 + usize::from(ring)]).expect("a file");
    let links = Tee::new(SimulatedSegment::new(network), recorder.tap());
    let mut main_device = MainDevice::request(links, &Options::default());
    let scan = main_device.scan().expect("a segment");
    let declaration = automatic(&scan.subdevices, CYCLE).with_sends_again(again);
    let mut application = main_device.activate(declaration).expect("it fits");
    settle(&mut application);
    work(&mut application);
    application.stop(LastOutputs::Zero, AlState::Init, LIMIT).expect("all go to INIT");
    let recorded = recorder.finish().expect("it was written");
    assert!(recorded.iter().all(|interface| interface.lost == 0), "{recorded:?}");
    let bytes = std::fs::read(&path).expect("it was written");
    std::fs::remove_file(&path).expect("it was read");
    bytes
}

fn settle(application: &mut Recorded) {
    let until = application.now() + LIMIT;
    while !application.all_settled() {
        assert!(application.now() < until, "not in OP: {:?}", application.states());
        application.cycle(|_| ());
    }
}

fn cycles(application: &mut Recorded, count: usize) {
    for _ in 0..count {
        application.cycle(|_| ());
        while application.pop_event().is_some() {}
    }
}

fn fault(application: &mut Recorded, fault: &Fault) {
    application.links_mut().links_mut().network_mut().apply(fault.clone());
}

/// One SubDevice, undisturbed.
fn short() -> Vec<u8> {
    recorded(line(descriptions(&["digital-output-8"]), NetworkOptions::default()), false, |run| cycles(run, 50))
}

/// A ring of 16 with a cut, a repair and a power cycle.
fn eventful() -> Vec<u8> {
    recorded(ring_of_16(Duration::from_millis(2)), true, |run| {
        cycles(run, 100);
        for what in [Fault::Cut(CableId(7)), Fault::Heal(CableId(7)), Fault::PowerOff(DeviceIndex(4))] {
            fault(run, &what);
            cycles(run, 100);
        }
        fault(run, &Fault::PowerOn(DeviceIndex(4)));
        cycles(run, 200);
        settle(run);
        cycles(run, 100);
    })
}

/// A ring of 16 that loses frames on a cable while registers are read; also the number of frames sent again.
fn lossy() -> (Vec<u8>, u64) {
    let mut sent_again = 0;
    let bytes = recorded_as(ring_of_16(Duration::from_micros(10)), true, true, |run| {
        cycles(run, 200);
        for round in 0..40 {
            let direction = Some(Direction::AToB);
            fault(run, &Fault::Drop { cable: CableId(round % 16 + 1), direction, count: 1 });
            let _ended = run.engine_mut().start_register_read(SubDeviceId(round % 16), map::USER_RAM, 64);
            cycles(run, 5);
        }
        sent_again = run.cyclic_counters().sent_again;
    });
    (bytes, sent_again)
}

// covers: capture, lost-frames
#[test]
fn a_capture_of_frames_that_are_sent_again_has_no_findings() {
    let (bytes, sent_again) = lossy();
    let verdict = evaluate(&bytes, None).expect("a capture");
    println!("{verdict}");
    assert_eq!(verdict.broken, 0, "{verdict}");
    assert!(verdict.again == sent_again && sent_again > 20, "{sent_again}: {verdict}");
    for windows in &verdict.windows {
        assert_eq!((windows.period, windows.crossed, windows.held_up), (CYCLE, 0, 0), "{verdict}");
        assert_eq!((windows.late, windows.tries_held_up), (0, 0), "a further try begins no cycle: {verdict}");
    }
    // The same with outputs of another cycle in a further try.
    let mut capture = read(&bytes);
    let mut is_again = false;
    for packet in capture.packets.iter_mut().filter(|packet| packet.sent) {
        let frame = Frame::parse(&packet.bytes).expect("it was sent");
        let logical = frame.datagrams.iter().all(|datagram| datagram.command >= LRD);
        let written = frame.datagrams.iter().find(|datagram| datagram.command == LWR).map(|datagram| datagram.at);
        if let Some(at) = written.filter(|_| logical && !frame.is_acyclic()) {
            packet.bytes[at + 10] ^= 0x40;
            is_again = true;
            break;
        }
    }
    let verdict = evaluate_frames(&capture, None).expect("a capture");
    assert!(is_again && verdict.findings.iter().any(|it| it.contains("sent again with other outputs")), "{verdict}");
}

fn read(bytes: &[u8]) -> Capture {
    Capture::parse(bytes).expect("a capture")
}

// covers: capture
#[test]
fn a_capture_on_one_link_has_no_findings() {
    let verdict = evaluate(&short(), Some(CYCLE)).expect("a capture");
    assert_eq!(verdict.broken, 0, "{verdict}");
    assert!(verdict.reads > 50 && verdict.missing == 0 && verdict.pairs == 0, "{verdict}");
    assert_eq!(verdict.returned, verdict.sent[0]);
}

// covers: CR-01, CR-04, CR-24, CR-25, SM-01, SM-02, capture
#[test]
fn a_capture_of_a_ring_that_breaks_and_closes_has_no_findings() {
    let verdict = evaluate(&eventful(), None).expect("a capture");
    println!("{verdict}");
    assert_eq!(verdict.broken, 0, "{verdict}");
    assert_eq!(verdict.pairs, verdict.sent[0]);
    assert_eq!(verdict.returned + verdict.missing, verdict.sent[0] + verdict.sent[1]);
    assert!((1..100).contains(&verdict.missing), "{verdict}");
    for windows in &verdict.windows {
        assert_eq!((windows.period, windows.late), (CYCLE, 0), "{verdict}");
        // In virtual time there are no stalls: no acyclic frame delays a cycle.
        assert_eq!((windows.crossed, windows.crossed_in_stalls, windows.held_up), (0, 0, 0), "{verdict}");
        assert!(windows.by_chance > 0, "acyclic frames would have met cycles: {verdict}");
    }
    assert_eq!(verdict.windows.len(), 2);
}

// covers: capture
#[test]
fn the_return_of_a_whole_segment_delays_no_cycle() {
    let kinds: Vec<&str> = ["digital-output-8", "digital-input-8", "servo"].into_iter().cycle().take(40).collect();
    let file = recorded(line(descriptions(&kinds), NetworkOptions::default()), false, |run| {
        for device in (0..kinds.len()).map(DeviceIndex) {
            fault(run, &Fault::PowerOff(device));
        }
        cycles(run, 50);
        for device in (0..kinds.len()).map(DeviceIndex) {
            fault(run, &Fault::PowerOn(device));
        }
        cycles(run, 100);
        settle(run);
        cycles(run, 50);
    });
    let verdict = evaluate(&file, Some(CYCLE)).expect("a capture");
    println!("{verdict}");
    assert_eq!(verdict.broken, 0, "{verdict}");
    let windows = &verdict.windows[0];
    assert_eq!((windows.late, windows.crossed, windows.held_up), (0, 0, 0), "{verdict}");
    assert!(windows.by_chance > 10, "too few acyclic frames to show anything: {verdict}");
}

// covers: capture
#[test]
fn a_tee_changes_nothing_and_records_each_link_and_direction() {
    let capture = read(&eventful());
    let names: Vec<&str> = capture.interfaces.iter().map(|interface| interface.name.as_str()).collect();
    assert_eq!(names, ["sim-main", "sim-redundant"]);
    assert!(capture.interfaces.iter().all(|interface| interface.dropped == Some(0)));
    let count = |link, sent| capture.packets.iter().filter(|p| p.interface == link && p.sent == sent).count();
    assert_eq!(count(0, true), count(1, true));
    assert!(count(0, false) > 0 && count(1, false) > 0);
    assert!(capture.packets.is_sorted_by_key(|packet| packet.time_ns));
}

/// The verdict after a change of the frames.
fn tampered(capture: &Capture, tamper: impl FnOnce(&mut Vec<Packet>)) -> Verdict {
    let mut capture = capture.clone();
    tamper(&mut capture.packets);
    evaluate_frames(&capture, Some(CYCLE)).expect("one or two interfaces")
}

/// The first sent frame of process data in the second half with such a datagram, and the offset of the datagram. (On
/// two links process data is an LWR and an LRD; mailbox polls have an LRD alone.)
fn sent_with(packets: &[Packet], command: u8) -> (usize, usize) {
    let at = |packet: &Packet| {
        let frame = Frame::parse(&packet.bytes).expect("a good frame");
        let has = |wanted| frame.datagrams.iter().any(|datagram| datagram.command == wanted);
        if !has(LWR) || !has(LRD) {
            return None;
        }
        frame.datagrams.iter().find(|datagram| datagram.command == command).map(|datagram| datagram.at)
    };
    let frames = packets.iter().enumerate().skip(packets.len() / 2).filter(|(_, packet)| packet.sent);
    frames.filter_map(|(place, packet)| Some((place, at(packet)?))).next().expect("such a frame was sent")
}

fn assert_found(verdict: &Verdict, text: &str) {
    assert!(verdict.findings.iter().any(|finding| finding.contains(text)), "{text}: {verdict}");
}

// covers: capture
#[test]
fn the_check_finds_each_wrong_bit() {
    let capture = read(&eventful());
    let in_datagram = [
        (1, 0x01, "has Idx"),
        (7, 0x40, "is sent with C = 1"),
        (8, 0x04, "working counter or event request"),
        (10, 0x01, "a read, is sent with data"),
        (7, 0x08, "reserved bits"),
        (7, 0x80, "M = "),
    ];
    let in_frame =
        [(6, 0x08, "the RED bit is not that of its link"), (15, 0x80, "EtherCAT header"), (12, 0x01, "EtherType")];
    for (offset, bit, text) in in_datagram {
        let verdict = tampered(&capture, |packets| {
            let (place, at) = sent_with(packets, LRD);
            packets[place].bytes[at + offset] ^= bit;
        });
        assert_found(&verdict, text);
    }
    for (at, bit, text) in in_frame {
        let verdict = tampered(&capture, |packets| {
            let (place, _) = sent_with(packets, LRD);
            packets[place].bytes[at] ^= bit;
        });
        assert_found(&verdict, text);
    }
}

// covers: capture
#[test]
fn the_check_finds_missing_duplicated_and_late_copies() {
    let capture = read(&eventful());
    let pair = tampered(&capture, |packets| {
        let (place, _) = sent_with(packets, LRD);
        packets.remove(place);
    });
    assert_found(&pair, "left on 1 of 2 links");
    let unlike = tampered(&capture, |packets| {
        // In output data, which may have any value.
        let (place, at) = sent_with(packets, LWR);
        packets[place].bytes[at + 10] ^= 0x01;
    });
    assert_found(&unlike, "differs from its copy");
    let twice = tampered(&capture, |packets| {
        let place = packets.iter().rposition(|packet| !packet.sent).expect("something came back");
        packets.push(packets[place].clone());
    });
    assert_found(&twice, "is back for the second time");
    let altered = tampered(&capture, |packets| {
        let last = packets.iter_mut().rfind(|packet| !packet.sent).expect("something came back");
        last.bytes[17] ^= 0x40;
    });
    assert_found(&altered, "was never sent from here");
    let jump = tampered(&capture, |packets| {
        let (place, _) = sent_with(packets, LRD);
        packets[place].bytes[7] = packets[place].bytes[7].wrapping_add(3);
    });
    assert_found(&jump, "has number");
    let late = tampered(&capture, |packets| {
        let end = packets.last().expect("frames").time_ns;
        let place = packets.iter().position(|p| !p.sent && p.bytes[17] & 0x80 == 0).expect("a cycle came back");
        packets[place].time_ns = end + 1;
    });
    assert_found(&late, "comes back after its id was used again");
}

// covers: capture
#[test]
fn the_check_separates_delayed_cycles_from_stalls() {
    let capture = read(&eventful());
    let acyclic = |p: &Packet| p.sent && p.interface == 0 && p.bytes[17] & 0x80 != 0;
    let cyclic = |p: &Packet| p.sent && p.interface == 0 && p.bytes[17] & 0x80 == 0;
    let first = capture.packets.iter().position(cyclic).expect("cycles");
    let middle = first + (capture.packets.len() - first) / 2;
    let frame = middle + capture.packets[middle..].iter().position(acyclic).expect("acyclic frames");
    let start = frame + capture.packets[frame..].iter().position(cyclic).expect("a cycle after it");
    let start_ns = capture.packets[start].time_ns;
    let before = |ns: u64| tampered(&capture, |packets| packets[frame].time_ns = start_ns - ns);
    // A short frame takes 6.72 us.
    let through = before(200_000);
    assert_eq!((through.windows[0].crossed, through.windows[0].held_up), (0, 0), "{through}");
    let crossing = before(2_000);
    assert_eq!((crossing.windows[0].crossed, crossing.windows[0].held_up), (1, 1), "{crossing}");
    assert!(crossing.windows[0].longest_hold_up >= Duration::from_nanos(4_720), "{crossing}");
    let stall = tampered(&capture, |packets| {
        packets[frame].time_ns = start_ns + 299_000;
        for packet in packets.iter_mut().filter(|packet| packet.time_ns == start_ns) {
            packet.time_ns += 300_000;
        }
    });
    let windows = &stall.windows[0];
    assert_eq!((windows.crossed, windows.late, windows.held_up), (0, 1, 1), "{stall}");
    // Frames that were sent after the original cycle are now before it too.
    assert!((1..5).contains(&windows.crossed_in_stalls), "{stall}");
}

// covers: capture
#[test]
fn damaged_capture_files_never_cause_a_panic() {
    let file = short();
    let mut dice = Dice::new(7);
    for _ in 0..2_000 {
        let mut bytes = file.clone();
        for _ in 0..=dice.below(4) {
            let at = dice.below(bytes.len() as u64) as usize;
            bytes[at] = dice.below(256) as u8;
        }
        bytes.truncate(bytes.len() - if dice.below(2) == 0 { dice.below(100) as usize } else { 0 });
        // With any result, it ends.
        let _ = evaluate(&bytes, None);
    }
    let frame = [0xFF; 70];
    assert!((0..70).all(|length| Frame::parse(&frame[..length]).is_err()));
}
