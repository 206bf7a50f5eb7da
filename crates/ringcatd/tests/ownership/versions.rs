//! A daemon and a library of different releases: each reports it to the other in one sentence, and nothing is driven.

use std::io::Write;
use std::os::unix::net::{UnixListener, UnixStream};
use std::time::Duration;

use ringcat::AlState;
use ringcat::daemon::{Client, OwnedBus};
use ringcat_control::wire::{VERSION, encode};
use ringcat_control::{Connection, Content, Limits, Refusal};

use crate::bench::{Bench, directory, turn};

/// A greeting of another version, with a content unknown to this one.
fn greeting(version: u16) -> Vec<u8> {
    let mut bytes = encode(&Content::Hello { program: "another".to_owned() }.into()).expect("it is short");
    bytes[4..6].copy_from_slice(&version.to_le_bytes());
    bytes[16..].fill(0xFF);
    bytes
}

// covers: daemon
#[test]
fn a_daemon_reports_its_version_to_libraries_of_other_versions() {
    let bench = Bench::start(2);
    for there in [VERSION - 1, VERSION + 1, u16::MAX] {
        let mut stream = UnixStream::connect(&bench.socket).expect("the daemon listens");
        stream.write_all(&greeting(there)).expect("it reads");
        let connection = Connection::new(stream).expect("a socket");
        let said = connection.receive(Limits::OWNER, Some(Duration::from_secs(10))).expect("it answers").content;
        assert_eq!(said, Content::Refused(Refusal::Version { here: VERSION, there }));
        assert!(connection.receive(Limits::OWNER, Some(Duration::from_secs(10))).is_err(), "it closes the connection");
    }
    assert!(bench.are_in(AlState::PreOp));
    bench.take().release().expect("the daemon drives it");
}

// covers: daemon
#[test]
fn a_library_reports_another_version_of_the_daemon_and_opens_nothing_itself() {
    let _turn = turn();
    let directory = directory();
    let socket = directory.join("socket");
    let listener = UnixListener::bind(&socket).expect("it can be made");
    let daemon = std::thread::spawn(move || {
        for _ in 0..2 {
            let (mut stream, _) = listener.accept().expect("a client comes");
            stream.write_all(&greeting(VERSION + 1)).expect("it reads");
            // It is open until the client has read.
            let connection = Connection::new(stream).expect("a socket");
            let _ = connection.receive(Limits::CLIENT, Some(Duration::from_secs(10)));
            let _ = connection.receive(Limits::CLIENT, Some(Duration::from_secs(10)));
        }
    });
    let expected = format!("expected control version {VERSION}, got {}: install ringcatd and library", VERSION + 1);
    let asked = Client::connect(&socket, "test").expect_err("it is refused").to_string();
    assert!(asked.contains(&expected), "{asked}");
    let taken = OwnedBus::take(&socket, 0, "test", &ringcat::Options::default(), || ()).expect_err("it is refused");
    assert!(taken.to_string().contains(&expected) && !taken.is_no_daemon(), "{taken}");
    daemon.join().expect("no panic");
    std::fs::remove_dir_all(directory).expect("it is there");
}
