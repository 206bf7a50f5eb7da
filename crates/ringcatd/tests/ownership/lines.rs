//! Lines of the daemon for the operator: on its standard error, and in the journal.

use std::ffi::OsString;
use std::io::Write;
use std::os::unix::net::UnixDatagram;
use std::time::{Duration, Instant};

use ringcat::daemon::Query;
use ringcat_control::message::ToolQuery;

use crate::bench::{LONG, directory, turn};
use crate::owner_process::{OwnerProcess, Work};
use crate::running::{Running, Start, wait_for};

fn has(lines: &[String], wanted: &str) -> bool {
    lines.iter().any(|line| line == wanted)
}

fn set_debug_level(running: &Running, level: u32) {
    let ask = Query::Tool(ToolQuery::SetDebugLevel { level });
    running.client().ask(0, ask, Vec::new()).expect("it is set");
}

fn is_frame(line: &str) -> bool {
    line.starts_with("EtherCAT: MAIN ") || line.starts_with("EtherCAT: REDUNDANT ")
}

// covers: daemon
#[test]
fn the_daemon_prints_link_scan_and_states_while_it_drives_then_changes_only() {
    let running = Running::start(&[3, 2]);
    wait_for(&mut running.client(), 0, 3);
    wait_for(&mut running.client(), 1, 2);
    for (prefix, count) in [("EtherCAT: ", 3), ("EtherCAT: master 1: ", 2)] {
        let wanted = ["Link state changed to UP.", "Scanning bus.", "Slave states: PREOP."].map(str::to_owned);
        for wanted in wanted.into_iter().chain([format!("Slave(s) responding: {count}.")]) {
            running.wait_for_lines(|lines| has(lines, &format!("{prefix}{wanted}")));
        }
        let begin = format!("{prefix}Bus scanning completed in ");
        running.wait_for_lines(|lines| lines.iter().any(|line| line.starts_with(&begin) && line.ends_with(" ms.")));
    }
    let begin = running.lines().len();
    let mut owner = OwnerProcess::start(&running.socket, Work::Cycle);
    owner.child.kill().expect("it runs");
    owner.child.wait().expect("it has ended");
    running.wait_for_lines(|lines| lines[begin..].iter().any(|line| line.contains("driven by ringcatd again")));
    wait_for(&mut running.client(), 0, 3);
    std::thread::sleep(Duration::from_millis(300));
    let after = running.lines()[begin..].to_vec();
    let unchanged =
        ["EtherCAT: Scanning bus.", "EtherCAT: Slave(s) responding: 3.", "EtherCAT: Link state changed to UP."];
    assert!(unchanged.iter().all(|line| !has(&after, line)), "they are as they were: {after:#?}");
}

/// Lines of the acyclic half that are there without a debug level.
const USUAL: [&str; 5] = ["Slave", "Bus", "Scanning", "Link", "WARNING"];

/// A step of a procedure.
fn is_step(line: &str) -> bool {
    let text = line.strip_prefix("EtherCAT: ");
    text.is_some_and(|text| !is_frame(line) && !USUAL.iter().any(|usual| text.starts_with(usual)))
}

/// Leads a SubDevice to INIT and back. Where the lines end that have come by then, of those from there on.
fn change(running: &Running, from: usize) -> usize {
    let mut at = from;
    for (state, expected) in [(1, "EtherCAT: Slave states: INIT, PREOP."), (2, "EtherCAT: Slave states: PREOP.")] {
        running.client().ask(0, Query::RequestState { position: 0, state }, Vec::new()).expect("it reaches it");
        running.wait_for_lines(|lines| has(&lines[at..], expected));
        at += 1 + running.lines()[at..].iter().position(|line| line == expected).expect("it has come");
    }
    at
}

/// Lines of a SubDevice that goes to INIT and back. Lines come in their order: behind those of one change there is
/// nothing from before it.
fn of_a_change(running: &Running) -> Vec<String> {
    let before = change(running, running.lines().len());
    let end = change(running, before);
    running.lines()[before..end].to_vec()
}

// covers: daemon
#[test]
fn a_debug_level_shows_steps_and_frames_and_outlasts_owners() {
    let running = Running::start(&[3]);
    wait_for(&mut running.client(), 0, 3);
    assert!(!of_a_change(&running).iter().any(|line| is_step(line) || is_frame(line)), "{:#?}", running.lines());
    set_debug_level(&running, 2);
    running.wait_for_lines(|lines| lines.iter().any(|line| is_frame(line)));
    // What drives the master has the level, too, and so has the daemon afterwards.
    let before = running.lines().len();
    assert_eq!(OwnerProcess::start(&running.socket, Work::Hold).end_with_level(), "debug level 2");
    running.wait_for_lines(|lines| {
        let again = lines[before..].iter().position(|line| line.contains("driven by ringcatd again"));
        again.is_some_and(|at| lines[before + at..].iter().any(|line| is_frame(line)))
    });
    set_debug_level(&running, 1);
    let lines = of_a_change(&running);
    assert!(!lines.iter().any(|line| is_frame(line)), "{lines:#?}");
    assert!(lines.iter().filter(|line| is_step(line)).count() > 3, "{lines:#?}");
    // An owner gets the level while it drives, and it is kept.
    let owner = OwnerProcess::start(&running.socket, Work::Hold);
    set_debug_level(&running, 0);
    assert_eq!(owner.end_with_level(), "debug level 0");
    wait_for(&mut running.client(), 0, 3);
    let lines = of_a_change(&running);
    assert!(!lines.iter().any(|line| is_step(line) || is_frame(line)), "{lines:#?}");
}

// covers: daemon
#[test]
fn the_journal_gets_each_line_with_its_priority_where_there_is_one() {
    let (directory, turn) = (directory(), turn());
    let path = directory.join("journal");
    let journal = UnixDatagram::bind(&path).expect("it is free");
    journal.set_read_timeout(Some(LONG)).expect("a socket");
    let variables = [("RINGCAT_JOURNAL", OsString::from(&path))];
    let running = Running::at(&Start { counts: &[2], variables: &variables, ..Start::default() }, directory, turn);
    let wanted = "PRIORITY=6\nSYSLOG_IDENTIFIER=ringcatd\nMESSAGE=EtherCAT: Slave(s) responding: 2.\n";
    let mut all = Vec::new();
    while all.last().is_none_or(|last| last != wanted) {
        let mut bytes = vec![0; 8192];
        let length = journal.recv(&mut bytes).unwrap_or_else(|error| panic!("{error}: {all:#?}"));
        all.push(String::from_utf8_lossy(&bytes[..length]).into_owned());
    }
    running.wait_for_lines(|lines| has(lines, "EtherCAT: Slave(s) responding: 2."));
}

// covers: daemon
#[test]
fn a_daemon_whose_standard_error_nothing_reads_hands_over_and_takes_back() {
    let (reader, mut writer) = std::io::pipe().expect("a pipe");
    let full = writer.try_clone().expect("a descriptor");
    // More than a pipe holds: the thread waits until the end of the test.
    std::thread::spawn(move || (0..64).take_while(|_| writer.write_all(&[b'x'; 65_536]).is_ok()).count());
    std::thread::sleep(Duration::from_millis(100));
    let options = ["--stop-limit", "200"];
    let running = Running::unread(&Start { counts: &[3], options: &options, ..Start::default() }, full);
    wait_for(&mut running.client(), 0, 3);
    set_debug_level(&running, 2);
    let begin = Instant::now();
    for _ in 0..5 {
        let owner = OwnerProcess::start(&running.socket, Work::Cycle);
        assert_eq!(owner.end(), "ended: Ok(()), Held");
        wait_for(&mut running.client(), 0, 3);
    }
    println!("5 hand-overs beside a full standard error took {:?}", begin.elapsed());
    drop(reader);
}
