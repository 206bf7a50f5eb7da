//! The set-up of distributed clocks in captures, checked from the file alone by `ci/check-clocks`: delays and offsets
//! recomputed from latched receive times and DL status (protocol 7.1, 7.2, 7.5). Modified captures show that the script
//! detects faults.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::tee::Tee;
use ringcat::{Application, JunctionMode, MainDevice, Options};
use ringcat_engine::{Class, class_of};
use ringcat_link::Recorder;
use ringcat_link::pcapng::{Direction, Writer};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::fault::Fault;
use ringcat_sim::frame::Port::{A, B, C, D};
use ringcat_sim::network::{Network, NetworkOptions};
use scenarios::capture::ethercat::Frame;
use scenarios::capture::pcapng::Capture;
use scenarios::clocks::{clock_tree, clocked, config, wired, with_clocks};
use scenarios::segments::{MAIN, RING_BEHIND_JUNCTION, RING_OF_THREE, at, line, ring};

const LIMIT: Duration = Duration::from_secs(5);
const LINKS: [(&str, &str); 2] = [("sim-main", "main link"), ("sim-redundant", "redundant link")];

/// Exit status of env for a missing program.
const NOT_FOUND: i32 = 127;

type Recorded = Application<Tee<SimulatedSegment>>;

fn file() -> PathBuf {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let number = COUNT.fetch_add(1, Ordering::Relaxed);
    std::env::temp_dir().join(format!("ringcat-clocks-{}-{number}.pcapng", std::process::id()))
}

/// Records scan, OP and `work`. The static drift phase is short because no lock is needed here.
fn recorded(options: &Options, network: Network, path: &Path, work: impl FnOnce(&mut Recorded)) {
    let recorder = Recorder::start(path, &LINKS).expect("a file");
    let links = Tee::new(SimulatedSegment::new(network), recorder.tap());
    let mut main_device = MainDevice::request(links, options);
    let scan = main_device.scan().expect("a segment");
    let config = config().with_drift_distributions(100);
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

/// Captures, and the expected output of the script for each. The script is started once for all of them.
#[derive(Default)]
struct Cases {
    all: Vec<(PathBuf, Case)>,
}

/// Expected output.
enum Case {
    /// No finding, and this amount of checks.
    Fine(&'static str, &'static str),
    /// This finding.
    Finding(&'static str),
}

impl Cases {
    /// The script must have no finding, and report this amount of checks.
    fn fine(
        &mut self,
        name: &'static str,
        network: Network,
        evaluated: &'static str,
        work: impl FnOnce(&mut Recorded),
    ) {
        let path = file();
        let options = Options::default().with_junctions(JunctionMode::Automatic);
        recorded(&options, network, &path, work);
        self.all.push((path, Case::Fine(name, evaluated)));
    }

    /// Checks all captures.
    fn evaluate(self) {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../ci/check-clocks");
        let paths = self.all.iter().map(|(path, _)| path);
        let output = Command::new(script).args(paths).output().expect("env is everywhere");
        if output.status.code() == Some(NOT_FOUND) {
            println!("skipped: there is no python3");
            return;
        }
        let text = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        let any_finding = self.all.iter().any(|(_, case)| matches!(case, Case::Finding(_)));
        assert_eq!(output.status.code(), Some(i32::from(any_finding)), "{text}");
        for (path, case) in &self.all {
            let begin = format!("file: {}\n", path.display());
            let said = if self.all.len() == 1 { Some(&*text) } else { text.split_once(&begin).map(|(_, said)| said) };
            let said = said.unwrap_or_else(|| panic!("nothing is said of {}: {text}", path.display()));
            let said = said.split("\nfile: ").next().unwrap_or_default();
            match case {
                Case::Fine(name, evaluated) => {
                    println!("{name}\n{said}");
                    assert!(
                        said.contains("findings: 0") && said.contains(evaluated),
                        "{name}: expected {evaluated}\n{said}"
                    );
                }
                Case::Finding(finding) => {
                    assert!(!said.contains("findings: 0") && said.contains(finding), "expected \"{finding}\": {said}");
                }
            }
        }
    }
}

impl Drop for Cases {
    fn drop(&mut self) {
        self.all.iter().for_each(|(path, _)| drop(std::fs::remove_file(path)));
    }
}

/// As often as declared (here 100 times), eight at a time, while states change.
// covers: 7.2, dc-lock
#[test]
fn the_static_drift_phase_is_as_long_as_declared_in_bursts_beside_the_start_up() {
    let path = file();
    recorded(&Options::default(), line(clocked(3, 50), NetworkOptions::default()), &path, |run| cycles(run, 20));
    let capture = Capture::parse(&std::fs::read(&path).expect("a capture")).expect("a capture");
    std::fs::remove_file(&path).expect("it was written");
    let (mut handed_out, mut states) = (Vec::new(), Vec::new());
    for packet in capture.packets.iter().filter(|packet| packet.sent) {
        let is_acyclic = class_of(&packet.bytes) == Some(Class::Acyclic);
        for datagram in Frame::parse(&packet.bytes).expect("one of ours").datagrams {
            match (datagram.command, datagram.ado) {
                (FRMW, 0x0910) if is_acyclic => handed_out.push(packet.time_ns),
                (FPWR, 0x0120) => states.push(packet.time_ns),
                _ => {}
            }
        }
    }
    assert_eq!(handed_out.len(), 100);
    let (first, last) = (handed_out[0], handed_out[99]);
    assert!(states.iter().any(|at| (first..last).contains(at)), "{first} to {last}: {states:?}");
    // 80 us apart on average, since the control loops need time; less within a burst, so that other frames can be sent
    // in between.
    assert!(last - first >= 12 * 640_000, "{handed_out:?}");
    for bursts in handed_out.chunks(8).collect::<Vec<_>>().windows(2) {
        let (within, between) = (bursts[0][7] - bursts[0][0], bursts[1][0] - bursts[0][7]);
        assert!(within < 640_000 && between >= 100_000, "{within} ns, next after {between} ns: {handed_out:?}");
    }
}

/// Some of these have no clock.
fn with_gaps(count: usize) -> Vec<DeviceDescription> {
    let mut all = clocked(count, 100);
    for gap in [0, 3, 4, 7] {
        all[gap].dc = None;
    }
    all
}

// covers: 7.1, 7.2, dc-tools
#[test]
fn written_delays_and_offsets_match_the_capture() {
    let mut cases = Cases::default();
    let options = NetworkOptions::default;
    cases.fine("line", line(clocked(12, 100), options()), "checked: 12 delays", |_| ());
    cases.fine("tree", clock_tree(clocked(20, 100)), "checked: 20 delays", |_| ());
    cases.fine("without a clock", line(with_gaps(11), options()), "checked: 7 delays", |_| ());
    cases.fine("ring", ring(clocked(8, 100), options()), "checked: 8 delays", |_| ());
    let mut broken = ring(clocked(8, 100), options());
    broken.cut(CableId(3));
    broken.advance_by(Duration::from_millis(1));
    cases.fine("broken ring", broken, "checked: 8 delays", |_| ());
    cases.evaluate();
}

// covers: 7.5, dc-tools
#[test]
fn clocks_of_a_ring_that_breaks_and_of_a_subdevice_that_returns_keep_their_delays() {
    let mut cases = Cases::default();
    let network = ring(clocked(8, 100), NetworkOptions::default());
    cases.fine("ring that breaks", network, "checked: 21 delays", |run| {
        cycles(run, 20);
        apply(run, Fault::Cut(CableId(3)));
        cycles(run, 100);
        apply(run, Fault::Heal(CableId(3)));
        cycles(run, 100);
    });
    cases.fine("SubDevice that returns", line(clocked(6, 100), NetworkOptions::default()), "7 offsets", |run| {
        apply(run, Fault::PowerOff(DeviceIndex(5)));
        cycles(run, 50);
        apply(run, Fault::PowerOn(DeviceIndex(5)));
        cycles(run, 100);
        settle(run);
        cycles(run, 50);
    });
    cases.evaluate();
}

fn apply(run: &mut Recorded, fault: Fault) {
    run.links_mut().links_mut().network_mut().apply(fault);
}

/// A line with device 1 crossed, and device 4 behind a branch crossed too.
fn crossed() -> Network {
    let cables = [
        (MAIN, at(0, A)),
        (at(0, B), at(1, B)),
        (at(1, A), at(2, A)),
        (at(2, D), at(3, A)),
        (at(2, B), at(4, B)),
        (at(4, A), at(5, A)),
    ];
    wired(clocked(6, 100), &cables)
}

/// A fork without a clock, device 1, with two branches of two clocks and one more clock behind it.
fn fork() -> Network {
    let cables = [
        (MAIN, at(0, A)),
        (at(0, B), at(1, A)),
        (at(1, D), at(2, A)),
        (at(2, B), at(3, A)),
        (at(1, B), at(4, A)),
        (at(4, B), at(5, A)),
        (at(1, C), at(6, A)),
    ];
    let mut descriptions = clocked(7, 100);
    descriptions[1].dc = None;
    wired(descriptions, &cables)
}

// covers: 7.1, dc-tools
#[test]
fn captures_with_crossed_subdevices_and_clockless_forks_are_checked() {
    let mut cases = Cases::default();
    cases.fine("crossed", crossed(), "checked: 6 delays", |_| ());
    cases.fine("fork without a clock", fork(), "checked: 6 delays", |_| ());
    cases.evaluate();
}

// covers: 7.5, 9.4, dc-tools
#[test]
fn captures_of_rings_behind_junctions_are_checked() {
    let mut cases = Cases::default();
    let network = || wired(clocked(7, 100), &RING_BEHIND_JUNCTION);
    cases.fine("ring behind a junction", network(), "checked: 63 delays", |run| {
        cycles(run, 20);
        for cable in RING_OF_THREE {
            apply(run, Fault::Cut(CableId(cable)));
            cycles(run, 100);
            apply(run, Fault::Heal(CableId(cable)));
            cycles(run, 100);
        }
    });
    let mut broken = network();
    broken.cut(CableId(3));
    broken.advance_by(Duration::from_millis(1));
    cases.fine("ring that is whole later", broken, "checked: 14 delays", |run| {
        cycles(run, 20);
        apply(run, Fault::Heal(CableId(3)));
        cycles(run, 100);
    });
    cases.evaluate();
}

/// Called for a datagram: whether it was sent, command, register, the bytes from its header to its counter.
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
/// Station address of the third SubDevice.
const STATION: [u8; 2] = 0x1003_u16.to_le_bytes();

/// A capture that is checked with changes.
struct Tampering {
    original: Capture,
}

impl Tampering {
    /// Of a run.
    fn with(network: Network, work: impl FnOnce(&mut Recorded)) -> Tampering {
        let path = file();
        let options = Options::default().with_junctions(JunctionMode::Automatic);
        recorded(&options, network, &path, work);
        let original = Capture::parse(&std::fs::read(&path).expect("a capture")).expect("a capture");
        std::fs::remove_file(&path).expect("it was written");
        Tampering { original }
    }

    fn add(&self, cases: &mut Cases, case: Case, tamper: &mut Tamper<'_>) {
        let (mut capture, path) = (self.original.clone(), file());
        visit(&mut capture, tamper);
        write(&capture, &path);
        cases.all.push((path, case));
    }

    /// Increases the written delays of these stations: those written with their offsets, or those written later.
    fn add_longer(&self, cases: &mut Cases, finding: &'static str, stations: &[u16], from: u16, by: i32) {
        self.add(cases, Case::Finding(finding), &mut |_, command, register, bytes| {
            let station = u16::from_le_bytes([bytes[2], bytes[3]]);
            if (command, register) == (FPWR, from) && stations.contains(&station) {
                let delay = bytes[usize::from(10 + 0x0928 - from)..].first_chunk_mut().expect("a delay");
                *delay = (i32::from_le_bytes(*delay) + by).to_le_bytes();
            }
        });
    }
}

// covers: dc-tools
#[test]
fn modified_delays_are_found_crossed_behind_forks_and_in_rings() {
    let mut cases = Cases::default();
    // Stations are numbered in the order in which the frame is processed: device 1 is the last.
    let tampering = Tampering::with(crossed(), |_| ());
    // Away from the measured value: towards it, rounding may hide the change.
    tampering.add_longer(&mut cases, "ns is what was measured", &[0x1006], 0x0920, -4);
    let tampering = Tampering::with(fork(), |_| ());
    // The second clock of a branch against its first; a branch as a whole against the clocks before and behind it.
    tampering.add_longer(&mut cases, "ns is what was measured", &[0x1004], 0x0920, 4);
    tampering.add_longer(
        &mut cases,
        "before the branch processed earlier has ended",
        &[0x1005, 0x1006],
        0x0920,
        -2_100,
    );
    tampering.add_longer(&mut cases, "after the frame was back", &[0x1007], 0x0920, 2_000);
    // In a ring that was broken from the start and is closed later.
    let mut network = wired(clocked(7, 100), &RING_BEHIND_JUNCTION);
    network.cut(CableId(3));
    network.advance_by(Duration::from_millis(1));
    let tampering = Tampering::with(network, |run| {
        apply(run, Fault::Heal(CableId(3)));
        cycles(run, 100);
    });
    tampering.add_longer(&mut cases, "ns is what was measured", &[0x1004], 0x0928, 30);
    cases.evaluate();
}

// covers: dc-tools
#[test]
fn modified_clock_set_ups_are_found() {
    let tampering = Tampering::with(line(clocked(6, 100), NetworkOptions::default()), |run| cycles(run, 20));
    let mut cases = Cases::default();
    tampering.add(&mut cases, Case::Fine("written anew", "checked: 6 delays"), &mut |_, _, _, _| ());
    let is_own = |bytes: &[u8]| bytes[2..4] == STATION;
    let mut expect =
        |finding: &'static str, tamper: &mut Tamper<'_>| tampering.add(&mut cases, Case::Finding(finding), tamper);
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
    // Its receive time at port 1 is changed by 64 ns each time.
    expect("ns is what was measured", &mut |_, command, register, bytes| {
        if (command, register) == (FPRD, 0x0900) && is_own(bytes) {
            let time = u32::from_le_bytes([bytes[14], bytes[15], bytes[16], bytes[17]]).wrapping_add(64);
            bytes[14..18].copy_from_slice(&time.to_le_bytes());
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
    // Zero instead of a time, as in the copies of other stacks.
    expect("a time is sent that is", &mut |sent, command, register, bytes| {
        if sent && (command, register) == (FRMW, 0x0910) {
            bytes[10..14].fill(0);
        }
    });
    cases.evaluate();
}
