//! Ends of an owner without a release.

use std::time::{Duration, Instant};

use ringcat::AlState;
use ringcat::daemon::{Answer, Query};
use ringcat::sim::cable::DeviceIndex;
use ringcat::sim::fault::Fault;

use crate::bench::{Bench, LONG, check_bar};
use crate::owner_process::{OwnerProcess, Work};

/// From SIGKILL to the first frame of the daemon: median and longest of 50.
const FIRST_FRAME: [Duration; 2] = [Duration::from_millis(5), Duration::from_millis(20)];
/// From then on all SubDevices are in PREOP within this time, beside what they take themselves.
const PREOP: Duration = Duration::from_millis(100);

/// When the first frame came over the present links, by the clock of this machine.
fn first_frame(bench: &Bench, after_ns: u64) -> Option<u64> {
    bench.inside(move |segment| segment.first_frame_ns().filter(|at| segment.connected_ns() > after_ns && *at > 0))
}

fn now_ns() -> u64 {
    ringcat_link::monotonic::now_ns()
}

/// Waits for the daemon's first frame, and returns the time since then until now.
fn wait_for_first_frame(bench: &Bench, after_ns: u64) -> Duration {
    let begin = Instant::now();
    loop {
        if let Some(at) = first_frame(bench, after_ns) {
            return Duration::from_nanos(at.saturating_sub(after_ns));
        }
        assert!(begin.elapsed() < LONG, "no frame of the daemon");
        std::thread::sleep(Duration::from_micros(500));
    }
}

/// Rounds and seed of tests that kill applications at random moments; `RINGCAT_KILLS=500:7` sets others.
fn rounds() -> (usize, Random) {
    let asked = std::env::var("RINGCAT_KILLS").unwrap_or_else(|_| "50:1".to_owned());
    let (count, seed) = asked.split_once(':').unwrap_or((&asked, "1"));
    println!("RINGCAT_KILLS={count}:{seed}");
    (count.parse().expect("a number of rounds"), Random(seed.parse().expect("a seed")))
}

/// Random numbers from a seed (SplitMix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    fn below(&mut self, limit: Duration) -> Duration {
        Duration::from_nanos(self.next() % limit.as_nanos() as u64)
    }
}

// covers: daemon
#[test]
fn fifty_killed_applications_leave_the_bus_to_the_daemon_within_20_ms() {
    let bench = Bench::start(8);
    let (mut first, mut preop) = (Vec::new(), Vec::new());
    let (count, mut random) = rounds();
    for round in 0..count {
        let work = if round % 5 == 0 { Work::Hold } else { Work::Cycle };
        let mut owner = OwnerProcess::start(&bench.socket, work);
        std::thread::sleep(random.below(Duration::from_millis(20)));
        let killed = now_ns();
        owner.child.kill().expect("it runs");
        first.push(wait_for_first_frame(&bench, killed));
        let back = bench.wait_until("all in PREOP", |bench| bench.are_in(AlState::PreOp));
        preop.push(back);
        owner.child.wait().expect("it has ended");
    }
    first.sort_unstable();
    preop.sort_unstable();
    let (median, longest) = (first[count / 2], first[count - 1]);
    println!("SIGKILL to the first frame of the daemon: median {median:?}, longest {longest:?}");
    println!("from there to PREOP of all 8 SubDevices: median {:?}, longest {:?}", preop[count / 2], preop[count - 1]);
    check_bar("median", median, FIRST_FRAME[0]);
    check_bar("longest", longest, FIRST_FRAME[1]);
    check_bar("to PREOP", preop[count - 1], PREOP);
}

/// An application takes so long from its start to OP.
const START: Duration = Duration::from_millis(150);

// covers: daemon
#[test]
fn an_application_may_be_killed_at_any_moment_of_its_start() {
    let bench = Bench::start(4);
    let (count, mut random) = rounds();
    let mut had = 0;
    for _ in 0..count {
        let connected = bench.inside(|segment| segment.connected_ns());
        let mut owner = OwnerProcess::begin(&bench.socket, Work::Cycle);
        std::thread::sleep(random.below(START));
        owner.child.kill().expect("it runs");
        owner.child.wait().expect("it has ended");
        bench.wait_until("the daemon has it", |bench| {
            matches!(bench.client().ask(0, Query::Masters, Vec::new()),
                Ok((Answer::Masters(masters), _)) if masters[0].owner.is_none() && masters[0].fault.is_none())
        });
        bench.wait_until("all in PREOP", |bench| bench.are_in(AlState::PreOp));
        had += usize::from(bench.inside(|segment| segment.connected_ns()) > connected);
    }
    println!("{had} of {count} were killed while they had the bus");
    bench.take().release().expect("the daemon drives it");
}

// covers: daemon
#[test]
fn an_application_that_ends_without_a_release_leaves_the_bus_to_the_daemon() {
    let bench = Bench::start(4);
    let mut client = bench.client();
    for signal in ["-TERM", "-ABRT", "-SYS"] {
        let owner = OwnerProcess::start(&bench.socket, Work::Patient);
        assert!(bench.are_in(AlState::Op));
        let at = now_ns();
        owner.signal(signal);
        wait_for_first_frame(&bench, at);
        bench.wait_until("all in PREOP", |bench| bench.are_in(AlState::PreOp));
        crate::bench::ask(&mut client, Query::State);
    }
    let mut owner = OwnerProcess::start(&bench.socket, Work::Exit);
    let at = now_ns();
    owner.input_ends();
    wait_for_first_frame(&bench, at);
    bench.wait_until("all in PREOP", |bench| bench.are_in(AlState::PreOp));
    assert!(owner.child.wait().expect("it has ended").success(), "it ends by exit");
    bench.take().release().expect("the daemon drives it");
}

// covers: daemon
#[test]
fn a_core_dump_does_not_delay_the_daemon() {
    let bench = Bench::start(4);
    let directory = crate::bench::directory();
    let mut times = Vec::new();
    for _ in 0..5 {
        let owner = OwnerProcess::start_with_core(&bench.socket, &directory);
        let at = now_ns();
        // SIGQUIT would do, too, but is ignored in what a shell has started in the background.
        owner.signal("-SYS");
        times.push(wait_for_first_frame(&bench, at));
        bench.wait_until("all in PREOP", |bench| bench.are_in(AlState::PreOp));
    }
    times.sort_unstable();
    println!("SIGSYS with a core of 64 MB to the first frame of the daemon: median {:?}, all {times:?}", times[2]);
    std::fs::remove_dir_all(directory).expect("it is there");
    // The time includes that of starting the program `kill`.
    check_bar("with a core", times[2], FIRST_FRAME[1]);
}

/// An application may be stopped for so long.
const SHORT_LIMIT: Duration = Duration::from_millis(100);

/// An application that was stopped for less than the limit has its bus. On a busy machine the stop may last longer:
/// then it is tried with another application.
fn stopped_for_a_moment(bench: &Bench) -> OwnerProcess {
    let begin = Instant::now();
    loop {
        let owner = OwnerProcess::start(&bench.socket, Work::Cycle);
        let connected = bench.inside(|segment| segment.connected_ns());
        let stop = Instant::now();
        owner.signal("-STOP");
        std::thread::sleep(Duration::from_millis(20));
        owner.signal("-CONT");
        let stopped_for = stop.elapsed();
        std::thread::sleep(2 * SHORT_LIMIT);
        if stopped_for < SHORT_LIMIT {
            assert_eq!(bench.inside(|segment| segment.connected_ns()), connected, "a stop of {stopped_for:?} is none");
            return owner;
        }
        assert!(begin.elapsed() < LONG, "no stop was short: {stopped_for:?}");
    }
}

// covers: daemon
#[test]
fn a_stopped_application_loses_the_bus_after_the_limit_and_sends_nothing_later() {
    let bench = Bench::with_limit(4, SHORT_LIMIT);
    let owner = stopped_for_a_moment(&bench);
    let at = now_ns();
    owner.signal("-STOP");
    let first = wait_for_first_frame(&bench, at);
    assert!(first >= Duration::from_millis(80), "{first:?}");
    bench.wait_until("all in PREOP", |bench| bench.are_in(AlState::PreOp));
    let frames = bench.inside(|segment| segment.cyclic_frames());
    owner.signal("-CONT");
    // It goes on with its cycles for a while.
    std::thread::sleep(Duration::from_millis(200));
    let said = owner.end();
    let released = "Err(\"ringcatd has taken the bus back before: its process was stopped\")";
    assert_eq!(said, format!("ended: {released}, TakenBack"));
    assert_eq!(bench.inside(|segment| segment.cyclic_frames()), frames, "none of its frames reaches the segment");
    assert!(bench.are_in(AlState::PreOp));
    bench.take().release().expect("the daemon drives it");
}

// covers: daemon
#[test]
fn subdevices_are_in_the_safe_state_of_their_master_after_any_end() {
    for state in [AlState::Init, AlState::SafeOp] {
        let bench = Bench::with(4, ringcatd::daemon::STOP_LIMIT, state);
        assert!(bench.are_in(AlState::PreOp), "before there was an application");
        for is_killed in [true, false] {
            let mut owner = OwnerProcess::start(&bench.socket, Work::Patient);
            assert!(bench.are_in(AlState::Op));
            if is_killed {
                owner.child.kill().expect("it runs");
            } else {
                owner.end();
            }
            bench.wait_until("all in the safe state", |bench| bench.are_in(state));
            // They stay there.
            std::thread::sleep(Duration::from_millis(300));
            assert!(bench.are_in(state), "{:?}", bench.states());
        }
    }
}

/// The next one comes before the daemon has seen the end, or while it brings all SubDevices to PREOP.
// covers: daemon
#[test]
fn an_application_that_is_killed_and_started_again_at_once_reaches_op() {
    let bench = Bench::start(4);
    for _ in 0..25 {
        // It fails if the master is refused.
        let mut owner = OwnerProcess::start(&bench.socket, Work::Cycle);
        owner.child.kill().expect("it runs");
        owner.child.wait().expect("it has ended");
    }
}

/// A client requests events as `ethercat events` does, so that the owner gets a message every 50 ms.
// covers: daemon
#[test]
fn a_change_seen_by_a_killed_owner_is_known_although_a_client_sent_queries() {
    const LEFT: usize = 3;
    let bench = Bench::start(LEFT + 1);
    let mut client = bench.client();
    let owner = OwnerProcess::start(&bench.socket, Work::Hold);
    bench.inside(|segment| segment.network_mut().apply(Fault::PowerOff(DeviceIndex(LEFT))));
    let (begin, mut from, mut of_owner) = (Instant::now(), 0, 0);
    while begin.elapsed() < Duration::from_secs(3) {
        let Answer::Events { next, epoch, .. } = crate::bench::ask(&mut client, Query::Events { from }) else {
            panic!("they are events")
        };
        (from, of_owner) = (next, epoch);
        std::thread::sleep(Duration::from_millis(50));
    }
    owner.signal("-KILL");
    let begin = Instant::now();
    let text = loop {
        let answer = crate::bench::ask(&mut client, Query::Events { from: 0 });
        let Answer::Events { epoch, events, .. } = answer else { panic!("they are events") };
        let resumed = events.into_iter().map(|event| event.text).find(|text| text.contains("another process"));
        if let Some(text) = resumed.filter(|_| epoch != of_owner) {
            break text;
        }
        assert!(begin.elapsed() < LONG, "the daemon goes on");
        std::thread::sleep(Duration::from_millis(5));
    };
    assert!(text.contains("it is as known") && text.ends_with("of 3 SubDevices stay"), "{text}");
}
