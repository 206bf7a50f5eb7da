//! Commands without a daemon: `--sim`, and options that do not fit.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::bench::{Done, LONG, PROGRAM, directory, tool};

/// Nothing listens there.
const NOWHERE: &str = "/nothing/listens/here";

/// Whether the program of the daemon is beside the tool: `cargo test --workspace` makes it.
fn has_daemon() -> bool {
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
    std::fs::remove_dir_all(directory).expect("it is ours");
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
    std::fs::remove_dir_all(directory).expect("it is ours");
}

/// Processes that have this text in their command line.
fn processes_with(text: &str) -> Vec<String> {
    let all = std::fs::read_dir("/proc").expect("it is there").flatten();
    let lines = all.filter_map(|entry| std::fs::read(entry.path().join("cmdline")).ok());
    lines.map(|line| String::from_utf8_lossy(&line).replace('\0', " ")).filter(|line| line.contains(text)).collect()
}

// covers: daemon
#[test]
fn a_command_that_a_signal_ends_leaves_neither_files_nor_a_daemon_behind() {
    if !has_daemon() {
        return;
    }
    for signal in ["-INT", "-TERM", "-KILL"] {
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
        std::fs::remove_dir_all(directory).expect("it is ours");
    }
}

// covers: daemon
#[test]
fn what_does_not_fit_or_cannot_be_driven_is_named() {
    let run = |words: &[&str]| -> Done { tool(Path::new(NOWHERE), &[&["slaves"], words].concat()) };
    for (words, text) in [
        (&["--redundant", "eth2"][..], "option --redundant needs --main"),
        (&["--main", "eth1", "--sim", "a.toml"], "options --main and --sim exclude each other"),
    ] {
        let done = run(words);
        assert!(done.code == Some(1) && done.err.starts_with(&format!("ethercat: {text}\n")), "{done:?}");
    }
    if !has_daemon() {
        return;
    }
    let done = run(&["--sim", "/nothing.toml"]);
    assert!(done.code == Some(1) && done.err.contains("/nothing.toml"), "{done:?}");
    let done = run(&["--main", "notthere0"]);
    assert!(done.code == Some(1) && done.err.contains("notthere0"), "{done:?}");
}
