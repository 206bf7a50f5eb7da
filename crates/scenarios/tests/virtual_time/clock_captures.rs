//! The set-up of distributed clocks in captures, judged from the file alone by `ci/check-clocks`: delays and offsets
//! computed anew from what SubDevices latched and from their DL status (facts 7.1, 7.2, 7.5). Captures that were tampered
//! with show that the script sees what it looks for.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::tee::Tee;
use ringcat::{Application, ClockConfig, MainDevice, Options};
use ringcat_link::Recorder;
use ringcat_link::pcapng::{Direction, Writer};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use scenarios::capture::pcapng::Capture;
use scenarios::clocks::{clock_tree, clocked, config, with_clocks};
use scenarios::segments::{line, ring};

const LIMIT: Duration = Duration::from_secs(5);
const LINKS: [(&str, &str); 2] = [("sim-main", "main link"), ("sim-redundant", "redundant link")];

/// What env says of a program that is not there.
const NOT_FOUND: i32 = 127;

type Recorded = Application<Tee<SimulatedSegment>>;

fn file() -> PathBuf {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let number = COUNT.fetch_add(1, Ordering::Relaxed);
    std::env::temp_dir().join(format!("ringcat-clocks-{}-{number}.pcapng", std::process::id()))
}

/// Scan, OP, `work`, all of it recorded. The static drift phase is short: nobody waits for a lock here.
fn recorded(network: Network, path: &Path, work: impl FnOnce(&mut Recorded)) {
    let recorder = Recorder::start(path, &LINKS).expect("a file");
    let links = Tee::new(SimulatedSegment::new(network), recorder.tap());
    let mut main_device = MainDevice::request(links, &Options::default());
    let scan = main_device.scan().expect("a segment");
    let config = ClockConfig { drift_distributions: 100, ..config() };
    let mut application = main_device.activate(with_clocks(&scan, config)).expect("it fits");
    settle(&mut application);
    work(&mut application);
    drop(application);
    let recorded = recorder.finish().expect("it was written");
    assert!(recorded.iter().all(|interface| interface.lost == 0), "{recorded:?}");
}

fn settle(application: &mut Recorded) {
    let until = application.now() + LIMIT;
    while !application.all_settled() {
        assert!(application.now() < until, "not in OP: {:?}", application.states());
        cycles(application, 1);
    }
}

fn cycles(application: &mut Recorded, count: usize) {
    for _ in 0..count {
        application.cycle(|_| ());
        while application.pop_event().is_some() {}
    }
}

/// What the script says, and whether it has no findings; `None` where there is no Python.
fn check(path: &Path) -> Option<(bool, String)> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../ci/check-clocks");
    let output = Command::new(script).arg(path).output().expect("env is everywhere");
    if output.status.code() == Some(NOT_FOUND) {
        println!("skipped: there is no python3");
        return None;
    }
    let text = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    Some((output.status.success(), text))
}

/// The script must find nothing wrong, and say that it has judged so much.
fn expect(name: &str, network: Network, judged: &str, work: impl FnOnce(&mut Recorded)) {
    let path = file();
    recorded(network, &path, work);
    let result = check(&path);
    std::fs::remove_file(&path).expect("it was written");
    let Some((fine, said)) = result else { return };
    println!("{name}\n{said}");
    assert!(fine && said.contains(judged), "{name}: expected {judged}\n{said}");
}

/// Some of these have no clock.
fn with_gaps(count: usize) -> Vec<DeviceDescription> {
    let mut all = clocked(count, 100);
    for gap in [0, 3, 4, 7] {
        all[gap].dc = None;
    }
    all
}

#[test]
fn written_delays_and_offsets_are_those_that_a_capture_gives_facts_7_1_facts_7_2() {
    let options = NetworkOptions::default;
    expect("line", line(clocked(12, 100), options()), "judged: 12 delays", |_| ());
    expect("tree", clock_tree(clocked(20, 100)), "judged: 20 delays", |_| ());
    expect("without a clock", line(with_gaps(11), options()), "judged: 7 delays", |_| ());
    expect("ring", ring(clocked(8, 100), options()), "judged: 8 delays", |_| ());
    let mut broken = ring(clocked(8, 100), options());
    broken.cut(CableId(3));
    broken.advance_by(Duration::from_millis(1));
    expect("broken ring", broken, "judged: 8 delays", |_| ());
}

#[test]
fn clocks_of_a_ring_that_breaks_and_of_a_subdevice_that_returns_keep_their_delays_facts_7_5() {
    let fault = |run: &mut Recorded, fault| run.links_mut().links_mut().network_mut().apply(fault);
    let network = ring(clocked(8, 100), NetworkOptions::default());
    expect("ring that breaks", network, "judged: 21 delays", |run| {
        cycles(run, 20);
        fault(run, Fault::Cut(CableId(3)));
        cycles(run, 100);
        fault(run, Fault::Heal(CableId(3)));
        cycles(run, 100);
    });
    expect("SubDevice that returns", line(clocked(6, 100), NetworkOptions::default()), "7 offsets", |run| {
        fault(run, Fault::PowerOff(DeviceIndex(5)));
        cycles(run, 50);
        fault(run, Fault::PowerOn(DeviceIndex(5)));
        cycles(run, 100);
        settle(run);
        cycles(run, 50);
    });
}

/// Is shown a datagram: whether it was sent, command, register, the bytes from its header to its counter.
type Tamper<'t> = dyn FnMut(bool, u8, u16, &mut [u8]) + 't;

/// Visits each datagram of a capture.
fn visit(capture: &mut Capture, mut take: impl FnMut(bool, u8, u16, &mut [u8])) {
    for packet in &mut capture.packets {
        let (sent, mut at) = (packet.sent, 16);
        loop {
            let bytes = &mut packet.bytes[at..];
            let flags = u16::from_le_bytes([bytes[6], bytes[7]]);
            let length = 12 + usize::from(flags & 0x07FF);
            take(sent, bytes[0], u16::from_le_bytes([bytes[4], bytes[5]]), &mut bytes[..length]);
            if flags & 0x8000 == 0 {
                break;
            }
            at += length;
        }
    }
}

fn write(capture: &Capture, path: &Path) {
    let mut writer = Writer::new(Vec::new(), &LINKS).expect("memory");
    for packet in &capture.packets {
        let direction = if packet.sent { Direction::Out } else { Direction::In };
        writer.frame(packet.interface, direction, packet.time_ns, &packet.bytes).expect("memory");
    }
    std::fs::write(path, writer.into_inner()).expect("a file");
}

const FPRD: u8 = 4;
const FPWR: u8 = 5;
const FRMW: u8 = 14;
/// Of the third SubDevice.
const STATION: [u8; 2] = 0x1003_u16.to_le_bytes();

#[test]
fn clocks_that_were_tampered_with_are_found() {
    let path = file();
    recorded(line(clocked(6, 100), NetworkOptions::default()), &path, |run| cycles(run, 20));
    let original = Capture::parse(&std::fs::read(&path).expect("a capture")).expect("a capture");
    let judged = |tamper: &mut Tamper<'_>| {
        let mut capture = original.clone();
        visit(&mut capture, tamper);
        write(&capture, &path);
        check(&path)
    };
    let Some((fine, said)) = judged(&mut |_, _, _, _| ()) else { return };
    assert!(fine, "written anew, nothing is wrong with it: {said}");
    let is_own = |bytes: &[u8]| bytes[2..4] == STATION;
    let expect = |finding: &str, tamper: &mut Tamper<'_>| {
        let (fine, said) = judged(tamper).expect("python3");
        assert!(!fine && said.contains(finding), "expected \"{finding}\": {said}");
    };
    // The delay is 4 ns too long, then the offset.
    expect("ns is what was measured", &mut |_, command, register, bytes| {
        if (command, register) == (FPWR, 0x0920) && is_own(bytes) {
            bytes[10 + 8] ^= 4;
        }
    });
    expect("its offset makes it show", &mut |_, command, register, bytes| {
        if (command, register) == (FPWR, 0x0920) && is_own(bytes) {
            bytes[10] ^= 4;
        }
    });
    // It latched something else at port 1, by 64 ns each time.
    expect("ns is what was measured", &mut |_, command, register, bytes| {
        if (command, register) == (FPRD, 0x0900) && is_own(bytes) {
            bytes[14] ^= 64;
        }
    });
    expect("its filters were not restarted", &mut |_, command, register, bytes| {
        if (command, register) == (FPWR, 0x0930) && is_own(bytes) {
            bytes[4] = 0x32;
        }
    });
    expect("its time is handed out, though its delay is", &mut |_, command, register, bytes| {
        if (command, register) == (FRMW, 0x0910) {
            bytes[2..4].copy_from_slice(&STATION);
        }
    });
    // Zero instead of a time, as the copies of others carry it.
    expect("a time is sent that is", &mut |sent, command, register, bytes| {
        if sent && (command, register) == (FRMW, 0x0910) {
            bytes[10..14].fill(0);
        }
    });
    std::fs::remove_file(&path).expect("it was written");
}
