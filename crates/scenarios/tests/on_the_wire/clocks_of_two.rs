//! Distributed clocks in a ring of two controllers, each `ringcat standby`, in real time: the ACTIVE is killed, later
//! the role is handed over. The simulator has the true differences of the clocks, and what each SubDevice has received.

use std::time::{Duration, Instant};

use crate::bench::{Bench, await_op};
use crate::states;
use crate::takeover::{Pair, READY, await_that, await_words, end};

/// Clocks of both widths, up to 60 ppm from the reference, and one SubDevice without a clock.
const RING: &str = r#"
[segment]
ring = true
[[device]]
type = "digital-input-8"
clock_bits = 64
drift_ppm = 40
[[device]]
type = "servo"
drift_ppm = -40
cable_ns = 120
[[device]]
type = "digital-output-8"
clock_bits = 0
cable_ns = 60
[[device]]
type = "digital-input-16"
clock_bits = 32
drift_ppm = 20
cable_ns = 500
[[device]]
type = "servo"
drift_ppm = -60
cable_ns = 80
"#;
const COUNT: usize = 5;
/// With SYNC0, and where.
const SERVOS: [usize; 2] = [1, 4];
/// Options of both. The machine may be busy: a stall of less than 40 ms is no failure.
const ROLE: [&str; 10] =
    ["--listen", "300ms", "--timeout", "10", "--guard", "40ms", "--sync", "1:5ms+1ms", "--sync", "4:5ms+2ms"];
const TAKEN_OVER: &str = "taken over: 5 SubDevices go on as they are";
/// All clocks are together within this time.
const LIMIT: Duration = Duration::from_secs(20);
/// For so long they are watched.
const WHILE: Duration = Duration::from_millis(300);
const SETTLED: Duration = Duration::from_secs(2);
/// Largest spread of the clocks: while the role changes, and when they are together.
const CHANGING_NS: i64 = 1_000;
const LOCKED_NS: i64 = 200;

/// Spread of all clocks now.
fn spread(bench: &Bench) -> i64 {
    let shown = bench.order("clocks");
    let clocks: Vec<i64> = shown.split(' ').filter_map(|shown| shown.parse().ok()).collect();
    assert_eq!(clocks.len(), COUNT - 1, "{shown}");
    clocks.iter().max().unwrap_or(&0) - clocks.iter().min().unwrap_or(&0)
}

/// Largest spread for a while.
fn watch(bench: &Bench, time: Duration) -> i64 {
    let until = Instant::now() + time;
    let mut largest = 0;
    while Instant::now() < until {
        largest = largest.max(spread(bench));
    }
    largest
}

/// Times at which SYNC0 comes, and which signals are active.
fn signals(bench: &Bench) -> Vec<String> {
    let of = |device: usize| bench.order(&format!("register {device} 0x0980 2")) + &cycle(bench, device);
    SERVOS.into_iter().map(of).collect()
}

fn cycle(bench: &Bench, device: usize) -> String {
    bench.order(&format!("register {device} 0x09a0 4"))
}

/// What the SubDevices with outputs have received since the last call: no output went back, and they came from another
/// MainDevice so many times.
fn check_outputs(bench: &Bench, changes: &str) {
    let gaps = bench.order("gaps");
    for device in ["servo-2", "servo-5", "digital-output-8-3"] {
        let line = gaps.lines().find(|line| line.contains(device)).unwrap_or_else(|| panic!("{device}: {gaps}"));
        println!("{line}");
        let words: Vec<&str> = line.split("\": ").nth(1).unwrap_or_default().split(' ').collect();
        assert_eq!((words.get(8), words.get(13)), (Some(&changes), Some(&"0")), "{line}");
    }
}

/// The clocks are together through a change of the role and after it, SYNC0 goes on, and all SubDevices are in OP.
fn check_after(pair: &Pair, what: &str, signals_before: &[String]) {
    let changing = watch(&pair.bench, SETTLED);
    let after = watch(&pair.bench, WHILE);
    println!("{what}: {changing} ns in {SETTLED:?}, then {after} ns");
    assert!(changing <= CHANGING_NS && after <= LOCKED_NS, "{what}: {changing} ns, then {after} ns");
    assert_eq!(signals(&pair.bench), signals_before, "{what}");
    assert_eq!(states(&pair.bench, "OP"), COUNT, "{what}: {}", pair.bench.order("status"));
    check_outputs(&pair.bench, "1");
}

// covers: standby, 7.2, 7.5, dc-ring, MR-07
#[test]
fn clocks_keep_together_through_a_takeover_and_a_switchover_on_interfaces() {
    let Some(pair) = Pair::at(RING, &ROLE) else { return };
    let first = pair.first(&[]);
    await_op(&pair.bench, COUNT);
    let begin = Instant::now();
    while watch(&pair.bench, WHILE) > LOCKED_NS {
        assert!(begin.elapsed() < LIMIT, "{} ns: {}", spread(&pair.bench), first.said().so_far());
    }
    let second = pair.second(&[]);
    await_words(&first, READY);
    let (before, signals) = (watch(&pair.bench, WHILE), signals(&pair.bench));
    println!("before: {before} ns; SYNC0 {signals:?}");
    assert!(before <= LOCKED_NS, "{before} ns");
    assert!(signals.iter().all(|active| active.starts_with("0003")), "{signals:?}");
    pair.bench.order("gaps");

    first.signal("-KILL");
    await_that(TAKEN_OVER, &[&second], || second.said().so_far().contains(TAKEN_OVER));
    check_after(&pair, "takeover", &signals);
    drop(first);
    let first = pair.first(&[]);
    await_words(&first, "INACTIVE: cycles run");
    await_words(&second, READY);
    pair.bench.order("gaps");

    end(second, &["result: ok: handed the role over, takeovers: 1"]);
    await_words(&first, "ACTIVE (handed over)");
    check_after(&pair, "switchover", &signals);
    end(first, &["result: ok: stopped the bus as ACTIVE, takeovers: 1"]);
    assert_eq!(states(&pair.bench, "INIT"), COUNT, "{}", pair.bench.order("status"));
    pair.bench.show_simulator_lateness();
}
