//! Functions for a real-time thread: they neither allocate nor wait, and make system calls only for frames.

use std::collections::BTreeSet;
use std::process::{Command, Output};

use crate::daemon::Bench;
use crate::library::{here, on_segment, program, root, workshop};

/// System calls that send and receive frames.
const OF_FRAMES: [&str; 8] = ["read", "readv", "recvfrom", "recvmsg", "sendto", "sendmsg", "write", "writev"];

/// The functions that docs/ecrt.md names as fit for real-time threads.
fn listed() -> BTreeSet<String> {
    let page = std::fs::read_to_string(root().join("docs/ecrt.md")).expect("docs/ecrt.md");
    let (_, section) = page.split_once("\n## Real-time threads\n").expect("the section");
    let section = section.split("\n## ").next().expect("it has an end");
    let rows = section.lines().filter(|line| line.starts_with("| "));
    rows.flat_map(|row| row.split('`')).filter(|word| word.starts_with("ecrt_")).map(str::to_owned).collect()
}

fn check(said: &str) {
    for none in ["allocations 0", "locks 0"] {
        assert!(said.lines().any(|line| line == none), "{none}: {said}");
    }
    let called: BTreeSet<String> =
        said.lines().filter_map(|line| line.strip_prefix("function ")).map(str::to_owned).collect();
    assert_eq!(called, listed(), "functions that the program calls, and those that docs/ecrt.md lists");
}

// covers: c-interface, no-allocation
#[test]
fn real_time_functions_allocate_nothing_and_a_second_caller_is_refused() {
    let Some(realtime) = program(&here().join("tests/c/realtime.c"), &[]) else { return };
    let (output, ended) = on_segment(&realtime, &here().join("tests/c/services.toml"), &["own"]);
    assert_eq!(ended, Ok(()), "{output}");
    check(&output);
}

/// The system calls of the measured cycles, each with the part of the cycle.
fn calls(trace: &str) -> Vec<(&str, &str)> {
    let (mut part, mut calls) = ("pause", Vec::new());
    for line in trace.lines() {
        match line.strip_prefix("write(-1, \"").and_then(|rest| rest.split('"').next()) {
            Some(begins) => part = begins,
            None => calls.push((part, line.split('(').next().unwrap_or(line))),
        }
    }
    calls
}

/// Receive and send included: the segment is in another process here.
// covers: c-interface, daemon, no-allocation
#[test]
fn real_time_functions_make_system_calls_only_for_frames() {
    let Some(realtime) = program(&here().join("tests/c/realtime.c"), &[]) else { return };
    let bench = Bench::start(&here().join("tests/c/services.toml"), "realtime");
    let trace = workshop().join("realtime.strace");
    let has_strace = Command::new("strace").arg("-V").output().is_ok();
    let mut command = bench.command(if has_strace { "strace".as_ref() } else { &realtime });
    if has_strace {
        // Only the thread of the cycles.
        command.arg("-o").arg(&trace).arg(&realtime);
    }
    let Output { status, stdout, stderr } = command.arg("daemon").output().expect("it runs");
    let (said, reported) = (String::from_utf8_lossy(&stdout), String::from_utf8_lossy(&stderr));
    if !has_strace || reported.contains("PTRACE_") {
        println!("skipped: system calls, for strace is not there or not permitted: {reported}");
        return;
    }
    assert!(status.success(), "{said}\n{reported}");
    check(&said);
    let trace = std::fs::read_to_string(trace).expect("strace has written it");
    let all = calls(&trace);
    let of = |wanted: &str| -> Vec<&str> { all.iter().filter(|(part, _)| *part == wanted).map(|it| it.1).collect() };
    let (counted, frames) = (of("counted"), of("frames"));
    assert_eq!(counted, [""; 0]);
    let others: BTreeSet<&&str> = frames.iter().filter(|call| !OF_FRAMES.contains(call)).collect();
    assert!(others.is_empty() && frames.len() >= 1000, "{others:?}, {} calls", frames.len());
    println!("{} system calls for frames in 500 cycles", frames.len());
    bench.wait_for_preop();
}
