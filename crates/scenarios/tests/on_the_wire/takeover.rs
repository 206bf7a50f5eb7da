//! Two controllers, each `ringcat standby` in a namespace of its own, at one ring: one is killed, the other takes over.

use std::time::{Duration, Instant};

use crate::bench::{Bench, await_op};
use crate::running::Running;
use crate::{RING_OF_10, states};

const CYCLE_MS: f64 = 5.0;
/// A busy machine reaches each state within this time.
const LIMIT: Duration = Duration::from_secs(20);
/// Options of both controllers. The machine may be busy: a stall of less than 40 ms is no death.
const DECLARED: [&str; 9] =
    ["--automatic", "--cycle", "5ms", "--listen", "300ms", "--timeout", "10", "--guard", "40ms"];

/// Waits until a controller has said this.
fn await_words(controller: &Running, words: &str) {
    let until = Instant::now() + LIMIT;
    while !controller.said().so_far().contains(words) {
        let (said, errors) = (controller.said().so_far(), controller.errors().so_far());
        assert!(Instant::now() < until, "not within {LIMIT:?}: {words}\n{said}{errors}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The silence before the takeover, as the line about it says.
fn silence_ms(said: &str) -> f64 {
    let line = said.lines().find(|line| line.contains("taken over: ")).expect("it took over");
    let (_, silence) = line.split_once("was ").unwrap_or_else(|| panic!("{line}"));
    silence.split(' ').next().and_then(|ms| ms.parse().ok()).unwrap_or_else(|| panic!("{line}"))
}

// covers: standby, MR-01, MR-07, MR-21, REQ012
#[test]
fn a_killed_active_is_taken_over_and_comes_back_and_no_subdevice_leaves_op() {
    let Some(mut bench) = Bench::new(2) else { return };
    bench.add_second_main_device();
    bench.simulate(&RING_OF_10.segment(), true);
    let start_first =
        || bench.run_ringcat(&[&["standby", "--main", "main0", "--redundant", "active1"], &DECLARED[..]].concat());
    let first = start_first();
    await_op(&bench, 10);
    let arguments = [&["standby", "--main", "second0", "--redundant", "main1"], &DECLARED[..]].concat();
    let second = bench.run_other_ringcat(&arguments);
    await_words(&first, "the other MainDevice: ready");
    first.signal("-KILL");
    await_words(&second, "taken over: 10 SubDevices go on as they are");
    assert_eq!(states(&bench, "OP"), 10, "{}", bench.order("status"));
    let silence = silence_ms(&second.said().so_far());
    println!("without process data: {silence} ms, {:.0} cycles missing", (silence / CYCLE_MS - 1.0).max(0.0));
    // The killed one is started again, follows, and is handed the role over.
    drop(first);
    let first = start_first();
    await_words(&first, "INACTIVE: cycles run");
    await_words(&second, "the other MainDevice: ready");
    let (said, errors) = second.interrupt();
    assert!(said.contains("result: ok: handed the role over, takeovers: 1"), "{said}{errors}");
    await_words(&first, "ACTIVE (handed over)");
    assert_eq!(states(&bench, "OP"), 10, "{}", bench.order("status"));
    let (said, errors) = first.interrupt();
    assert!(said.contains("stopped: outputs zero, all SubDevices in INIT"), "{said}{errors}");
    assert!(said.contains("result: ok: stopped the bus as ACTIVE, takeovers: 1"), "{said}{errors}");
    assert_eq!(states(&bench, "INIT"), 10, "{}", bench.order("status"));
    bench.show_simulator_lateness();
}
