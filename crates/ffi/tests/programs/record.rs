//! The record of the last seconds before a fault, written by a program with the settings of its daemon, and by the
//! daemon when the program is killed.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use ringcat::daemon::known::{ToolAnswer, ToolQuery};
use ringcat::daemon::{Answer, BusSettings, Client, Query};
use ringcat::sim::cable::DeviceIndex;
use ringcat::sim::fault::Fault;

use crate::daemon::{Bench, wait_for_line};
use crate::library::{here, program, workshop};

/// A file is there within this time on a busy machine.
const LONG: Duration = Duration::from_secs(30);
/// Frames that are under way when a file is written: a cyclic and an acyclic one.
const UNDER_WAY: usize = 2;
const SEGMENT: &str = "[[device]]\ntype = \"digital-output-8\"\ncount = 4\n";

/// The file that is written for this reason.
fn written(directory: &Path, reason: &str) -> PathBuf {
    let begin = Instant::now();
    loop {
        let entries = std::fs::read_dir(directory).expect("it is there").flatten();
        let mut paths = entries.map(|it| it.path());
        // A file has its name when it is complete.
        if let Some(path) = paths.find(|it| it.to_string_lossy().ends_with(&format!("-{reason}.pcapng"))) {
            return path;
        }
        assert!(begin.elapsed() < LONG, "there is no file: {reason}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Frames of a capture that Wireshark takes for EtherCAT, sent and received; `None` without tshark.
fn frames(path: &Path) -> Option<[usize; 2]> {
    let count = |direction: u32| {
        let filter = format!("ecatf && frame.packet_flags_direction == {direction}");
        let output = Command::new("tshark").arg("-r").arg(path).args(["-Y", &filter]).output().ok()?;
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        Some(String::from_utf8_lossy(&output.stdout).lines().count())
    };
    Some([count(2)?, count(1)?])
}

/// At least so many frames are there in each direction. A record begins behind the last file, so frames that were under
/// way at that time have only been received: at most [`UNDER_WAY`].
fn check(path: &Path, least: usize) {
    match frames(path) {
        Some([sent, received]) => {
            println!("{}: {sent} sent, {received} received", path.display());
            let is_whole = sent > least && received > least && received <= sent + UNDER_WAY;
            assert!(is_whole, "{sent} sent, {received} received");
        }
        None => println!("skipped: there is no tshark"),
    }
}

/// Requests a file of the application, as `ethercat record` does.
fn request(socket: &Path) -> PathBuf {
    let mut client = Client::connect(socket, "test").expect("the daemon is there");
    let answered = client.ask(0, Query::Tool(ToolQuery::Record), Vec::new()).expect("it is written");
    match answered.0 {
        Answer::Tool(ToolAnswer::Record(line)) => line.path.into(),
        other => panic!("{other:?}"),
    }
}

// covers: c-interface, daemon, capture
#[test]
fn a_fault_writes_the_frames_of_the_last_seconds() {
    let Some(program) = program(&here().join("tests/c/lossless.c"), &[]) else { return };
    let directory = workshop().join("record");
    let _ = std::fs::remove_dir_all(&directory);
    std::fs::create_dir_all(&directory).expect("a directory");
    let segment = workshop().join("record.toml");
    std::fs::write(&segment, SEGMENT).expect("it can be written");
    let mut settings = BusSettings::default();
    (settings.debug_ring.is_on, settings.debug_ring.directory) = (true, directory.clone());
    settings.debug_ring.cycles = 100_000;
    let bench = Bench::start_with(&segment, "record", settings);
    let mut command = bench.command(&program);
    let mut child = command.args(["2000", "once"]).stdin(Stdio::piped()).spawn().expect("it runs");
    let _lines = wait_for_line(&mut child, "op");
    std::thread::sleep(Duration::from_millis(500));
    // A busy machine may stop for 100 ms, which is a fault of a domain; no SubDevice is lost by that.
    let names = || {
        let entries = std::fs::read_dir(&directory).expect("it is there").flatten();
        entries.map(|it| it.file_name().to_string_lossy().into_owned()).collect::<Vec<_>>()
    };
    assert!(!names().iter().any(|name| name.contains("lost")), "nothing was lost: {:?}", names());
    let requested = request(&bench.socket);
    assert!(requested.to_string_lossy().ends_with("-requested.pcapng"), "{}", requested.display());
    // Shortly before, a busy machine may have caused a file with the frames until then.
    check(&requested, 20);
    // Frames of faults have files of their own.
    std::fs::remove_file(&requested).expect("it is there");
    std::thread::sleep(Duration::from_millis(300));
    bench.inside(|segment| segment.network_mut().apply(Fault::PowerOff(DeviceIndex(3))));
    let begin = Instant::now();
    let first = loop {
        if let Some(name) = names().into_iter().find(|name| name.ends_with(".pcapng")) {
            break name;
        }
        assert!(begin.elapsed() < LONG, "there is no file");
        std::thread::sleep(Duration::from_millis(10));
    };
    let reason = ["lost", "working-counter"].into_iter().find(|reason| first.ends_with(&format!("-{reason}.pcapng")));
    check(&written(&directory, reason.expect(&first)), 100);
    let before = bench.connected_ns();
    child.kill().expect("it runs");
    child.wait().expect("it has ended");
    bench.wait_for_connection_after(before);
    // The daemon begins with an empty record; its file has the frames behind the end.
    let path = written(&directory, "owner-lost");
    assert!(std::fs::metadata(&path).expect("it is there").len() > 500, "{}", path.display());
}
