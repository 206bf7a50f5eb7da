//! The first application of the guide, on the bus of a daemon: only the constructor differs.

use std::process::Command;
use std::time::{Duration, Instant};

use ringcat::daemon::OwnedBus;
use ringcat::{AlState, Declaration, LastOutputs, Options, SubDeviceConfig};
use ringcat_link::realtime;

use crate::bench::{Bench, LONG};

/// Set in the process that is pinned to a processor.
const PINNED: &str = "RINGCAT_TEST_PINNED";

// covers: daemon, api
#[test]
fn the_first_application_needs_another_constructor_only() {
    let bench = Bench::start(4);
    for _ in 0..2 {
        let taken = OwnedBus::take(&bench.socket, 0, "first", &Options::default(), || ());
        let mut main_device = taken.expect("the daemon drives it");
        let found = main_device.scan().expect("it is known").subdevices;
        assert_eq!(found.len(), 4);
        let mut declaration = Declaration::new(Duration::from_millis(1));
        let lamps = declaration.add(SubDeviceConfig::at_position(0).expect_product(0x0C47, 0x07D8_0008));
        let buttons = declaration.add(SubDeviceConfig::at_position(1));
        let mut application = main_device.activate(declaration).expect("it fits");
        let again = main_device.activate(Declaration::new(Duration::from_millis(1)));
        assert!(again.is_err(), "an application has the links");
        let lamp = application.output::<bool>(lamps, 0x7000, 1).expect("it is there");
        let button = application.input_named::<bool>(buttons, "Channel 1.Input").expect("it is there");
        application.wait_until_op(Duration::from_secs(10)).expect("all reach OP");
        let begin = Instant::now();
        for round in 0.. {
            application.cycle(|data| {
                let pressed = data.get(button);
                data.set(lamp, !pressed);
            });
            // A watchdog expires if this thread does not run for a while; the application goes to OP again.
            if round >= 20 && bench.states()[0].al_state() == Some(AlState::Op) {
                break;
            }
            assert!(begin.elapsed() < LONG, "{:?}", bench.states());
        }
        application.stop(LastOutputs::Zero, AlState::Init, Duration::from_secs(5)).expect("it stops");
        main_device.release().expect("the daemon takes it");
        bench.wait_until("all in PREOP", |bench| bench.are_in(AlState::PreOp));
    }
}

// covers: daemon
#[test]
fn a_declaration_that_does_not_fit_leaves_the_links_for_another_attempt() {
    let bench = Bench::start(2);
    let mut bus = bench.take();
    let mut wrong = Declaration::new(Duration::from_millis(1));
    wrong.add(SubDeviceConfig::at_position(0).expect_product(1, 2));
    bus.activate(wrong).expect_err("it is another product");
    let right = ringcat::automatic(&bus.scan().expect("it is known").subdevices, Duration::from_millis(1));
    bus.activate(right).expect("it fits").wait_until_op(Duration::from_secs(10)).expect("all reach OP");
}

/// Processors that threads of this process may use, other than the calling one.
fn processors_of_others() -> Vec<String> {
    let own = std::fs::read_link("/proc/thread-self").expect("it is there");
    let tasks = std::fs::read_dir("/proc/self/task").expect("it is there").flatten();
    let others = tasks.filter(|task| Some(task.file_name().as_os_str()) != own.file_name());
    let status = others.map(|task| std::fs::read_to_string(task.path().join("status")).unwrap_or_default());
    let line = |status: String| status.lines().find_map(|it| it.strip_prefix("Cpus_allowed_list:").map(str::to_owned));
    status.filter_map(line).map(|list| list.trim().to_owned()).collect()
}

// covers: daemon, api
#[test]
fn threads_of_a_requested_bus_use_all_processors_whatever_the_caller_may() {
    if std::env::var_os(PINNED).is_none() {
        let bench = Bench::start(2);
        let mut pinned = Command::new(std::env::current_exe().expect("it is known"));
        pinned.args(["--exact", "application::threads_of_a_requested_bus_use_all_processors_whatever_the_caller_may"]);
        pinned.env(PINNED, "1").env("RINGCAT_SOCKET", &bench.socket);
        let output = pinned.output().expect("it runs");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
        return;
    }
    let before = processors_of_others();
    realtime::affinity(0).expect("there is a processor");
    let bus = OwnedBus::request(0, &Options::default()).expect("the daemon drives it");
    // A thread that has just been started may not have run yet.
    let begin = Instant::now();
    loop {
        let with_bus = processors_of_others();
        assert!(with_bus.len() > before.len(), "it has threads: {with_bus:?}");
        if with_bus.iter().all(|list| *list == before[0]) {
            break;
        }
        assert!(begin.elapsed() < LONG, "{with_bus:?}, before {before:?}");
        std::thread::sleep(Duration::from_millis(1));
    }
    bus.release().expect("the daemon takes it");
}
