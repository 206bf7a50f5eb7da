//! Lines of the library for the operator: the journal gets them, and no call waits for a reader.

use std::io::Write;
use std::os::unix::net::UnixDatagram;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::library::{interrupted_after, program, root, workshop};

/// Interval of checks for the end of a program while its lines are read.
const LOOK: Duration = Duration::from_millis(50);

/// Cycles of 1 ms of the program.
const CYCLES: &str = "1500";

// covers: c-interface
#[test]
fn a_program_whose_standard_error_nothing_reads_runs_and_releases_its_master() {
    let examples = root().join("examples/c");
    let Some(first) = program(&examples.join("first_application.c"), &[]) else { return };
    let (reader, mut writer) = std::io::pipe().expect("a pipe");
    let full = writer.try_clone().expect("a descriptor");
    // More than a pipe holds: the thread waits until the end of the test.
    std::thread::spawn(move || (0..64).take_while(|_| writer.write_all(&[b'x'; 65_536]).is_ok()).count());
    let mut command = Command::new(first);
    command.env("RINGCAT_SIM", examples.join("first_application.toml")).stderr(Stdio::from(full));
    let (said, _, status) = interrupted_after(&mut command, &["AnaIn: operational."]);
    assert!(status.success(), "{status:?}\n{said}");
    drop(reader);
}

// covers: c-interface
#[test]
fn the_journal_gets_the_lines_of_a_program_with_its_name() {
    let examples = root().join("examples/c");
    let Some(first) = program(&examples.join("first_application.c"), &[]) else { return };
    let path = workshop().join(format!("journal-{}", std::process::id()));
    let journal = UnixDatagram::bind(&path).expect("it is free");
    // It holds some lines only: it is read as they come, until the program has ended and nothing is left.
    let has_ended = Arc::new(AtomicBool::new(false));
    let ended = has_ended.clone();
    let reader = std::thread::spawn(move || {
        let (mut all, mut bytes) = (Vec::new(), vec![0; 8192]);
        journal.set_read_timeout(Some(LOOK)).expect("a socket");
        loop {
            let is_last = ended.load(Ordering::Acquire);
            match journal.recv(&mut bytes) {
                Ok(length) => all.push(String::from_utf8_lossy(&bytes[..length]).into_owned()),
                Err(_) if is_last => return all,
                Err(_) => {}
            }
        }
    });
    let mut command = Command::new("timeout");
    command.arg("30").arg(&first).arg(CYCLES).env("RINGCAT_SIM", examples.join("first_application.toml"));
    let output = command.env("RINGCAT_JOURNAL", &path).output().expect("it runs");
    has_ended.store(true, Ordering::Release);
    assert!(output.status.success(), "{:?}", output.status);
    let all = reader.join().expect("no panic");
    std::fs::remove_file(&path).expect("it is there");
    let name = first.file_name().expect("it has a name").display();
    for line in ["Link state changed to UP.", "Scanning bus.", "Slave(s) responding: 5."] {
        let wanted = format!("PRIORITY=6\nSYSLOG_IDENTIFIER={name}\nMESSAGE=EtherCAT: {line}\n");
        assert!(all.contains(&wanted), "{wanted}\n{all:#?}");
    }
    let reported = String::from_utf8_lossy(&output.stderr);
    assert!(reported.lines().any(|line| line == "EtherCAT: Scanning bus."), "{reported}");
}
