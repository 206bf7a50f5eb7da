//! A handle that was opened only, beside the one that drives the master: in another process, in the same process, and
//! while the daemon drives it.

use std::io::{BufRead, BufReader};
use std::process::{ChildStdout, Stdio};

use crate::daemon::{Bench, wait_for_line};
use crate::library::{here, program};

/// What the program prints up to its last line.
fn facts(lines: &mut BufReader<ChildStdout>) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    while all.last().is_none_or(|line| line != "end") {
        let mut line = String::new();
        assert!(lines.read_line(&mut line).expect("it is text") > 0, "it has ended after {all:#?}");
        all.push(line.trim_end().to_owned());
    }
    all
}

/// The lines that depend on the states of the SubDevices, and the others.
fn parted(lines: Vec<String>) -> (Vec<String>, Vec<String>) {
    lines.into_iter().partition(|line| line.starts_with("state"))
}

// covers: c-interface, daemon
#[test]
fn an_opened_master_answers_beside_the_process_that_drives_it() {
    let Some(beside) = program(&here().join("tests/c/beside.c"), &[]) else { return };
    let bench = Bench::start(&here().join("tests/c/services.toml"), "beside");
    let ask = || {
        let output = bench.command(&beside).arg("ask").output().expect("it runs");
        let (said, reported) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert!(output.status.success(), "{said}\n{reported}");
        parted(said.lines().map(str::to_owned).collect())
    };
    let (idle_states, idle) = ask();
    let mut driver = bench.command(&beside).arg("drive").stdin(Stdio::piped()).spawn().expect("it runs");
    let mut lines = wait_for_line(&mut driver, "op");
    let (own_states, own) = parted(facts(&mut lines));
    let (states, other) = ask();
    drop(driver.stdin.take());
    let mut last = String::new();
    lines.read_line(&mut last).expect("it is text");
    assert_eq!(last, "still operational: 1\n");
    assert!(driver.wait().expect("it ends").success());
    bench.wait_for_preop();
    assert_eq!(ask(), (idle_states.clone(), idle.clone()));
    check_idle(&idle_states, &idle);
    assert_eq!(other, idle, "asked by another process");
    assert_eq!(own, idle, "asked by the process that drives it");
    let in_op = ["state all 0x0a", "state of 2: 8", "state request: NULL", "state reserve: -16"];
    for states in [&states, &own_states] {
        assert!(in_op.iter().all(|wanted| states.iter().any(|line| line == wanted)), "{states:#?}");
    }
}

fn check_idle(states: &[String], facts: &[String]) {
    for wanted in ["state all 0x02", "state of 2: 2", "state request: pointer", "state reserve: -16"] {
        assert!(states.iter().any(|line| line == wanted), "{wanted}\n{states:#?}");
    }
    for wanted in [
        "master 0: 5 slaves, up 1, busy 0",
        "progress 0: 5 of 5",
        "all 0: 5, up 1",
        "link 0: 5, up 1",
        "no link -22",
        "beyond: -22 -22",
        "download: 0",
        "upload: 0, 2, 0x1234",
        "short: -75",
        "abort: -5, 0x06020000",
        "complete: -5, 0x06020000",
        "no mailbox: -93",
        "no slave: -22",
        "no data: -22",
        "write idn: 0",
        "read idn: 0, 2, 0x1234",
        "no drive: -22",
        "no idn: -5, 0x1001",
        "domain: NULL",
        "config: NULL",
        "activate: -1, deactivate: -1",
        "send: -1, receive: -1, time: -1",
        "reset: -1, interval: -1",
    ] {
        assert!(facts.iter().any(|line| line == wanted), "{wanted}\n{facts:#?}");
    }
    let drive = facts.iter().find(|line| line.starts_with("slave 2: ")).expect("the drive");
    assert!(!drive.contains(", 0 objects"), "{drive}");
    assert!(facts.iter().any(|line| line.starts_with("  PDO 0x") && line.contains("0x6041:0/16")), "{facts:#?}");
}
