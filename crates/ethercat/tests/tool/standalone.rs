//! Commands without a daemon: `--sim`, and options that do not fit.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::bench::{Done, LONG, PROGRAM, directory, tool};

/// Nothing listens there.
const NOWHERE: &str = "/nothing/listens/here";

/// Whether the program of the daemon is beside the tool: `cargo test --workspace` makes it.
pub fn has_daemon() -> bool {
    let is_there = Path::new(PROGRAM).with_file_name("ringcatd").is_file();
    assert!(is_there || std::env::var_os("CI").is_none(), "the whole workspace is built");
    if !is_there {
        println!("skipped: `cargo build -p ringcatd` makes the daemon that the tool starts");
    }
    is_there
}

/// A directory with a segment file.
fn segment() -> (PathBuf, String) {
    let directory = directory();
    let kinds = ["coupler", "digital-output-8", "digital-input-8", "servo"];
    let text: String = kinds.map(|kind| format!("[[device]]\ntype = \"{kind}\"\n")).concat();
    let file = directory.join("segment.toml");
    std::fs::write(&file, format!("[segment]\nring = true\n{text}")).expect("it can be written");
    let path = file.to_str().expect("it is text").to_owned();
    (directory, path)
}

// covers: daemon
#[test]
fn commands_work_on_a_simulated_segment_without_a_daemon() {
    if !has_daemon() {
        return;
    }
    let (directory, file) = segment();
    let run = |words: &[&str]| {
        let done = tool(Path::new(NOWHERE), &[words, &["--sim", &file]].concat());
        assert!(done.code == Some(0) && done.err.is_empty(), "{words:?}: {done:?}");
        done.out
    };
    let listed = run(&["slaves"]);
    assert_eq!((listed.lines().count(), listed.matches("  PREOP  +  ").count()), (4, 4), "{listed}");
    assert!(run(&["upload", "-p3", "0x1018", "1"]).starts_with("0x"));
    assert!(run(&["pdos", "-p3"]).contains("RxPDO"));
    assert!(run(&["master"]).contains("  Slaves: 4\n"));
    assert_eq!(run(&["states", "-p3", "SAFEOP"]), "");
    assert!(run(&["events"]).lines().count() > 0);
    // Nothing is started for it.
    assert!(tool(Path::new(NOWHERE), &["version", "--sim", "/none"]).out.starts_with("IgH EtherCAT master 1.6.6"));
    std::fs::remove_dir_all(directory).expect("it is writable");
}

// covers: daemon
#[test]
fn a_command_without_a_daemon_leaves_nothing_behind() {
    if !has_daemon() {
        return;
    }
    let (directory, file) = segment();
    let mut command = Command::new(PROGRAM);
    command.args(["slaves", "--sim", &file]).env("TMPDIR", &directory).stdout(Stdio::null());
    assert!(command.status().expect("it starts").success());
    let left: Vec<_> = std::fs::read_dir(&directory).expect("it is there").flatten().map(|it| it.file_name()).collect();
    assert_eq!(left, ["segment.toml"]);
    std::fs::remove_dir_all(directory).expect("it is writable");
}

/// Processes that have this text in their command line.
fn processes_with(text: &str) -> Vec<String> {
    let all = std::fs::read_dir("/proc").expect("it is there").flatten();
    let lines = all.filter_map(|entry| std::fs::read(entry.path().join("cmdline")).ok());
    lines.map(|line| String::from_utf8_lossy(&line).replace('\0', " ")).filter(|line| line.contains(text)).collect()
}

/// Whether this process, and each that it starts, ignores SIGINT.
fn ignores_interrupts() -> bool {
    /// SIGINT is signal 2, and bit 1 of the mask.
    const MASK: u64 = 1 << 1;
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask & MASK != 0)
}

// covers: daemon
#[test]
fn a_command_that_a_signal_ends_leaves_neither_files_nor_a_daemon_behind() {
    if !has_daemon() {
        return;
    }
    for signal in ["-INT", "-TERM", "-KILL"] {
        if signal == "-INT" && ignores_interrupts() {
            println!("skipped: SIGINT is ignored, as in what a shell starts in the background");
            continue;
        }
        let (directory, file) = segment();
        let mut command = Command::new(PROGRAM);
        command.args(["events", "--follow", "--sim", &file]).env("TMPDIR", &directory).stdin(Stdio::null());
        let mut command = command.stdout(Stdio::piped()).spawn().expect("it starts");
        let mut line = String::new();
        let output = command.stdout.as_mut().expect("it is piped");
        BufReader::new(output).read_line(&mut line).expect("it is text");
        assert!(!line.is_empty());
        let sent = Command::new("kill").args([signal, &command.id().to_string()]).status();
        assert!(sent.is_ok_and(|status| status.success()));
        assert!(!command.wait().expect("it ends").success());
        let begin = Instant::now();
        while !processes_with(&file).is_empty() {
            assert!(begin.elapsed() < LONG, "{signal}: {:?}", processes_with(&file));
            std::thread::sleep(Duration::from_millis(5));
        }
        let left: Vec<_> =
            std::fs::read_dir(&directory).expect("it is there").flatten().map(|it| it.file_name()).collect();
        assert_eq!(left, ["segment.toml"], "{signal}");
        std::fs::remove_dir_all(directory).expect("it is writable");
    }
}

// covers: daemon
#[test]
fn states_without_a_daemon_are_reached_when_the_command_ends() {
    if !has_daemon() {
        return;
    }
    let directory = directory();
    let file = directory.join("slow.toml");
    let text = "[[device]]\ntype = \"digital-input-8\"\n[[device]]\ntype = \"servo\"\nto_safeop_ms = 700\n";
    std::fs::write(&file, text).expect("it can be written");
    let run = |words: &[&str]| {
        let begin = Instant::now();
        let done = tool(Path::new(NOWHERE), &[words, &["--sim", file.to_str().expect("it is text")]].concat());
        (done, begin.elapsed())
    };
    let (done, took) = run(&["states", "SAFEOP"]);
    assert!(done.code == Some(0) && done.err.is_empty(), "{done:?}");
    assert!(took >= Duration::from_millis(700), "{took:?}");
    let (done, _) = run(&["states", "-p0", "BOOT"]);
    assert_eq!(done.code, Some(1), "{done:?}");
    assert!(done.err.contains("position 0") && done.err.contains("no mailboxes for BOOT"), "{done:?}");
    std::fs::remove_dir_all(directory).expect("it is writable");
}

/// A network namespace with both ends of a cable that no segment is at; it is removed at the end.
struct Namespace(String);

impl Namespace {
    fn ip(&self, arguments: &str) {
        let done = Command::new("ip").args(arguments.replace("NS", &self.0).split(' ')).status().expect("ip is there");
        assert!(done.success(), "ip {arguments}");
    }
}

impl Drop for Namespace {
    fn drop(&mut self) {
        self.ip("netns del NS");
    }
}

// covers: daemon
#[test]
fn a_segment_that_cannot_be_scanned_is_no_empty_one() {
    if std::env::var_os("RINGCAT_ON_THE_WIRE").is_none() || !has_daemon() {
        println!("skipped: RINGCAT_ON_THE_WIRE is not set");
        return;
    }
    let place = Namespace(format!("ethercat{}", std::process::id()));
    place.ip("netns add NS");
    place.ip("-n NS link add near0 type veth peer name far0");
    for end in ["near0", "far0"] {
        place.ip(&format!("-n NS link set {end} addrgenmode none up"));
    }
    for words in ["slaves", "states OP"] {
        let mut command = Command::new("ip");
        command.args(["netns", "exec", &place.0, PROGRAM]).args(words.split(' ')).args(["--main", "near0"]);
        let output = command.stdin(Stdio::null()).output().expect("it starts");
        let text = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(1) && text.starts_with("no slave answers: "), "{text}");
    }
}

// covers: daemon
#[test]
fn a_reader_that_closes_its_end_ends_a_command_that_follows_events() {
    if !has_daemon() {
        return;
    }
    let (directory, file) = segment();
    let mut command = Command::new(PROGRAM);
    command.args(["events", "--follow", "--sim", &file]).stdin(Stdio::null()).stdout(Stdio::piped());
    let mut command = command.spawn().expect("it starts");
    let mut output = BufReader::new(command.stdout.take().expect("it is piped"));
    let mut line = String::new();
    output.read_line(&mut line).expect("it is text");
    drop(output);
    let begin = Instant::now();
    while command.try_wait().expect("it is a child").is_none() {
        assert!(begin.elapsed() < LONG, "it goes on");
        std::thread::sleep(Duration::from_millis(5));
    }
    std::fs::remove_dir_all(directory).expect("it is writable");
}

// covers: daemon
#[test]
fn an_output_that_cannot_be_written_is_named() {
    if !has_daemon() {
        return;
    }
    let (directory, file) = segment();
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").expect("it is there");
    let output = Command::new(PROGRAM).args(["slaves", "--sim", &file]).stdout(full).output().expect("it starts");
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(text.starts_with("Failed to write the output: No space left on device"), "{text}");
    std::fs::remove_dir_all(directory).expect("it is writable");
}

// covers: daemon
#[test]
fn a_segment_file_may_have_any_name_but_must_be_a_file_with_devices() {
    if !has_daemon() {
        return;
    }
    let (directory, file) = segment();
    let run = |file: &str| {
        let mut command = Command::new(PROGRAM);
        command.args(["slaves", &format!("--sim={file}")]).current_dir(&directory).stdin(Stdio::null());
        let output = command.output().expect("it starts");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    std::fs::copy(&file, directory.join("-x.toml")).expect("it can be written");
    assert_eq!(run("-x.toml"), (Some(0), String::new()));
    std::fs::write(directory.join("empty.toml"), "").expect("it can be written");
    assert!(Command::new("mkfifo").arg(directory.join("pipe")).status().expect("it is there").success());
    for (file, text) in [
        ("empty.toml", "empty.toml: the segment has no [[device]]\n"),
        ("pipe", "pipe: cannot be read: it is no regular file\n"),
        ("/dev/zero", "/dev/zero: cannot be read: it is no regular file\n"),
    ] {
        let (code, said) = run(file);
        assert!(code == Some(1) && said.ends_with(text), "{file}: {code:?} {said}");
    }
    std::fs::remove_dir_all(directory).expect("it is writable");
}

// covers: daemon
#[test]
fn a_long_path_for_temporary_files_is_no_obstacle() {
    if !has_daemon() {
        return;
    }
    let (directory, file) = segment();
    let long = directory.join("x".repeat(120));
    std::fs::create_dir(&long).expect("it can be made");
    let mut command = Command::new(PROGRAM);
    let output = command.args(["slaves", "--sim", &file]).env("TMPDIR", &long).output().expect("it starts");
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    std::fs::remove_dir_all(directory).expect("it is writable");
}

// covers: daemon
#[test]
fn what_does_not_fit_or_cannot_be_driven_is_named() {
    let run = |words: &[&str]| -> Done { tool(Path::new(NOWHERE), &[&["slaves"], words].concat()) };
    for (words, text) in [
        (&["--redundant", "eth2"][..], "option --redundant needs --main"),
        (&["--main", "eth1", "--sim", "a.toml"], "options --main and --sim exclude each other"),
        (&["--main", "sim:a"], "option --main: 'sim:a' is neither the name nor the address of an interface"),
        (&["--main", "eth1", "--redundant", "a,b"], "option --redundant: 'a,b' is neither the name nor the address"),
    ] {
        let done = run(words);
        assert!(done.code == Some(1) && done.err.starts_with(&format!("ethercat: {text}")), "{done:?}");
    }
    if !has_daemon() {
        return;
    }
    let done = run(&["--sim", "/nothing.toml"]);
    assert!(done.code == Some(1) && done.err.contains("/nothing.toml"), "{done:?}");
    let done = run(&["--main", "notthere0"]);
    assert!(done.code == Some(1) && done.err.contains("notthere0"), "{done:?}");
}
