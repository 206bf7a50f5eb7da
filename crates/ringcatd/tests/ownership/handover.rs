//! Hand-overs in order.

use std::time::{Duration, Instant};

use ringcat::{AlState, Event, Services};

use crate::bench::{Bench, check_bar};

fn median(times: &mut [Duration]) -> Duration {
    times.sort_unstable();
    times[times.len() / 2]
}

/// Hand-over of 100 SubDevices until the request returns.
const BAR: Duration = Duration::from_millis(20);

// covers: daemon
#[test]
fn a_bus_of_100_subdevices_is_taken_over_within_20_ms_without_a_scan() {
    let bench = Bench::start(100);
    // The first hand-over waits until the daemon has read all dictionaries.
    bench.take().release().expect("the daemon takes it");
    let mut times = Vec::new();
    for _ in 0..21 {
        let begin = Instant::now();
        let bus = bench.take();
        times.push(begin.elapsed());
        let since = bus.supervisor().events_since(0).expect("it runs");
        let events: Vec<Event> = since.events.into_iter().map(|timed| timed.event).collect();
        let resumed = Event::Resumed { subdevices: 100, in_state: 100, differs: false };
        assert!(events.contains(&resumed), "{events:?}");
        assert!(!events.iter().any(|event| matches!(event, Event::ScanProgress { .. })), "{events:?}");
        assert_eq!(bus.supervisor().subdevices().map(|found| found.len()).expect("it runs"), 100);
        bus.release().expect("the daemon takes it");
        assert!(bench.are_in(AlState::PreOp), "no SubDevice has left PREOP");
        bench.wait_until("scanned", |bench| bench.client().ask(0, ringcat::daemon::Query::State, Vec::new()).is_ok());
    }
    let longest = *times.iter().max().expect("there are some");
    let median = median(&mut times);
    println!("hand-over of 100 SubDevices until the request returns: median {median:?}, longest {longest:?}");
    check_bar("longest hand-over", longest, BAR);
}

/// Descriptors of this process.
fn descriptors() -> usize {
    std::fs::read_dir("/proc/self/fd").expect("it is there").count()
}

/// Memory of this process in KiB: segment, daemon and application.
fn resident_kib() -> usize {
    let status = std::fs::read_to_string("/proc/self/status").expect("it is there");
    let line = status.lines().find_map(|line| line.strip_prefix("RssAnon:")).expect("it is shown");
    line.split_whitespace().next().and_then(|kib| kib.parse().ok()).expect("a number")
}

/// A thousand hand-overs may change it by so much: a leak of one page each would be 4,000.
const LEFT_KIB: usize = 1024;

// covers: daemon
#[test]
fn nothing_is_left_of_a_thousand_hand_overs() {
    let bench = Bench::start(3);
    // The allocator keeps memory for as many threads as there were at once.
    for _ in 0..100 {
        bench.take().release().expect("the daemon takes it");
    }
    let memory = resident_kib();
    let threads = || std::fs::read_dir("/proc/self/task").expect("it is there").count();
    let begin = Instant::now();
    let (before, threads_before) = (descriptors(), threads());
    for round in 0..1000 {
        let bus = bench.take();
        assert_eq!(bus.supervisor().subdevices().map(|found| found.len()).expect("it runs"), 3, "round {round}");
        bus.release().expect("the daemon takes it");
    }
    let after = resident_kib();
    println!("1000 hand-overs and back took {:?}; {after} KiB of memory, {memory} KiB before", begin.elapsed());
    assert!(after < memory + LEFT_KIB, "{after} KiB, {memory} KiB before");
    let few = Duration::from_secs(2);
    let begin = Instant::now();
    while (descriptors() > before || threads() > threads_before) && begin.elapsed() < few {
        std::thread::sleep(Duration::from_millis(10));
    }
    // Tests that wait for their turn have a thread each, and begin and end at any time: a leak would be a thousand.
    assert!(descriptors() < before + 20, "{} descriptors, {before} before", descriptors());
    assert!(threads() < threads_before + 20, "{} threads, {threads_before} before", threads());
    assert!(bench.are_in(AlState::PreOp));
}

// covers: daemon
#[test]
fn a_second_application_gets_the_process_that_drives_the_bus() {
    let bench = Bench::start(2);
    let bus = bench.take();
    let options = ringcat::Options::default();
    let second = ringcat::daemon::OwnedBus::take(&bench.socket, 0, "second", &options, || ());
    let refused = second.expect_err("the first has it").to_string();
    let pid = std::process::id();
    assert_eq!(refused, format!("ringcatd: master 0 is driven by \"test\" (process {pid})"));
    let none = ringcat::daemon::OwnedBus::take(&bench.socket, 7, "second", &options, || ());
    let refused = none.expect_err("there is one master").to_string();
    assert_eq!(refused, "ringcatd: there is no master 7; there are: 0");
    bus.release().expect("the daemon takes it");
    bench.take().release().expect("the daemon takes it");
    let gone = std::path::Path::new("/nonexistent/socket");
    let none = ringcat::daemon::OwnedBus::take(gone, 0, "second", &options, || ()).expect_err("no daemon is there");
    assert!(none.is_no_daemon(), "{none}");
}
