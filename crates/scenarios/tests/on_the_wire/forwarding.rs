//! A ring that leads through a second MainDevice, `ringcat standby`: another process in another namespace, which stores
//! and forwards. The first one is ours or another stack's.

use std::time::{Duration, Instant};

use crate::bench::{Bench, await_op, is_asked_for};
use crate::foreign::{FOREIGN, exchange, python, start_pysoem};
use crate::running::Running;
use crate::{RING_OF_10, show_summary, states};

/// Pause after an edge.
const PAUSE: Duration = Duration::from_millis(700);
/// Limit of the start of the second MainDevice.
const START_LIMIT: Duration = Duration::from_secs(5);

/// A bench with the second MainDevice, forwarding.
fn ring_of_two() -> Option<(Bench, Running)> {
    let mut bench = Bench::new(2)?;
    bench.add_second_main_device();
    let second = start_standby(&bench);
    Some((bench, second))
}

/// Waits until a second MainDevice forwards.
fn await_forwarding(second: &Running) {
    let until = Instant::now() + START_LIMIT;
    while !second.said().so_far().contains("INACTIVE: forwarding") {
        assert!(Instant::now() < until, "{}", second.said().so_far());
        std::thread::sleep(Duration::from_millis(20));
    }
}

// covers: CF-01, 9.7.5, standby
#[test]
fn the_active_runs_its_ring_through_the_standby_with_each_kind_of_cut() {
    let Some((mut bench, second)) = ring_of_two() else { return };
    bench.simulate(&RING_OF_10.segment(), true);
    let run = bench.run_ringcat(&["run", "--main", "main0", "--redundant", "active1", "--all-events"]);
    await_op(&bench, 10);
    std::thread::sleep(PAUSE);
    type Switch<'a> = &'a dyn Fn(&Bench, bool);
    let inner: Switch<'_> = &|bench, is_cut| drop(bench.order(if is_cut { "cut 4-5" } else { "heal 4-5" }));
    let state = |is_cut: bool| if is_cut { "down" } else { "up" };
    let between: Switch<'_> = &|bench, is_cut| bench.set_link_elsewhere("second0", state(is_cut));
    let far_end: Switch<'_> = &|bench, is_cut| bench.set_link_elsewhere("main1", state(is_cut));
    let near_end: Switch<'_> = &|bench, is_cut| bench.set_link("main0", state(is_cut));
    for (what, switch) in
        [("inner cable", inner), ("cable between both", between), ("far end", far_end), ("near end", near_end)]
    {
        for is_cut in [true, false] {
            let begin = Instant::now();
            switch(&bench, is_cut);
            std::thread::sleep(PAUSE);
            let lines = run.said().between(begin, Instant::now());
            let reports =
                lines.iter().filter(|(_, line)| line.contains("ring open:") || line.contains("Line is fixed"));
            assert_eq!(reports.count(), 1, "{what}, cut: {is_cut}: {lines:?}");
            assert_eq!(states(&bench, "OP"), 10, "{what}, cut: {is_cut}: {}", bench.order("status"));
        }
    }
    let (output, errors) = run.interrupt();
    assert!(!output.contains("no longer answers"), "{output}{errors}");
    let (said, errors) = second.interrupt();
    println!("{}", said.lines().filter(|line| line.starts_with("forwarded")).collect::<String>());
    assert!(said.contains(" frames forwarded"), "{said}{errors}");
    assert!(said.contains(" back; ") && !said.contains(" these 0 back"), "{said}{errors}");
    bench.show_simulator_lateness();
}

/// Starts the second MainDevice.
fn start_standby(bench: &Bench) -> Running {
    let second = bench.run_other_ringcat(&["standby", "--main", "second0", "--redundant", "main1"]);
    await_forwarding(&second);
    second
}

// covers: standby, MR-26
#[test]
fn a_standby_leaves_the_active_a_line_at_its_end_and_closes_the_ring_when_back() {
    let Some((mut bench, mut second)) = ring_of_two() else { return };
    bench.simulate(&RING_OF_10.segment(), true);
    let run = bench.run_ringcat(&["run", "--main", "main0", "--redundant", "active1", "--all-events"]);
    await_op(&bench, 10);
    std::thread::sleep(PAUSE);
    for round in 0..3 {
        let begin = Instant::now();
        let (said, errors) = second.interrupt();
        assert!(said.contains("second0 and main1 are switched off: the ACTIVE has a line"), "{said}{errors}");
        std::thread::sleep(PAUSE);
        let lines = run.said().between(begin, Instant::now());
        assert!(lines.iter().any(|(_, line)| line.contains("ring open:")), "round {round}: {lines:?}");
        assert_eq!(states(&bench, "OP"), 10, "round {round}: {}", bench.order("status"));
        let begin = Instant::now();
        second = start_standby(&bench);
        std::thread::sleep(PAUSE);
        let lines = run.said().between(begin, Instant::now());
        assert!(lines.iter().any(|(_, line)| line.contains("Line is fixed")), "round {round}: {lines:?}");
        assert_eq!(states(&bench, "OP"), 10, "round {round}: {}", bench.order("status"));
    }
    let (output, errors) = run.interrupt();
    assert!(output.contains("stopped: outputs zero, all SubDevices in INIT"), "{output}{errors}");
    show_summary("a standby that ends and comes back three times", &output);
    bench.show_simulator_lateness();
    drop(second);
}

/// Ends a second MainDevice by a signal; whether the ACTIVE then has a line, and all SubDevices are in OP.
fn end_by_signal(bench: &Bench, run: &Running, second: &Running, signal: &str) {
    let begin = Instant::now();
    second.signal(signal);
    std::thread::sleep(PAUSE);
    let lines = run.said().between(begin, Instant::now());
    assert!(lines.iter().any(|(_, line)| line.contains("ring open:")), "{signal}: {lines:?}");
    assert_eq!(states(bench, "OP"), 10, "{signal}: {}", bench.order("status"));
    let on = bench.links_on_elsewhere();
    assert!(!on.contains("main1") && !on.contains("second0"), "{signal}: {on}");
}

// covers: standby, MR-21
#[test]
fn the_guard_of_a_standby_that_is_killed_or_stopped_leaves_the_active_a_line() {
    let Some((mut bench, mut second)) = ring_of_two() else { return };
    bench.simulate(&RING_OF_10.segment(), true);
    let run = bench.run_ringcat(&["run", "--main", "main0", "--redundant", "active1", "--all-events"]);
    await_op(&bench, 10);
    std::thread::sleep(PAUSE);
    for round in 0..3 {
        for signal in ["-KILL", "-STOP"] {
            end_by_signal(&bench, &run, &second, signal);
            if signal == "-STOP" {
                // It goes on, finds that its interfaces are off, and ends.
                second.signal("-CONT");
            }
            let (said, errors) = second.finish(START_LIMIT);
            assert!(errors.contains("its interfaces are switched off, the ACTIVE has a line"), "{said}{errors}");
            let is_reported = said.contains("FAILED: the guard has switched both off");
            assert_eq!(is_reported, signal == "-STOP", "{said}{errors}");
            let begin = Instant::now();
            second = start_standby(&bench);
            std::thread::sleep(PAUSE);
            let lines = run.said().between(begin, Instant::now());
            assert!(lines.iter().any(|(_, line)| line.contains("Line is fixed")), "round {round}: {lines:?}");
            assert_eq!(states(&bench, "OP"), 10, "round {round}: {}", bench.order("status"));
        }
    }
    let (output, errors) = run.interrupt();
    assert!(output.contains("stopped: outputs zero, all SubDevices in INIT"), "{output}{errors}");
    show_summary("three killed and three stopped standbys with guards", &output);
    bench.show_simulator_lateness();
    drop(second);
}

// covers: standby, MR-21
#[test]
fn a_standby_whose_guard_was_killed_goes_on_and_says_so() {
    let Some((bench, second)) = ring_of_two() else { return };
    second.signal_child("-KILL");
    std::thread::sleep(PAUSE);
    let said = second.errors().so_far();
    assert!(said.contains("the guard has ended"), "{said}");
    assert!(bench.links_on_elsewhere().contains("second0"));
    let (said, errors) = second.interrupt();
    assert!(said.contains("FAILED") && said.contains("its guard had ended"), "{said}{errors}");
    assert!(!bench.links_on_elsewhere().contains("second0"));
}

// covers: sim-foreign
#[test]
fn pysoem_runs_its_ring_through_the_standby() {
    if !is_asked_for(FOREIGN) {
        return;
    }
    let Some((mut bench, second)) = ring_of_two() else { return };
    let Some(python) = python() else { return };
    let count = RING_OF_10.count();
    exchange(&mut bench, &RING_OF_10, true, "pysoem through a standby", |bench| {
        start_pysoem(bench, &python, "main0,active1", count)
    });
    let (said, errors) = second.interrupt();
    assert!(said.contains(" frames forwarded"), "{said}{errors}");
    println!("{}", said.lines().filter(|line| line.starts_with("forwarded")).collect::<String>());
}

#[test]
fn a_standby_that_receives_no_frame_reports_it() {
    let Some((bench, second)) = ring_of_two() else { return };
    std::thread::sleep(PAUSE);
    let (said, errors) = second.interrupt();
    assert!(said.contains("FAILED: no frame of another MainDevice came"), "{said}{errors}");
    drop(bench);
}
