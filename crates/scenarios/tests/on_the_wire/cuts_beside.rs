//! The same schedule of cuts and repairs for pysoem with two interfaces and for RingCAT, on the same simulated ring:
//! incomplete cycles of both.

use std::io::{BufRead, BufReader};
use std::time::{Duration, Instant};

use crate::bench::{Bench, await_op, is_asked_for};
use crate::cables::{incomplete_cycles, left_out};
use crate::foreign::{FOREIGN, NO_CACHE, python, start};
use crate::{RING_OF_16, states};

/// Inner cables, by the SubDevice before them.
const CUT: [usize; 8] = [0, 14, 7, 3, 11, 5, 9, 1];
/// From one edge to the next.
const PAUSE: Duration = Duration::from_millis(250);
/// Duration of the cycles: the schedule and a little more.
const SECONDS: u64 = 5;

/// Cuts and repairs one cable after the other.
fn schedule(bench: &Bench) {
    std::thread::sleep(PAUSE);
    for device in CUT {
        for verb in ["cut", "heal"] {
            bench.order(&format!("{verb} {device}-{}", device + 1));
            std::thread::sleep(PAUSE);
        }
    }
}

// covers: ring-interfaces, run
#[test]
fn pysoem_and_ours_run_with_the_same_cuts_of_a_ring() {
    if !is_asked_for(FOREIGN) {
        return;
    }
    let Some(mut bench) = Bench::new(2) else { return };
    let edges = 2 * CUT.len();
    println!("ring of 16, 1 ms, {edges} cuts and repairs of inner cables");
    if let Some(python) = python() {
        bench.simulate(&RING_OF_16.segment(), true);
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/on_the_wire/pysoem_cuts.py");
        let arguments = [NO_CACHE, script, "main0,main1", "16", &SECONDS.to_string()].map(str::to_owned);
        let mut child = start(&bench, &python, &arguments);
        let mut lines = BufReader::new(child.stdout.take().expect("it is piped")).lines();
        if lines.next().is_some_and(|line| line.is_ok_and(|line| line == "in OP")) {
            schedule(&bench);
        }
        let said = lines.next().and_then(Result::ok).unwrap_or_else(|| "it ended early".to_owned());
        println!("pysoem:  {said}");
        bench.show_simulator_lateness();
        let _ = child.wait();
    } else {
        println!("pysoem:  not measured, it is not installed");
    }
    bench.simulate(&RING_OF_16.segment(), true);
    let run = bench.run_ringcat(&["run", "--main", "main0", "--redundant", "main1", "--tell-all"]);
    await_op(&bench, 16);
    let begin = Instant::now();
    schedule(&bench);
    let end = Instant::now();
    let in_op = states(&bench, "OP");
    let lines: Vec<String> = run.said().between(begin, end).into_iter().map(|(_, line)| line).collect();
    let (wrong, late) = (incomplete_cycles(&lines), left_out(&lines));
    if wrong.is_none() {
        // The last evaluation is incomplete: print the output before it.
        lines.iter().rev().take(6).rev().for_each(|line| println!("  {line}"));
    }
    let wrong = wrong.map_or_else(|| "?".to_owned(), |cycles| cycles.to_string());
    let cycles = end.duration_since(begin).as_millis();
    println!("RingCAT: cycles {cycles} wrong {wrong} left out {late} op {in_op}");
    let (output, errors) = run.interrupt();
    bench.show_simulator_lateness();
    assert_eq!(in_op, 16, "{output}{errors}");
    for (words, count) in [("ring open:", CUT.len()), ("Line is fixed", CUT.len()), ("no longer answers", 0)] {
        assert_eq!(output.matches(words).count(), count, "{words}: {output}{errors}");
    }
}
