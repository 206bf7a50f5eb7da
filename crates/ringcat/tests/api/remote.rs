//! Remote access over TCP to two MainDevices of the library, whose halves have threads of their own, in real time:
//! state of both, roles, permanent standby (protocol AC-08, REQ037); and hostile clients.

use std::io::{Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::ops::ControlFlow;
use std::time::{Duration, Instant as WallClock};

use ringcat::shared_segment::SharedSegment;
use ringcat::standby::remote::{
    RemoteClient, RemoteError, RemoteOptions, RemoteRole, RemoteServer, RemoteState, RemoteToken,
};
use ringcat::standby::{Policy, StandbyOptions};
use ringcat::{CyclicThread, Options, Scan, SupervisorThread, automatic};
use ringcat_control::remote::{RemoteAnswer, RemoteQuery, encode};
use ringcat_sim::cable::Host;
use ringcat_sim::device::Device;
use ringcat_sim::network::Network;
use ringcat_sim::network::builder::SegmentBuilder;

const CYCLE: Duration = Duration::from_millis(5);
/// Cycles of a time-out: a machine that is busy takes longer for a cycle.
const TIME_OUT: u32 = 200;
/// A machine that is busy reaches a state within this time.
const LIMIT: Duration = Duration::from_secs(20);

fn ring_of_two(kinds: &[&str]) -> Network {
    let device = |name: &&str| Device::new(ringcat_sim::catalogue::by_name(name).expect("the catalogue has it"));
    let devices = kinds.iter().map(device).collect();
    SegmentBuilder::ring_of_two(devices, Host::First).build().expect("the cables fit")
}

/// Queries of one client at once.
const QUERIES: u32 = 100;
/// A client may be idle for this time.
const SILENCE: Duration = Duration::from_secs(3);

const KINDS: [&str; 4] = ["coupler", "digital-output-8", "digital-input-8", "servo"];

fn token() -> RemoteToken {
    RemoteToken::new("a-token-of-the-test").expect("it is long enough")
}

fn serve(supervisor: &SupervisorThread, options: RemoteOptions) -> RemoteServer {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("loopback is there");
    RemoteServer::start(listener, token(), options, supervisor.clone()).expect("a thread starts")
}

fn client(server: &RemoteServer) -> RemoteClient {
    RemoteClient::connect(server.address(), &token(), LIMIT).unwrap_or_else(|error| panic!("{error}"))
}

fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let begin = WallClock::now();
    while !holds() {
        assert!(begin.elapsed() < LIMIT, "not within {LIMIT:?}: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Why it is not ready, besides watchdogs that are shorter than the time-out.
fn not_ready(state: &RemoteState) -> Vec<&str> {
    state.not_ready.iter().map(String::as_str).filter(|reason| *reason != "a watchdog is too short").collect()
}

/// A controller with its server, and a client.
struct Controller {
    cycles: CyclicThread<SharedSegment>,
    server: RemoteServer,
    client: RemoteClient,
}

impl Controller {
    fn join((cyclic, acyclic): (SharedSegment, SharedSegment)) -> Controller {
        let options = Options::default().with_standby(StandbyOptions::default().with_needs_guard(false));
        let supervisor = SupervisorThread::start(acyclic, &options, || ()).expect("a thread starts");
        // It answers before there is an application.
        let server = serve(&supervisor, RemoteOptions::default());
        let mut client = client(&server);
        let state = client.state().expect("it answers");
        assert!(!state.is_active && !state.has_application, "{state:?}");
        let policy = Policy::default().with_time_out(TIME_OUT, Duration::ZERO).with_listen(Duration::from_millis(300));
        let declare = |scan: &Scan| automatic(&scan.subdevices, CYCLE);
        let joined = supervisor.join(&policy, declare, cyclic);
        let application = joined.unwrap_or_else(|refused| panic!("{}", refused.error));
        let cycles = application.start_cycles(|| (), |_| ControlFlow::Continue(())).expect("a thread starts");
        Controller { cycles, server, client }
    }

    fn state(&mut self) -> RemoteState {
        self.client.state().expect("it answers")
    }
}

// covers: AC-08, REQ037, REQ015, standby, threads
#[test]
fn both_controllers_report_their_state_and_switch_roles_over_tcp() {
    let [first, second] = SharedSegment::halves_of_two(ring_of_two(&KINDS));
    let plant = first.0.plant();
    let switch = |host: Host, up: bool| {
        plant.with_network(|network| host.links().into_iter().for_each(|link| network.disconnect(link, !up)));
    };
    switch(Host::Second, false);
    let mut first = Controller::join(first);
    switch(Host::Second, true);
    let mut second = Controller::join(second);
    let in_op = |state: &RemoteState| state.subdevices.len() == 4 && state.subdevices.iter().all(|it| it == "OP");
    until("both are ready, all are in OP", || {
        let states = [first.state(), second.state()];
        states.iter().all(|state| not_ready(state).is_empty() && in_op(state))
    });
    // A machine that was too busy may have changed the roles already.
    let (mut first, mut second) = if first.state().is_active { (first, second) } else { (second, first) };
    let [active, inactive] = [first.state(), second.state()];
    assert!(active.is_active && !inactive.is_active, "{active:?}, {inactive:?}");
    assert!(active.counters.sent > 0 && active.of_active.is_none() && active.cycles > 0, "{active:?}");
    assert!(inactive.of_active.is_some_and(|of| of.sent > 0), "{inactive:?}");
    assert!(inactive.forwarded.iter().sum::<u64>() > 0, "{inactive:?}");

    // Notification 1: permanent standby; the other one takes over after its time-out, and cannot hand over.
    first.client.hold(true, false).expect("it is permitted");
    until("the second one has taken over", || second.state().is_active && !first.state().is_active);
    until("the second one knows", || not_ready(&second.state()) == ["held INACTIVE"]);
    assert!(first.state().is_held);
    second.client.request(RemoteRole::HandOver, false).expect("it is sent");
    std::thread::sleep(20 * CYCLE);
    assert!(second.state().is_active, "the role is not taken");
    // Notification 2: hot standby.
    first.client.hold(false, false).expect("it is permitted");
    until("both are ready again", || [first.state(), second.state()].iter().all(|state| not_ready(state).is_empty()));
    let mut looks = 0;
    until("the role is handed back", || {
        let [first, is_active] = [first.state().is_active, second.state().is_active];
        // A request is refused while the other one is late, as on a busy machine.
        if is_active && looks % 100 == 0 {
            second.client.request(RemoteRole::HandOver, false).expect("it is sent");
        }
        looks += 1;
        first && !is_active
    });
    until("all are in OP", || in_op(&first.state()) && in_op(&second.state()));
    drop((first.server, second.server));
    drop((first.cycles.end(), second.cycles.end()));
}

fn alone() -> SupervisorThread {
    let [(_, acyclic), _] = SharedSegment::halves_of_two(ring_of_two(&KINDS[..2]));
    let options = Options::default().with_standby(StandbyOptions::default());
    SupervisorThread::start(acyclic, &options, || ()).expect("a thread starts")
}

/// Whether the server ends a connection within a time.
fn is_ended(stream: &mut TcpStream, within: Duration) -> bool {
    stream.set_read_timeout(Some(within)).expect("it is a socket");
    let mut rest = Vec::new();
    // A reset ends it as well.
    !matches!(stream.read_to_end(&mut rest), Err(error) if matches!(
        error.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut))
}

// covers: AC-08, REQ037, standby
#[test]
fn a_client_without_the_token_gets_nothing_and_does_not_keep_others_out() {
    let supervisor = alone();
    let server = serve(&supervisor, RemoteOptions::default().with_clients(3));
    let mut admitted = client(&server);
    let wrong = RemoteToken::new("a-token-of-others-x").expect("it is long enough");
    let refused = RemoteClient::connect(server.address(), &wrong, LIMIT).expect_err("it is refused");
    assert!(matches!(&refused, RemoteError::Refused(why) if why == "another token"), "{refused}");
    // A query before the token.
    let mut stream = TcpStream::connect(server.address()).expect("it listens");
    let query = encode(&RemoteQuery::State).expect("it is short");
    stream.write_all(&query).expect("it takes it");
    assert!(is_ended(&mut stream, LIMIT));
    // More silent connections than there is room for: the next one with the token is admitted.
    let silent: Vec<TcpStream> = (0..20).map(|_| TcpStream::connect(server.address()).expect("it listens")).collect();
    std::thread::sleep(Duration::from_millis(100));
    let mut second = client(&server);
    assert!(second.state().is_ok() && admitted.state().is_ok());
    // They are disconnected, although they stay silent.
    let mut silent = silent;
    assert!(silent.iter_mut().all(|stream| is_ended(stream, LIMIT)));
    // Those with the token stay; a further one has no room.
    let _third = client(&server);
    assert!(RemoteClient::connect(server.address(), &token(), LIMIT).is_err());
    assert!(admitted.state().is_ok());
}

// covers: AC-08, REQ037, standby
#[test]
fn bytes_of_any_kind_cost_a_bounded_time_and_end_the_connection() {
    let supervisor = alone();
    let options = RemoteOptions::default().with_silence(SILENCE);
    let server = serve(&supervisor, options);
    let mut idle = client(&server);
    let asked = WallClock::now();
    assert!(idle.state().is_ok());
    let head = |length: u32| [b"RCRA", &[1, 0, 0, 0][..], &length.to_le_bytes()].concat();
    let hostile = [
        b"GET / HTTP/1.1\r\n\r\n".to_vec(),
        head(u32::MAX),
        [head(4), vec![0xFF; 4]].concat(),
        // CBOR nested without end.
        [head(1000), vec![0x81; 1000]].concat(),
        vec![0; 100_000],
        // The rest never comes.
        head(1000),
        b"RC".to_vec(),
    ];
    for bytes in hostile {
        let mut stream = TcpStream::connect(server.address()).expect("it listens");
        // It may end before all is there.
        let _ = stream.write_all(&bytes);
        assert!(is_ended(&mut stream, LIMIT), "{:02x?}", &bytes[..bytes.len().min(16)]);
    }
    // A client with many queries at once gets one answer in each cycle of the server, and others get theirs.
    let mut greedy = TcpStream::connect(server.address()).expect("it listens");
    let message = |query: RemoteQuery| encode(&query).expect("it is short");
    let hello = message(RemoteQuery::Hello { token: "a-token-of-the-test".to_owned() });
    let begin = WallClock::now();
    let queries = [hello, message(RemoteQuery::State).repeat(QUERIES as usize)].concat();
    greedy.write_all(&queries).expect("the buffers of the system take it");
    assert!(client(&server).state().is_ok());
    greedy.set_read_timeout(Some(LIMIT)).expect("it is a socket");
    let mut answers = Vec::new();
    greedy.read_to_end(&mut answers).expect("it is disconnected when it asks nothing any more");
    let count = answers.windows(4).filter(|bytes| *bytes == b"RCRA").count();
    assert_eq!(count, QUERIES as usize + 1, "the welcome, and each answer");
    let least = QUERIES * RemoteOptions::default().cycle + SILENCE;
    assert!(begin.elapsed() >= least, "more than one in a cycle: {:?} of {least:?}", begin.elapsed());
    std::thread::sleep((SILENCE + Duration::from_millis(500)).saturating_sub(asked.elapsed()));
    assert!(idle.state().is_err(), "it has asked nothing for longer than the limit");
}

// covers: AC-08, REQ037, standby
#[test]
fn an_answer_in_small_parts_has_one_limit_as_a_whole() {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("loopback is there");
    let address = listener.local_addr().expect("it listens");
    let slow = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("it connects");
        let answer = encode(&RemoteAnswer::Welcome("x".repeat(200))).expect("it is short");
        // It ends when the client has gone.
        let _ = answer.iter().try_for_each(|byte| {
            std::thread::sleep(Duration::from_millis(50));
            stream.write_all(&[*byte])
        });
    });
    let begin = WallClock::now();
    let late = RemoteClient::connect(address, &token(), Duration::from_millis(500)).expect_err("it is too slow");
    assert!(matches!(late, RemoteError::Connection(_)), "{late}");
    assert!(begin.elapsed() < Duration::from_secs(8), "{:?}: 200 bytes take 10 s", begin.elapsed());
    slow.join().expect("it has not panicked");
}

// covers: AC-08, REQ037, MR-15, standby, threads
#[test]
fn a_permanent_standby_without_an_active_drives_on_request() {
    let [(cyclic, acyclic), _other] = SharedSegment::halves_of_two(ring_of_two(&KINDS));
    let plant = cyclic.plant();
    plant.with_network(|network| Host::Second.links().into_iter().for_each(|link| network.disconnect(link, true)));
    let options = Options::default().with_standby(StandbyOptions::default());
    let supervisor = SupervisorThread::start(acyclic, &options, || ()).expect("a thread starts");
    let server = serve(&supervisor, RemoteOptions::default());
    let mut client = client(&server);
    let joining = std::thread::spawn(move || {
        let policy = Policy::permanent_standby().with_listen(Duration::from_millis(50));
        let joined = supervisor.join(&policy, |scan| automatic(&scan.subdevices, CYCLE), cyclic);
        let application = joined.unwrap_or_else(|refused| panic!("{}", refused.error));
        application.start_cycles(|| (), |_| ControlFlow::Continue(())).expect("a thread starts")
    });
    let mut state = || client.state().expect("it answers");
    until("it is held", || state().is_held);
    std::thread::sleep(Duration::from_millis(300));
    let alone = state();
    assert!(!alone.is_active && !alone.has_application, "{alone:?}");
    client.request(RemoteRole::Active, false).expect("it is permitted");
    let mut state = || client.state().expect("it answers");
    until("all are in OP", || {
        let seen = state();
        seen.is_active && seen.subdevices.len() == 4 && seen.subdevices.iter().all(|it| it == "OP")
    });
    let driving = state();
    assert!(driving.is_held && driving.counters.sent > 0, "{driving:?}");
    assert!(driving.not_ready.iter().any(|reason| reason == "no guard"), "nothing guards it: {driving:?}");
    // A hold is taken back with a request of its own.
    client.hold(false, false).expect("it is permitted");
    assert!(!client.state().expect("it answers").is_held);
    drop(server);
    drop(joining.join().expect("it has not panicked").end());
}
