//! Questions of clients: to the daemon, and through it to the application that drives the bus.

use std::os::unix::process::CommandExt;
use std::process::Command;
use std::time::{Duration, Instant};

use ringcat::daemon::{Answer, Client, ClientError, Query, Right};
use ringcat::{Activity, AlState};
use ringcat_control::Refusal;
use ringcat_control::tool::{ToolAnswer, ToolQuery};

use crate::bench::{Bench, ask, check_bar, copy_program};
use crate::owner_process::{OwnerProcess, Work};

/// Position of a drive, with a mailbox.
const DRIVE: u16 = 3;
/// Vendor in the identity object.
const VENDOR: Query = Query::SdoUpload { position: DRIVE, index: 0x1018, sub_index: Some(1) };

/// All questions that read, with the same answers whatever drives the bus.
fn read_all(client: &mut Client, al_state: u16) -> Vec<Vec<u8>> {
    let Answer::State(state) = ask(client, Query::State) else { panic!("it is a state") };
    assert_eq!(state.subdevices.len(), 4);
    let expected = if al_state == 8 { Activity::Active } else { Activity::Scanned };
    assert_eq!(state.activity, expected);
    let Answer::Events { next, events, .. } = ask(client, Query::Events { from: 0 }) else { panic!("they are events") };
    assert!(next > 0 && !events.is_empty() && events.iter().all(|event| !event.text.is_empty()));
    assert_eq!(ask(client, Query::AlStatus { position: DRIVE }), Answer::AlStatus { status: al_state, code: 0 });
    let registers = Query::RegisterRead { position: DRIVE, address: 0x0130, length: 2 };
    let images = Query::Tool(ToolQuery::SiiImages { positions: vec![0] });
    let data = [VENDOR, registers, images].map(|what| client.ask(0, what, Vec::new()).expect("it is read"));
    assert!(data[..2].iter().all(|(answer, bytes)| *answer == Answer::Data && !bytes.is_empty()));
    assert!(matches!(&data[2].0, Answer::Tool(ToolAnswer::SiiImages(_))) && data[2].1.len() >= 128);
    assert_eq!(data[1].1, [al_state as u8, 0]);
    data.into_iter().map(|(_, bytes)| bytes).collect()
}

// covers: daemon
#[test]
fn questions_have_the_same_answers_whichever_process_drives_the_bus() {
    let bench = Bench::start(4);
    let mut client = bench.client();
    assert_eq!(client.right(), Right::Change);
    let idle = read_all(&mut client, 2);
    let owner = OwnerProcess::start(&bench.socket, Work::Patient);
    let active = read_all(&mut client, 8);
    assert_eq!((&idle[0], &idle[2]), (&active[0], &active[2]));
    let Answer::Masters(masters) = ask(&mut client, Query::Masters) else { panic!("they are masters") };
    let by = masters[0].owner.as_ref().expect("an application drives it");
    assert_eq!((by.pid, by.program.as_str()), (owner.child.id(), "application"));
    owner.end();
    bench.wait_until("all in PREOP", |bench| bench.are_in(AlState::PreOp));
    bench.wait_until_scanned(4);
    assert_eq!(read_all(&mut client, 2), idle);
}

// covers: daemon
#[test]
fn changes_arrive_in_the_subdevice_and_wrong_questions_have_one_sentence() {
    let bench = Bench::start(4);
    let mut client = bench.client();
    let state = Query::RequestState { position: 1, state: AlState::SafeOp.code() };
    assert_eq!(ask(&mut client, state), Answer::Done);
    assert_eq!(bench.states()[1].al_state(), Some(AlState::SafeOp));
    let write = Query::RegisterWrite { position: 0, address: 0x0400 };
    client.ask(0, write.clone(), vec![0xC2, 0x09]).expect("it is written");
    let read = Query::RegisterRead { position: 0, address: 0x0400, length: 2 };
    assert_eq!(client.ask(0, read, Vec::new()).expect("it is read").1, [0xC2, 0x09]);
    assert_eq!(ask(&mut client, Query::Rescan), Answer::Done);
    let mut refused = |master, what: Query, bytes: Vec<u8>| match client.ask(master, what, bytes) {
        Err(ClientError::Refused(refusal)) => refusal.to_string(),
        other => panic!("{other:?}"),
    };
    assert_eq!(refused(5, Query::State, Vec::new()), "there is no master 5; there are: 0");
    let long = Query::RegisterRead { position: 0, address: 0, length: 1025 };
    assert_eq!(refused(0, long, Vec::new()), "expected 1 to 1024 bytes of registers, not 1025");
    assert_eq!(refused(0, write, Vec::new()), "expected 1 to 1024 bytes of registers, not 0");
    let none = Query::RequestState { position: 0, state: 7 };
    assert_eq!(refused(0, none, Vec::new()), "expected a state: 1, 2, 3, 4 or 8");
    let beyond = refused(0, Query::AlStatus { position: 4 }, Vec::new());
    assert!(beyond.contains('4'), "{beyond}");
}

// covers: daemon
#[test]
fn an_application_that_does_not_answer_is_named_within_a_second() {
    let bench = Bench::with_limit(4, Duration::from_secs(60));
    let owner = OwnerProcess::start(&bench.socket, Work::Hold);
    owner.signal("-STOP");
    let mut client = bench.client();
    let begin = Instant::now();
    let Err(ClientError::Refused(refusal)) = client.ask(0, VENDOR, Vec::new()) else { panic!("it is stopped") };
    let took = begin.elapsed();
    assert!(took >= Duration::from_secs(1), "{took:?}");
    check_bar("until it is named", took, Duration::from_millis(1500));
    let Refusal::Silent { owner: named, .. } = refusal else { panic!("{refusal}") };
    assert_eq!(named.pid, owner.child.id());
    owner.signal("-CONT");
    assert_eq!(client.ask(0, VENDOR, Vec::new()).expect("it goes on").0, Answer::Data);
}

/// Clients, and their questions in a second.
const CLIENTS: u64 = 50;
const RATE: u64 = 100;

// covers: daemon
#[test]
fn fifty_clients_at_100_hz_are_answered_beside_an_application_in_op() {
    let bench = Bench::start(4);
    let mut owner = OwnerProcess::start(&bench.socket, Work::Patient);
    let begin = Instant::now();
    let ask_often = |number: u64| {
        let mut client = Client::connect(&bench.socket, "often").expect("there is room");
        let mut refused = 0_u64;
        for round in 0..2 * RATE {
            let at = Duration::from_micros((round * CLIENTS + number) * 1_000_000 / (RATE * CLIENTS));
            std::thread::sleep(at.saturating_sub(begin.elapsed()));
            match client.ask(0, Query::AlStatus { position: (round % 4) as u16 }, Vec::new()) {
                Ok((answer, _)) => assert_eq!(answer, Answer::AlStatus { status: 8, code: 0 }),
                // The owner has had the maximum number of pending queries for a second.
                Err(ClientError::Refused(Refusal::TooManyQueries { .. })) => refused += 1,
                Err(error) => panic!("{error}"),
            }
        }
        refused
    };
    let refused: u64 = std::thread::scope(|scope| {
        let all: Vec<_> = (0..CLIENTS)
            .map(|number| {
                let ask_often = &ask_often;
                scope.spawn(move || ask_often(number))
            })
            .collect();
        all.into_iter().map(|one| one.join().expect("no panic")).sum()
    });
    let (asked, took) = (CLIENTS * 2 * RATE, begin.elapsed());
    println!("{asked} questions of {CLIENTS} clients in {took:?}, {refused} refused");
    assert!(bench.are_in(AlState::Op), "{:?}", bench.states());
    assert_eq!(refused, 0, "of {asked}");
    owner.input_ends();
    println!("{}", owner.wait_for("cycles: "));
    assert_eq!(owner.wait_for("ended"), "ended: Ok(()), Held");
}

/// Socket for the process of another user.
const SOCKET: &str = "RINGCAT_TEST_READER";

// covers: daemon
#[test]
fn another_user_may_read_and_changes_nothing() {
    if let Ok(socket) = std::env::var(SOCKET) {
        let mut client = Client::connect(socket.as_ref(), "reader").expect("the daemon listens");
        assert_eq!(client.right(), Right::Read);
        assert!(matches!(ask(&mut client, Query::State), Answer::State(_)));
        assert!(matches!(client.ask(0, VENDOR, Vec::new()), Ok((Answer::Data, _))));
        for change in [Query::Rescan, Query::RequestState { position: 0, state: 1 }] {
            let refused = client.ask(0, change, Vec::new());
            assert!(matches!(refused, Err(ClientError::Refused(Refusal::ReadOnly))), "{refused:?}");
        }
        let options = ringcat::Options::default();
        let taken = ringcat::daemon::OwnedBus::take(socket.as_ref(), 0, "reader", &options, || ());
        assert!(taken.expect_err("it may not").to_string().contains("may read only"));
        return;
    }
    if ringcat_link::process::effective_user() != 0 {
        println!("skipped: only root starts a process of another user");
        return;
    }
    let bench = Bench::start(4);
    let copy = bench.socket.with_file_name("test");
    copy_program(std::env::current_exe().expect("it is known"), &copy);
    let mut reader = Command::new(&copy);
    reader.args(["--exact", "clients::another_user_may_read_and_changes_nothing", "--nocapture"]);
    let reader = reader.env(SOCKET, &bench.socket).current_dir("/").uid(65_534).gid(65_534).output();
    let output = reader.expect("it starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(bench.are_in(AlState::PreOp));
}
