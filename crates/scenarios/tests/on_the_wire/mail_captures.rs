//! Mail in captures, checked from the file alone by `ci/check-mail` with the output of tshark: counters, requests that
//! a SubDevice could execute twice, and the same start-up list at each of a hundred power cycles. The captures are
//! recorded in virtual time; modified captures, and one of a SubDevice that sends its mail twice, show that the script
//! detects faults.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::tee::Tee;
use ringcat::{Application, MainDevice, Options, automatic};
use ringcat_link::Recorder;
use ringcat_link::pcapng::{Direction, Writer};
use ringcat_sim::application::mailbox::faults::MailFault;
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::NetworkOptions;
use scenarios::capture::pcapng::Capture;
use scenarios::segments::{descriptions, ring};

const POWER_CYCLES: usize = 100;
const OBJECTS: u16 = 9;
const DRIVE: DeviceIndex = DeviceIndex(1);
const LIMIT: Duration = Duration::from_secs(5);
const FPRD: u8 = 4;
const FPWR: u8 = 5;
const RECEIVE: u16 = 0x1000;
const SEND: u16 = 0x1080;
/// Offset of the counter in a mailbox, and of its bits there.
const COUNTER_AT: usize = 5;
const COUNTER_ONE: u8 = 0x10;

type Recorded = Application<Tee<SimulatedSegment>>;

fn has_tshark() -> bool {
    let found = Command::new("tshark").arg("--version").output().is_ok_and(|output| output.status.success());
    if !found || std::env::var_os("RINGCAT_ON_THE_WIRE").is_none() {
        println!("skipped: needs RINGCAT_ON_THE_WIRE=1 and tshark (apt-get install tshark)");
        return false;
    }
    true
}

fn file(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("ringcat-mail-{}-{name}.pcapng", std::process::id()))
}

/// Exit status and output of the script.
fn check(path: &Path, lists: usize) -> (bool, String) {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../ci/check-mail");
    let output = Command::new(script).arg(path).args(["--lists", &lists.to_string()]).output().expect("python3");
    let text = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    (output.status.success(), text)
}

fn settle(application: &mut Recorded) {
    let until = application.now() + LIMIT;
    while !application.all_settled() {
        assert!(application.now() < until, "not in OP: {:?}", application.states());
        application.cycle(|_| ());
        while application.pop_event().is_some() {}
    }
}

fn cycles(application: &mut Recorded, count: usize) {
    for _ in 0..count {
        application.cycle(|_| ());
        while application.pop_event().is_some() {}
    }
}

/// A ring with a drive that receives a start-up list, also after `power_cycles` power cycles; some responses are wrong,
/// and a cable is cut and repaired meanwhile.
fn recorded(path: &Path, power_cycles: usize, more: Option<MailFault>) {
    let names = [("sim-main", "main link"), ("sim-redundant", "redundant link")];
    let recorder = Recorder::start(path, &names).expect("a file");
    let kinds = ["digital-input-8", "servo", "digital-output-8"];
    let network = ring(descriptions(&kinds), NetworkOptions::default());
    let links = Tee::new(SimulatedSegment::new(network), recorder.tap());
    let mut main_device = MainDevice::request(links, &Options::default());
    let scan = main_device.scan().expect("a segment");
    let mut declaration = automatic(&scan.subdevices, Duration::from_millis(4));
    for number in 0..OBJECTS {
        let config = declaration.subdevices[DRIVE.0].clone();
        declaration.subdevices[DRIVE.0] = config.sdo(0x6065, 0, u32::from(number).to_le_bytes());
    }
    let mut application = main_device.activate(declaration).expect("it fits");
    settle(&mut application);
    if let Some(more) = more {
        application.links_mut().links_mut().network_mut().apply(Fault::Mail(DRIVE, more));
    }
    for round in 0..power_cycles {
        let mut fault = |fault| application.links_mut().links_mut().network_mut().apply(fault);
        fault(Fault::PowerOff(DRIVE));
        match round % 5 {
            1 => fault(Fault::Cut(CableId(3))),
            2 => fault(Fault::Mail(DRIVE, MailFault::EmergencyBefore { count: 2, code: 0x8130 })),
            3 => fault(Fault::Mail(DRIVE, MailFault::DelayAnswers { count: 1, by: Duration::from_millis(3) })),
            _ => {}
        }
        cycles(&mut application, 30);
        let mut fault = |fault| application.links_mut().links_mut().network_mut().apply(fault);
        fault(Fault::PowerOn(DRIVE));
        cycles(&mut application, 12 + round % 7);
        let mut fault = |fault| application.links_mut().links_mut().network_mut().apply(fault);
        match round % 5 {
            1 => fault(Fault::Heal(CableId(3))),
            4 => fault(Fault::Drop { cable: CableId(1), direction: None, count: 3 }),
            _ => {}
        }
        settle(&mut application);
    }
    let recorded = recorder.finish().expect("it was written");
    assert!(recorded.iter().all(|interface| interface.lost == 0), "{recorded:?}");
}

/// Datagrams in a capture with a command to an address: packet, offset of the data.
fn places(capture: &Capture, sent: bool, command: u8, ado: u16) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    for (number, packet) in capture.packets.iter().enumerate().filter(|(_, packet)| packet.sent == sent) {
        let bytes = &packet.bytes;
        let mut at = 16;
        loop {
            let flags = u16::from_le_bytes([bytes[at + 6], bytes[at + 7]]);
            let length = usize::from(flags & 0x07FF);
            if bytes[at] == command && bytes[at + 4..at + 6] == ado.to_le_bytes() && bytes[at + 10] != 0 {
                found.push((number, at + 10));
            }
            at += 12 + length;
            if flags & 0x8000 == 0 {
                break;
            }
        }
    }
    found
}

fn write(capture: &Capture, path: &Path) {
    let names = [("sim-main", "main link"), ("sim-redundant", "redundant link")];
    let mut writer = Writer::new(Vec::new(), &names).expect("memory");
    for packet in &capture.packets {
        let direction = if packet.sent { Direction::Out } else { Direction::In };
        writer.frame(packet.interface, direction, packet.time_ns, &packet.bytes).expect("memory");
    }
    std::fs::write(path, writer.into_inner()).expect("a file");
}

/// Written mails, each with all its copies, sent and returned: packet and offset of the mailbox.
fn written(capture: &Capture) -> Vec<Vec<(usize, usize)>> {
    let mut mails: Vec<Vec<(usize, usize)>> = Vec::new();
    let id = |(packet, at): (usize, usize)| (capture.packets[packet].bytes[7], capture.packets[packet].bytes[at - 9]);
    for place in places(capture, true, FPWR, RECEIVE) {
        match mails.last_mut() {
            Some(mail) if id(mail[0]) == id(place) => mail.push(place),
            _ => mails.push(vec![place]),
        }
    }
    for place in places(capture, false, FPWR, RECEIVE) {
        // Ids are reused after 256 frames: take the last frame sent before with this id.
        let of = mails.iter_mut().rfind(|mail| mail[0].0 < place.0 && id(mail[0]) == id(place));
        of.expect("it was sent").push(place);
    }
    mails
}

// covers: 6.1, mail-check
#[test]
fn a_hundred_power_cycles_give_the_same_list_and_right_counters() {
    if !has_tshark() {
        return;
    }
    let path = file("power");
    recorded(&path, POWER_CYCLES, None);
    let (fine, said) = check(&path, POWER_CYCLES + 1);
    println!("{said}");
    assert!(fine && said.contains(&format!(", {} start-up lists", POWER_CYCLES + 1)), "see {}", path.display());
    std::fs::remove_file(&path).expect("it was written");
}

// covers: mail-check
#[test]
fn a_subdevice_that_sends_its_mail_twice_is_found() {
    if !has_tshark() {
        return;
    }
    let path = file("twice");
    recorded(&path, 1, Some(MailFault::RepeatAnswers { count: 2 }));
    let (fine, said) = check(&path, 2);
    assert!(!fine && said.contains("counter 1 of a read mail, expected 2"), "{said}");
    std::fs::remove_file(&path).expect("it was written");
}

// covers: mail-check
#[test]
fn modified_mail_is_found() {
    if !has_tshark() {
        return;
    }
    let path = file("tampered");
    recorded(&path, 3, None);
    let original = Capture::parse(&std::fs::read(&path).expect("a capture")).expect("a capture");
    let (fine, said) = check(&path, 4);
    assert!(fine, "{said}");
    let mails = written(&original);
    let evaluated = |capture: &Capture| {
        write(capture, &path);
        check(&path, 4)
    };
    let expect = |capture: &Capture, finding: &str| {
        let (fine, said) = evaluated(capture);
        assert!(!fine && said.contains(finding), "expected \"{finding}\": {said}");
    };
    assert!(evaluated(&original).0, "unchanged, it has no findings");
    // A counter of a written mail.
    let mut tampered = original.clone();
    for (packet, at) in &mails[3] {
        tampered.packets[*packet].bytes[at + COUNTER_AT] ^= COUNTER_ONE;
    }
    expect(&tampered, "of a written mail, expected");
    // A counter of a read mail.
    let mut tampered = original.clone();
    let (packet, at) = places(&original, false, FPRD, SEND)[4];
    tampered.packets[packet].bytes[at + COUNTER_AT] ^= COUNTER_ONE;
    expect(&tampered, "of a read mail, expected");
    // The previous request again, without a response in between.
    let mut tampered = original.clone();
    let (from, to) = (&mails[4], &mails[5]);
    let content = original.packets[from[0].0].bytes[from[0].1 + 6..from[0].1 + 16].to_vec();
    for (packet, at) in to {
        tampered.packets[*packet].bytes[at + 6..at + 16].copy_from_slice(&content);
    }
    tampered.packets.drain(from.iter().map(|place| place.0).max().unwrap() + 1..to[0].0);
    expect(&tampered, "before it was answered");
    // An accepted mail again with the same counter.
    let mut tampered = original.clone();
    let again: Vec<_> = mails[4].iter().map(|(packet, _)| original.packets[*packet].clone()).collect();
    let behind = mails[4].iter().map(|place| place.0).max().unwrap() + 1;
    for (number, mut packet) in again.into_iter().enumerate() {
        packet.bytes[7] ^= 0x80;
        tampered.packets.insert(behind + number, packet);
    }
    expect(&tampered, "though it was taken");
    // Two objects of the last list are exchanged.
    let mut tampered = original.clone();
    let (one, other) = (&mails[mails.len() - 4], &mails[mails.len() - 3]);
    for (mine, theirs) in [(one, other), (other, one)] {
        let content = original.packets[theirs[0].0].bytes[theirs[0].1 + 6..theirs[0].1 + 16].to_vec();
        for (packet, at) in mine {
            tampered.packets[*packet].bytes[at + 6..at + 16].copy_from_slice(&content);
        }
    }
    expect(&tampered, "that is not the first one");
    std::fs::remove_file(&path).expect("it was written");
}
