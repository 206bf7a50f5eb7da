//! Captures of RingCAT on real interfaces, by itself (`--capture`) and by a second process (`ringcat capture`), checked
//! independently: tshark finds nothing malformed, and [`scenarios::capture`] finds no violation.
//!
//! Send windows are checked with a tolerance: if the machine stops the sender between its decision and sending, a frame
//! is late although it was decided in time. If the cycle is late as well, the capture shows this and the frame is
//! counted separately; a few others are allowed. Without windows, forty returning SubDevices had five times as many
//! frames that delayed cycles as are allowed here.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output};
use std::time::Duration;

use scenarios::capture::pcapng::Capture;
use scenarios::capture::{Verdict, evaluate};

use crate::bench::{Bench, await_op, finish, program};
use crate::{PLANTS, RING_OF_16, said};

/// Acyclic frames that may delay a cycle without a visible stall: this number, and this fraction of those expected by
/// chance.
const TOLERATED: u64 = 2;
const PART_OF_CHANCE: u64 = 5;
/// Sends five frames that are no EtherCAT.
const SOMETHING_ELSE: &str = "
import socket
s = socket.socket(socket.AF_PACKET, socket.SOCK_RAW)
s.bind(('sim0', 0))
for _ in range(5):
    s.send(b'\\xff' * 6 + b'\\x00\\x30\\x64\\x11\\x22\\x33' + b'\\x08\\x00' + bytes(46))
";
/// Start-up time of `ringcat capture`.
pub const PAUSE: Duration = Duration::from_millis(300);

/// A file that is removed on drop, but kept for analysis if the test failed.
pub struct CaptureFile(PathBuf);

impl CaptureFile {
    /// A new file with this name.
    pub fn new(name: &str) -> CaptureFile {
        CaptureFile(std::env::temp_dir().join(format!("ringcat-wire-{}-{name}.pcapng", std::process::id())))
    }

    /// Where it is.
    pub fn path(&self) -> &str {
        self.0.to_str().expect("a path in Unicode")
    }

    fn bytes(&self) -> Vec<u8> {
        std::fs::read(&self.0).expect("the capture was written")
    }

    /// Checks the frames, but not their times, with [`scenarios::capture`] and tshark. `unread` are protocols that
    /// tshark does not decode.
    pub fn check_frames(&self, title: &str, unread: &[&str]) -> Verdict {
        let verdict = evaluate(&self.bytes(), Some(Duration::from_millis(1))).expect("a capture");
        println!("{title}:\n{verdict}");
        assert_eq!(verdict.broken, 0, "{title}");
        check_with_tshark(&self.0, verdict.sent.iter().sum::<u64>() + verdict.received.iter().sum::<u64>(), unread);
        verdict
    }

    /// Checks the frames of any sender with tshark; returns their number.
    pub fn check_with_tshark(&self) -> usize {
        let frames = Capture::parse(&self.bytes()).expect("a capture").packets.len();
        check_with_tshark(&self.0, frames as u64, &[]);
        frames
    }

    /// All checks of a RingCAT capture; returns the verdict.
    fn check(&self, title: &str) -> Verdict {
        let verdict = self.check_frames(title, &[]);
        for windows in &verdict.windows {
            assert!(windows.crossed <= TOLERATED + windows.by_chance / PART_OF_CHANCE, "{title}: {windows}");
        }
        verdict
    }
}

impl Drop for CaptureFile {
    fn drop(&mut self) {
        if std::thread::panicking() {
            println!("see {}", self.0.display());
        } else {
            let _ = std::fs::remove_file(&self.0);
        }
    }
}

/// Every frame is EtherCAT for tshark, none malformed, none with an expert error.
fn check_with_tshark(path: &Path, frames: u64, unread: &[&str]) {
    let found = |filter: &str| {
        let mut tshark = Command::new("tshark");
        tshark.args(unread.iter().flat_map(|protocol| ["--disable-protocol", protocol]));
        tshark.arg("-r").arg(path).args([
            "-Y",
            filter,
            "-T",
            "fields",
            "-e",
            "frame.number",
            "-e",
            "_ws.expert.message",
        ]);
        tshark.output().map(|output| said(&output))
    };
    let Ok((ethercat, errors)) = found("ecat") else {
        println!("skipped: tshark is not installed (apt-get install tshark)");
        return;
    };
    assert_eq!(ethercat.lines().count() as u64, frames, "{errors}");
    let (complaints, errors) = found("_ws.malformed || _ws.expert.severity == 0x00800000").expect("it has just run");
    assert!(complaints.is_empty(), "{complaints}{errors}");
    assert!(!errors.contains("invalid"), "{errors}");
    println!("tshark: {frames} EtherCAT frames, none malformed, no expert error\n");
}

/// Sends SIGINT to a program.
pub fn interrupt(child: Child) -> Output {
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(sent.expect("there is a kill").success());
    finish(child)
}

// covers: capture
#[test]
fn a_capture_of_one_subdevice_has_no_findings_and_tshark_decodes_it() {
    let Some(mut bench) = Bench::new(1) else { return };
    bench.simulate(&PLANTS[0].segment(), false);
    let (scan, run) = (CaptureFile::new("scan"), CaptureFile::new("run"));
    let (_, errors) = said(&bench.ringcat(&["scan", "--main", "main0", "--capture", scan.path()]));
    assert!(errors.contains("frames received") && errors.contains(" 0 not recorded"), "{errors}");
    let verdict = scan.check("scan of 1 SubDevice");
    assert!(verdict.reads > 0 && verdict.windows.is_empty(), "{verdict}");
    let (output, errors) = said(&bench.ringcat(&["run", "--main", "main0", "--for", "2s", "--capture", run.path()]));
    assert!(output.contains("stopped: outputs zero"), "{output}{errors}");
    assert!(errors.contains("frames received") && errors.contains(" 0 not recorded"), "{errors}");
    let verdict = run.check("run with 1 SubDevice");
    assert_eq!(verdict.pairs, 0);
    assert!(verdict.windows[0].cycles > 1000, "{verdict}");
}

// covers: capture
#[test]
fn captures_of_a_ring_of_16_with_a_cut_have_no_findings() {
    let Some(mut bench) = Bench::new(2) else { return };
    bench.simulate(&RING_OF_16.segment(), true);
    let (own, seen) = (CaptureFile::new("own"), CaptureFile::new("seen"));
    let links = ["--main", "main0", "--redundant", "main1"];
    let ringcat = program("ringcat");
    let onlooker = bench.start(&ringcat, &[&["capture", "--out", seen.path()], &links[..]].concat());
    std::thread::sleep(PAUSE);
    let run = bench.start_ringcat(&[&["run", "--for", "4s", "--capture", own.path()], &links[..]].concat());
    await_op(&bench, 16);
    for order in ["cut 7-8", "heal all", "power off 5", "power on 5"] {
        bench.order(order);
        std::thread::sleep(PAUSE);
    }
    let (output, errors) = said(&finish(run));
    assert!(output.contains("ring open") && output.contains("stopped: outputs zero"), "{output}{errors}");
    let (reports, errors) = said(&interrupt(onlooker));
    assert!(reports.contains("main1: ") && reports.contains(" 0 not recorded"), "{reports}{errors}");
    let verdict = own.check("run on a ring of 16, a cable cut and healed, a SubDevice off and on");
    assert_eq!(verdict.pairs, verdict.sent[0]);
    assert!(verdict.missing < 100, "{verdict}");
    let onlookers = seen.check("the same, seen by an onlooker");
    assert_eq!((onlookers.sent, onlookers.reads), (verdict.sent, verdict.reads));
}

// covers: capture
#[test]
fn a_capture_of_a_ring_with_cut_host_cables_has_no_findings() {
    let Some(mut bench) = Bench::new(2) else { return };
    bench.simulate(&RING_OF_16.segment(), true);
    let own = CaptureFile::new("host");
    let run = bench.start_ringcat(&[
        "run",
        "--for",
        "3s",
        "--main",
        "main0",
        "--redundant",
        "main1",
        "--capture",
        own.path(),
    ]);
    await_op(&bench, 16);
    for (interface, state) in [("main0", "down"), ("main0", "up"), ("sim1", "down"), ("sim1", "up")] {
        bench.set_link(interface, state);
        std::thread::sleep(PAUSE);
    }
    let (output, errors) = said(&finish(run));
    assert!(output.contains("stopped: outputs zero"), "{output}{errors}");
    let verdict = own.check("run on a ring of 16, both host cables cut and healed");
    // Half of the copies of some hundred cycles.
    assert!(verdict.missing > 100, "{verdict}");
}

// covers: capture
#[test]
fn the_return_of_forty_subdevices_delays_no_cycle_in_a_capture() {
    let Some(mut bench) = Bench::new(1) else { return };
    bench.simulate(&PLANTS[2].segment(), false);
    let own = CaptureFile::new("return");
    let run = bench.start_ringcat(&["run", "--main", "main0", "--for", "4s", "--capture", own.path()]);
    await_op(&bench, 50);
    for state in ["off", "on"] {
        for device in 10..50 {
            bench.order(&format!("power {state} {device}"));
        }
        std::thread::sleep(PAUSE);
    }
    await_op(&bench, 50);
    let (output, errors) = said(&finish(run));
    assert!(output.contains("stopped: outputs zero"), "{output}{errors}");
    let verdict = own.check("run with 50 SubDevices, forty of them off and on");
    assert!(verdict.windows[0].by_chance >= 10, "too few acyclic frames to show anything: {verdict}");
}

// covers: capture
#[test]
fn ringcat_capture_records_ethercat_or_all_frames_and_names_errors() {
    let Some(mut bench) = Bench::new(1) else { return };
    bench.simulate(&PLANTS[0].segment(), false);
    let (some, all) = (CaptureFile::new("some"), CaptureFile::new("all"));
    let ringcat = program("ringcat");
    let start = |out: &str, more: &[&str]| {
        bench.start(&ringcat, &[&["capture", "--main", "main0", "--for", "3s", "--out", out], more].concat())
    };
    let onlookers = [start(some.path(), &[]), start(all.path(), &["--all"])];
    std::thread::sleep(PAUSE);
    let said_so = finish(bench.start_at_sim(Path::new("python3"), &["-c", SOMETHING_ELSE]));
    assert!(said_so.status.success(), "{:?}", said(&said_so));
    bench.ringcat(&["scan", "--main", "main0"]);
    for onlooker in onlookers {
        let (reports, errors) = said(&finish(onlooker));
        assert!(reports.contains("main0: ") && reports.contains(" 0 not recorded"), "{reports}{errors}");
    }
    let count = |file: &CaptureFile| {
        let capture = Capture::parse(&file.bytes()).expect("a capture");
        let (ethercat, others): (Vec<_>, Vec<_>) =
            capture.packets.into_iter().partition(|packet| packet.bytes[12..14] == [0x88, 0xA4]);
        (ethercat.len(), others.len())
    };
    let (some, all) = (count(&some), count(&all));
    assert!(some.0 > 50 && some.1 == 0, "{some:?}");
    assert_eq!(all, (some.0, 5));
    let error_of = |arguments: &[&str]| {
        let output = finish(bench.start(&ringcat, &[&["capture"], arguments].concat()));
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        said(&output).1
    };
    let missing = error_of(&["--main", "nowhere", "--out", "/tmp/never.pcapng"]);
    assert!(missing.contains("\"nowhere\"; there are: ") && missing.contains("main0"), "{missing}");
    let nowhere = error_of(&["--main", "main0", "--out", "/nowhere/at/all.pcapng"]);
    assert!(nowhere.contains("/nowhere/at/all.pcapng") && nowhere.contains("make its directory first"), "{nowhere}");
}
