//! Outputs of an application that is gone, as the SubDevice has them.

use std::time::{Duration, Instant};

use ringcat::AlState;

use crate::bench::{Bench, LONG, check_bar};
use crate::owner_process::{OwnerProcess, Work};

/// Outputs of a killed application end within this time by the daemon's first frames.
const BY_DAEMON: Duration = Duration::from_millis(50);
/// Watchdogs end them within this time: 100 ms, and the time between two looks.
const BY_WATCHDOG: Duration = Duration::from_millis(120);
/// An application may be stopped for so long here.
const STOP_LIMIT: Duration = Duration::from_millis(600);

/// Whether the first SubDevice has outputs that are set, and when the links were connected that there are then.
fn look(bench: &Bench) -> (bool, u64) {
    bench.inside(|segment| {
        let connected_ns = segment.connected_ns();
        let mut devices = segment.network_mut().devices();
        (devices.next().is_some_and(|device| device.outputs().iter().any(|byte| *byte != 0)), connected_ns)
    })
}

fn are_set(bench: &Bench) -> bool {
    look(bench).0
}

/// An application whose outputs are set.
fn begin(bench: &Bench, work: Work) -> OwnerProcess {
    let owner = OwnerProcess::start(&bench.socket, work);
    bench.wait_until("outputs are set", are_set);
    owner
}

/// Time until no output is set, and when the links were connected that there are at that moment.
fn end_and_links_after(bench: &Bench) -> (Duration, u64) {
    let begin = Instant::now();
    loop {
        let (are_set, connected_ns) = look(bench);
        if !are_set {
            return (begin.elapsed(), connected_ns);
        }
        assert!(begin.elapsed() < LONG, "outputs are stuck");
        std::thread::sleep(Duration::from_micros(200));
    }
}

/// Time until no output is set.
fn end_after(bench: &Bench) -> Duration {
    end_and_links_after(bench).0
}

// covers: daemon
#[test]
fn outputs_of_an_application_that_has_ended_end_with_and_without_watchdogs() {
    let bench = Bench::start(4);
    for work in [Work::Cycle, Work::Unwatched] {
        for _ in 0..5 {
            let mut owner = begin(&bench, work);
            owner.child.kill().expect("it runs");
            check_bar("outputs after SIGKILL", end_after(&bench), BY_DAEMON);
            bench.wait_until("all in PREOP", |bench| bench.are_in(AlState::PreOp));
        }
    }
    let mut owner = begin(&bench, Work::Exit);
    owner.input_ends();
    check_bar("outputs after exit", end_after(&bench), BY_DAEMON);
    owner.child.wait().expect("it ends");
    bench.wait_until("all in PREOP", |bench| bench.are_in(AlState::PreOp));
}

// covers: daemon
#[test]
fn outputs_of_a_stopped_application_end_by_watchdogs_or_by_the_limit_of_the_daemon() {
    let bench = Bench::with_limit(4, STOP_LIMIT);
    let owner = begin(&bench, Work::Cycle);
    let connected = bench.inside(|segment| segment.connected_ns());
    owner.signal("-STOP");
    let (ended, connected_then) = end_and_links_after(&bench);
    check_bar("outputs after SIGSTOP", ended, BY_WATCHDOG);
    assert_eq!(connected_then, connected, "by the watchdog, before the daemon");
    drop(owner);
    bench.wait_until("all in PREOP", |bench| bench.are_in(AlState::PreOp));
    let owner = begin(&bench, Work::Unwatched);
    let begun = Instant::now();
    owner.signal("-STOP");
    let ended = end_after(&bench);
    // The process is stopped before the test goes on.
    let since_signal = begun.elapsed();
    assert!(since_signal > STOP_LIMIT / 2, "nothing ends them before the limit: {since_signal:?}");
    check_bar("outputs after SIGSTOP without a watchdog", ended, STOP_LIMIT + BY_WATCHDOG);
    bench.wait_until("all in PREOP", |bench| bench.are_in(AlState::PreOp));
}
