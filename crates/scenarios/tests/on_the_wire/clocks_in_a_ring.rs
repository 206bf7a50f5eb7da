//! Distributed clocks on two interfaces in real time: host cables and one inner cable are cut and repaired. The
//! simulator has the true differences of the clocks. Inside each part the host has no influence; across both parts
//! its sending jitter has.

use std::time::{Duration, Instant};

use crate::bench::Bench;

/// Clocks of both widths, up to 100 ppm from the reference.
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
type = "digital-input-16"
clock_bits = 32
drift_ppm = 20
cable_ns = 500
[[device]]
type = "servo"
drift_ppm = -60
cable_ns = 80
[[device]]
type = "digital-input-8"
clock_bits = 64
drift_ppm = 50
"#;
const COUNT: usize = 5;
/// Time limit until all clocks are locked.
const LOCK_LIMIT: Duration = Duration::from_secs(10);
/// From one edge to the next.
const PAUSE: Duration = Duration::from_millis(300);
/// Maximum spread of clocks inside a part, across both, and before the first cut: each is within 100 ns of its
/// reference.
const INSIDE_NS: i64 = 1_000;
const ACROSS_NS: i64 = 5_000;
const LOCKED_NS: i64 = 200;

/// Largest spread in each of these groups for a while.
fn watch(bench: &Bench, groups: [&[usize]; 3]) -> [i64; 3] {
    let until = Instant::now() + PAUSE;
    let mut worst = [0; 3];
    while Instant::now() < until {
        let shown: Vec<i64> =
            bench.order("clocks").split(' ').map(|shown| shown.parse().expect("all have clocks")).collect();
        for (worst, group) in worst.iter_mut().zip(groups) {
            let of = || group.iter().map(|device| shown[*device]);
            let spread = of().max().unwrap_or(0) - of().min().unwrap_or(0);
            *worst = spread.max(*worst);
        }
    }
    worst
}

// covers: 7.5, dc-ring
#[test]
fn clocks_of_a_ring_on_two_interfaces_stay_synchronous_through_cuts() {
    let Some(mut bench) = Bench::new(2) else { return };
    bench.simulate(RING, true);
    let run = bench.run_ringcat(&["clocks", "--main", "main0", "--redundant", "main1", "--for", "60s"]);
    let until = Instant::now() + LOCK_LIMIT;
    while !run.said().so_far().contains("all clocks are locked") {
        assert!(Instant::now() < until, "{}", run.said().so_far());
        std::thread::sleep(Duration::from_millis(10));
    }
    let all = [0, 1, 2, 3, 4];
    let (before, late) = (watch(&bench, [&all, &[], &all]), bench.simulator_lateness());
    println!("whole: {} ns", before[0]);
    assert!(before[0] <= LOCKED_NS, "{} ns", before[0]);
    for (what, parts) in [("main", 0), ("2-3", 3), ("redundant", COUNT)] {
        for verb in ["cut", "heal"] {
            let interface = if what == "main" { "sim0" } else { "sim1" };
            match (what, verb) {
                ("2-3", _) => drop(bench.order(&format!("{verb} {what}"))),
                (_, "cut") => bench.set_link(interface, "down"),
                _ => bench.set_link(interface, "up"),
            }
            let [front, behind, across] = watch(&bench, [&all[..parts], &all[parts..], &all]);
            println!("{verb} {what}: {front}, {behind} ns inside, {across} ns across");
            assert!(front.max(behind) <= INSIDE_NS, "{verb} {what}: {front}, {behind} ns");
            assert!(across <= ACROSS_NS, "{verb} {what}: {across} ns, the simulator {}", bench.simulator_lateness());
        }
    }
    println!("before: {late}");
    bench.show_simulator_lateness();
    let (output, errors) = run.interrupt();
    println!("{output}{errors}");
    assert!(!output.contains("clocks failed") && !errors.contains("clocks failed"), "{output}{errors}");
}
