//! Lines of the library for the operator: the journal gets them, and no call waits for a reader.

use std::io::Write;
use std::os::unix::net::UnixDatagram;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::library::{program, root, workshop};

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
    std::thread::sleep(Duration::from_millis(100));
    let begin = Instant::now();
    let mut command = Command::new("timeout");
    command.arg("30").arg(first).arg(CYCLES).env("RINGCAT_SIM", examples.join("first_application.toml"));
    let output = command.stdout(Stdio::piped()).stderr(Stdio::from(full)).output().expect("it runs");
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{:?} after {:?}\n{said}", output.status, begin.elapsed());
    assert!(said.lines().any(|line| line == "AnaIn: operational."), "{said}");
    drop(reader);
}

// covers: c-interface
#[test]
fn the_journal_gets_the_lines_of_a_program_with_its_name() {
    let examples = root().join("examples/c");
    let Some(first) = program(&examples.join("first_application.c"), &[]) else { return };
    let path = workshop().join(format!("journal-{}", std::process::id()));
    let journal = UnixDatagram::bind(&path).expect("it is free");
    // It holds some lines only; it is read as they come, until none has for a while.
    let reader = std::thread::spawn(move || {
        let (mut all, mut bytes) = (Vec::new(), vec![0; 8192]);
        journal.set_read_timeout(Some(Duration::from_secs(5))).expect("a socket");
        while let Ok(length) = journal.recv(&mut bytes) {
            all.push(String::from_utf8_lossy(&bytes[..length]).into_owned());
        }
        all
    });
    let mut command = Command::new("timeout");
    command.arg("30").arg(&first).arg(CYCLES).env("RINGCAT_SIM", examples.join("first_application.toml"));
    let output = command.env("RINGCAT_JOURNAL", &path).output().expect("it runs");
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
