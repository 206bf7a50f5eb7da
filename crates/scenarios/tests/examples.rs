//! Each example of the workspace runs to its end and shows what it is for, or says here why a test does not run it.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Name, arguments, and a part of what it prints at its end.
const RUN: [(&str, &[&str], &str); 10] = [
    ("csp_drive", &[], "back at 0, largest following error"),
    ("eni", &[], "outputs Drive.Control word"),
    ("firmware_update", &[], "20012 bytes written\nversion 2.7"),
    ("hops", &["10", "100"], "ns per hop"),
    ("repeated_transfer", &[], "Second is ACTIVE, and writes the recipe\nSecond: the recipe is written"),
    ("ring_with_a_cut", &[], "ring Open, broken between SubDevice 1 port 1 and SubDevice 2 port 0"),
    ("running_light", &[], "working counter 2 of 2 after 500 cycles"),
    ("sdo_from_another_thread", &[], "SDO 0x7777:00: aborted by the SubDevice: 0x06020000"),
    ("two_controllers", &[], "Second: taken over: 4 SubDevices go on as they are"),
    ("two_threads", &[], "working counter 1 of 1; "),
];

/// Those with tests of their own here.
const APART: [&str; 2] = ["ring_picture", "shell_files"];

/// Those that need more than this machine, with the reason.
const LEFT_OUT: [(&str, &str); 2] = [
    ("echo_floor", "measures for minutes, on interfaces"),
    ("ethercrab_client", "another MainDevice; the tests on real interfaces run it"),
];

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Runs an example; `None`, with a line, where only a part of the workspace was built.
fn run(name: &str, arguments: &[&str]) -> Option<Output> {
    let test = std::env::current_exe().expect("it runs");
    let program = test.parent().and_then(Path::parent).expect("it is in deps").join("examples").join(name);
    if !program.exists() {
        println!("skipped: {name} is not built here; cargo test --workspace builds it");
        return None;
    }
    let output = Command::new(program).args(arguments).output().expect("it starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{name}: {}\n{errors}", output.status);
    Some(output)
}

// covers: library, eni-run, foe, ring-cut, threads, standby
#[test]
fn examples_run_to_their_end_and_show_what_they_are_for() {
    for (name, arguments, shown) in RUN {
        let Some(output) = run(name, arguments) else { continue };
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(text.contains(shown), "{name}: expected \"{shown}\" in:\n{text}");
    }
}

// covers: demo, ring-cut
#[test]
fn the_picture_of_the_readme_is_the_one_that_the_example_draws() {
    let Some(output) = run("ring_picture", &[]) else { return };
    let picture = std::fs::read(workspace().join("docs/ring.svg")).expect("it is there");
    assert!(output.stdout == picture, "cargo run -p scenarios --example ring_picture > docs/ring.svg");
}

// covers: daemon
#[test]
fn completion_and_manual_pages_are_written() {
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("shell-files-{}", std::process::id()));
    let Some(_) = run("shell_files", &[directory.to_str().expect("it is text")]) else { return };
    for file in ["ethercat.bash", "_ethercat", "ethercat.fish", "man8/ethercat.8"] {
        let length = std::fs::metadata(directory.join(file)).map(|file| file.len());
        assert!(length.is_ok_and(|length| length > 1_000), "{file}");
    }
    std::fs::remove_dir_all(directory).expect("it is there");
}

// covers: library
#[test]
fn no_example_is_forgotten() {
    let mut there = BTreeSet::new();
    for package in std::fs::read_dir(workspace().join("crates")).expect("it is there").flatten() {
        let Ok(examples) = std::fs::read_dir(package.path().join("examples")) else { continue };
        for example in examples.flatten().map(|example| example.path()) {
            if example.is_dir() || example.extension().is_some_and(|it| it == "rs") {
                there.insert(example.file_stem().expect("it has a name").to_string_lossy().into_owned());
            }
        }
    }
    let run = RUN.iter().map(|(name, ..)| *name).chain(APART);
    let known: BTreeSet<String> = run.chain(LEFT_OUT.iter().map(|(name, _)| *name)).map(str::to_owned).collect();
    assert_eq!(there, known);
}
