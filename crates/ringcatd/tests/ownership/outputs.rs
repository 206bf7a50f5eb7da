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

/// Whether the first SubDevice has outputs that are set.
fn are_set(bench: &Bench) -> bool {
    bench.inside(|segment| {
        let mut devices = segment.network_mut().devices();
        devices.next().is_some_and(|device| device.outputs().iter().any(|byte| *byte != 0))
    })
}

/// An application whose outputs are set.
fn begin(bench: &Bench, work: Work) -> OwnerProcess {
    let owner = OwnerProcess::start(&bench.socket, work);
    bench.wait_until("outputs are set", are_set);
    owner
}

/// Time until no output is set.
fn end_after(bench: &Bench) -> Duration {
    let begin = Instant::now();
    while are_set(bench) {
        assert!(begin.elapsed() < LONG, "outputs are stuck");
        std::thread::sleep(Duration::from_micros(200));
    }
    begin.elapsed()
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
    check_bar("outputs after SIGSTOP", end_after(&bench), BY_WATCHDOG);
    assert_eq!(bench.inside(|segment| segment.connected_ns()), connected, "by the watchdog, before the daemon");
    drop(owner);
    bench.wait_until("all in PREOP", |bench| bench.are_in(AlState::PreOp));
    let owner = begin(&bench, Work::Unwatched);
    owner.signal("-STOP");
    let ended = end_after(&bench);
    assert!(ended > STOP_LIMIT / 2, "nothing ends them before the limit: {ended:?}");
    check_bar("outputs after SIGSTOP without a watchdog", ended, STOP_LIMIT + BY_WATCHDOG);
    bench.wait_until("all in PREOP", |bench| bench.are_in(AlState::PreOp));
}
