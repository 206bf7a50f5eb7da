//! Distributed clocks on interfaces. The simulator's clocks run in the segment's own time, which follows this machine's, so
//! what they latch is exact however late this machine is: that clocks lock is judged. How far cycles are from their
//! phase depends on this machine, and is printed.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use crate::bench::{Bench, finish};
use crate::said;

/// A line with clocks of both widths that drift, one SubDevice without a clock, and cables of different lengths.
const LINE: &str = r#"
[[device]]
type = "digital-input-8"
clock_bits = 64
drift_ppm = 30
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
drift_ppm = 50
cable_ns = 80
"#;
/// SubDevices have to be in OP, and programs to end, within.
const LIMIT: Duration = Duration::from_secs(20);
fn file(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("ringcat-wire-clocks-{}-{name}", std::process::id()))
}

#[test]
fn clocks_on_interfaces_lock_start_their_signals_and_cycles_follow_them_facts_7_3_facts_7_4() {
    let Some(mut bench) = Bench::new(1) else { return };
    bench.simulate(LINE, false);
    let plot = file("plot.svg");
    let path = plot.display().to_string();
    let clocks = ["clocks", "--main", "main0", "--sync", "auto", "--for", "500ms", "--plot", &path];
    let (text, errors) = said(&bench.ringcat(&clocks));
    println!("{text}{errors}");
    assert!(text.contains("all clocks are locked") && text.contains("SYNC0 1000"), "{text}{errors}");
    let picture = std::fs::read_to_string(&plot).expect("it was drawn");
    std::fs::remove_file(&plot).expect("it was drawn");
    assert!(picture.contains("</svg>") && picture.matches("<title>").count() >= 4);

    let sync = ["--sync", "1:500us:1ms+100us", "--sync", "4:2ms-250us", "--phase", "-300us"];
    let run = bench.run_ringcat(&[&["run", "--main", "main0", "--for", "800ms"][..], &sync].concat());
    let until = Instant::now() + LIMIT;
    while !run.said().so_far().contains("all SubDevices are in OP") {
        assert!(Instant::now() < until, "{}", run.said().so_far());
        std::thread::sleep(Duration::from_millis(20));
    }
    let registers = |device: usize| bench.order(&format!("register {device} 0x0980 2"));
    let cycles = |device: usize| bench.order(&format!("register {device} 0x09a0 8"));
    assert_eq!((registers(1), cycles(1)), ("0007".to_owned(), "20a10700c0270900".to_owned()));
    assert_eq!((registers(4), cycles(4)), ("0003".to_owned(), "80841e0000000000".to_owned()));
    let (text, errors) = run.finish(LIMIT);
    println!("{text}{errors}");
    bench.show_simulator_lateness();
    assert!(text.contains("clocks: 4 of 4 locked") && text.contains("cycles from their phase"), "{text}{errors}");

    let wrong = finish(bench.start_ringcat(&["run", "--main", "main0", "--sync", "2:1ms"]));
    assert_eq!(wrong.status.code(), Some(2));
    assert!(
        said(&wrong).1.contains("SubDevice 2 \"digital-output-8-3\" has no distributed clock"),
        "{:?}",
        said(&wrong)
    );
}
