//! Clients that do harm: the daemon goes on, and so does the application that drives the bus.

use std::io::{Read, Write};
use std::os::fd::AsRawFd;
use std::os::unix::net::UnixStream;
use std::time::{Duration, Instant};

use ringcat::AlState;
use ringcat::daemon::{Answer, Query};
use ringcat_control::{Connection, Content, Limits, Message, Numbered, Refusal};
use ringcat_link::descriptors;
use ringcatd::listening::MOST_CLIENTS;

use crate::bench::{Bench, LONG, ask, check_bar};
use crate::owner_process::{OwnerProcess, Work};

/// A question is answered within this time, whatever other clients do.
const SOON: Duration = Duration::from_secs(1);

fn is_answered(bench: &Bench) {
    let begin = Instant::now();
    assert!(matches!(ask(&mut bench.client(), Query::State), Answer::State(_)));
    check_bar("answer beside hostile clients", begin.elapsed(), SOON);
}

/// What a hostile client sends.
fn attacks() -> Vec<Vec<u8>> {
    let hello = ringcat_control::wire::encode(&Content::Hello { program: "x".repeat(3000) }.into()).expect("short");
    let beginning = hello[..8].to_vec();
    let mut header = beginning.clone();
    header.extend([0xFF; 8]);
    let mut deep = hello.clone();
    deep.extend([&beginning[..], b"\xA0\x0F\0\0\0\0\0\0"].concat());
    deep.extend([0x81; 4000]);
    let take = ringcat_control::wire::encode(&Content::Take { master: 0, ethernet: true }.into()).expect("short");
    let answer = Content::Answer(Numbered { id: 1, master: 0, what: Ok(Answer::Done) });
    let answer = ringcat_control::wire::encode(&answer.into()).expect("short");
    vec![
        b"GET / HTTP/1.1\r\n\r\n".to_vec(),
        vec![0; 100_000],
        vec![0xFF; 100_000],
        header,
        deep,
        hello[..7].to_vec(),
        take,
        [hello.clone(), answer].concat(),
        [hello.clone(), hello].concat(),
        b"RCTL\x01\0\0\0\x01\0\0\0\0\0\0\0".to_vec(),
    ]
}

// covers: daemon
#[test]
fn any_bytes_cost_a_client_its_connection_and_nothing_else() {
    let bench = Bench::start(3);
    let owner = OwnerProcess::start(&bench.socket, Work::Patient);
    for attack in attacks() {
        let mut client = UnixStream::connect(&bench.socket).expect("the daemon listens");
        // The daemon may close the connection before all is written.
        let _ = client.write_all(&attack);
        let _ = client.shutdown(std::net::Shutdown::Write);
        client.set_read_timeout(Some(LONG)).expect("a socket");
        let mut said = Vec::new();
        // A connection that is reset has nothing more to say.
        let _ = client.read_to_end(&mut said);
        assert!(said.len() < 4096, "{} bytes", said.len());
        is_answered(&bench);
    }
    assert!(bench.are_in(AlState::Op), "the application goes on");
    assert_eq!(owner.end(), "ended: Ok(()), Held");
}

// covers: daemon
#[test]
fn clients_that_neither_speak_nor_read_keep_only_their_own_places() {
    let bench = Bench::start(3);
    let mut silent = Vec::new();
    for number in 0..MOST_CLIENTS - 2 {
        let client = UnixStream::connect(&bench.socket).expect("the daemon listens");
        let connection = Connection::new(client).expect("a socket");
        if number % 2 == 0 {
            connection.send(&Content::Hello { program: "deaf".to_owned() }.into()).expect("it is read");
            let state = Content::Query(Numbered { id: 1, master: 0, what: Query::State });
            (0..100).for_each(|_| drop(connection.send(&state.clone().into())));
        }
        silent.push(connection);
    }
    is_answered(&bench);
    for _ in 0..4 {
        silent.push(Connection::new(UnixStream::connect(&bench.socket).expect("it listens")).expect("a socket"));
    }
    let last = silent.last().expect("there are some");
    let message = last.receive(Limits::OWNER, Some(LONG)).expect("the daemon says why");
    assert_eq!(message, Message::from(Content::Refused(Refusal::TooManyClients { limit: MOST_CLIENTS })));
    drop(silent);
    bench.wait_until("places are free", |bench| ringcat::daemon::Client::connect(&bench.socket, "next").is_ok());
    is_answered(&bench);
}

// covers: daemon
#[test]
fn descriptors_of_a_client_are_closed() {
    let bench = Bench::start(2);
    let open = || std::fs::read_dir("/proc/self/fd").expect("it is there").count();
    let (near, far) = UnixStream::pair().expect("a pair");
    let hello = Content::Hello { program: "generous".to_owned() }.into();
    for _ in 0..20 {
        let client = Connection::new(UnixStream::connect(&bench.socket).expect("it listens")).expect("a socket");
        client.send_with(&hello, &[far.as_raw_fd(); descriptors::MOST]).expect("it is read");
        client.receive(Limits::OWNER, Some(SOON)).expect("it is greeted");
    }
    is_answered(&bench);
    drop(far);
    // The end is seen only when no duplicate is left in this process, in which the daemon is, too.
    near.set_read_timeout(Some(LONG)).expect("a socket");
    assert_eq!((&near).read(&mut [0]).expect("the end"), 0, "{} descriptors", open());
}
