//! A program whose bus the daemon takes back is reported.

use std::io::Read;
use std::process::{Command, Stdio};
use std::time::Duration;

use crate::daemon::{Bench, wait_for_line};
use crate::library::{here, program, workshop};

// covers: c-interface, daemon
#[test]
fn a_stopped_program_gets_the_loss_of_its_bus_and_requests_it_again() {
    let Some(stopped) = program(&here().join("tests/c/stopped.c"), &[]) else { return };
    let segment = workshop().join("stopped.toml");
    std::fs::write(&segment, "[segment]\n[[device]]\ntype = \"digital-output-8\"\n").expect("it can be written");
    let bench = Bench::start(&segment, "stopped");
    let mut child = bench.command(&stopped).stderr(Stdio::piped()).spawn().expect("it runs");
    let mut lines = wait_for_line(&mut child, "op");
    let pid = child.id().to_string();
    let signal = |name: &str| {
        let sent = Command::new("kill").args([name, &pid]).status();
        assert!(sent.is_ok_and(|status| status.success()));
    };
    let before = bench.connected_ns();
    signal("-STOP");
    let begin = std::time::Instant::now();
    while bench.connected_ns() == before {
        assert!(begin.elapsed() < Duration::from_secs(10), "the daemon takes it back");
        std::thread::sleep(Duration::from_millis(1));
    }
    bench.wait_for_preop();
    signal("-CONT");
    let mut said = String::new();
    lines.read_to_string(&mut said).expect("it is text");
    let output = child.wait_with_output().expect("it ends");
    let reported = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}\n{reported}");
    let expected = [
        "lost: -19",
        "cycle: -19 -19 -19 -19",
        "time: -19",
        "domain: 0, counter 0, state 0",
        "master: 0, link 0",
        "slave: -19",
        "activate: -19",
        "deactivate: 0, activate: -19, receive: 0",
        "op again",
    ];
    assert_eq!(said.lines().collect::<Vec<_>>(), expected, "{reported}");
    let loss = "EtherCAT: The master was taken back by ringcatd: its process was stopped.";
    assert_eq!(reported.lines().filter(|line| line.starts_with(loss)).count(), 1, "{reported}");
    bench.wait_for_preop();
}
