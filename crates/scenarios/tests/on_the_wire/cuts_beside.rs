//! The same schedule of cuts and repairs for pysoem with two interfaces and for RingCAT, which sends lost frames again
//! or not, on the same simulated ring: incomplete cycles of all. And an undisturbed run: frames that were sent again.

use std::io::{BufRead, BufReader};
use std::time::{Duration, Instant};

use crate::bench::{Bench, await_op, is_asked_for};
use crate::cables::{incomplete_cycles, left_out};
use crate::foreign::{FOREIGN, NO_CACHE, python, start};
use crate::{RING_OF_10, states};

/// Inner cables, by the SubDevice before them.
const CUT: [usize; 8] = [0, 8, 4, 2, 7, 3, 5, 1];
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

/// The schedule during a run of RingCAT; prints what it cost.
fn ours(bench: &mut Bench, resend: &str) {
    bench.simulate(&RING_OF_10.segment(), true);
    let run =
        bench.run_ringcat(&["run", "--main", "main0", "--redundant", "main1", "--all-events", "--resend", resend]);
    await_op(bench, 10);
    let begin = Instant::now();
    schedule(bench);
    let end = Instant::now();
    let in_op = states(bench, "OP");
    let lines: Vec<String> = run.said().between(begin, end).into_iter().map(|(_, line)| line).collect();
    let (wrong, late) = (incomplete_cycles(&lines), left_out(&lines));
    if wrong.is_none() {
        // The last evaluation is incomplete: print the output before it.
        lines.iter().rev().take(6).rev().for_each(|line| println!("  {line}"));
    }
    let wrong = wrong.map_or_else(|| "?".to_owned(), |cycles| cycles.to_string());
    let cycles = end.duration_since(begin).as_millis();
    let (output, errors) = run.interrupt();
    println!("RingCAT, --resend {resend}: cycles {cycles} wrong {wrong} left out {late} op {in_op}");
    output.lines().filter(|line| line.starts_with("  lost frames:")).for_each(|line| println!("{line}"));
    bench.show_simulator_lateness();
    assert_eq!(in_op, 10, "{output}{errors}");
    for (words, count) in [("ring open:", CUT.len()), ("Line is fixed", CUT.len()), ("no longer answers", 0)] {
        assert_eq!(output.matches(words).count(), count, "{words}: {output}{errors}");
    }
    let says = output.contains(" sent again, ");
    assert_eq!(says, resend == "always", "{output}{errors}");
}

// covers: ring-interfaces, run, lost-frames
#[test]
fn pysoem_and_ours_run_with_the_same_cuts_of_a_ring() {
    let Some(mut bench) = Bench::new(2) else { return };
    println!("ring of 10, 1 ms, {} cuts and repairs of inner cables", 2 * CUT.len());
    if is_asked_for(FOREIGN)
        && let Some(python) = python()
    {
        bench.simulate(&RING_OF_10.segment(), true);
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/on_the_wire/pysoem_cuts.py");
        let arguments = [NO_CACHE, script, "main0,main1", "10", &SECONDS.to_string()].map(str::to_owned);
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
        println!("pysoem:  not measured, it is not installed or {FOREIGN} is not set");
    }
    for resend in ["never", "always"] {
        ours(&mut bench, resend);
    }
}

// covers: ring-interfaces, run, lost-frames
#[test]
fn an_undisturbed_run_prints_the_frames_that_were_sent_again() {
    let Some(mut bench) = Bench::new(2) else { return };
    bench.simulate(&RING_OF_10.segment(), true);
    let run = bench.ringcat(&["run", "--main", "main0", "--redundant", "main1", "--resend", "always", "--for", "20s"]);
    let output = String::from_utf8_lossy(&run.stdout).into_owned();
    let shown = ["  cycles:", "  this machine:", "  the wire:", "  lost frames:", "  round trips:"];
    let lines: Vec<&str> = output.lines().filter(|line| shown.iter().any(|begin| line.starts_with(begin))).collect();
    println!("ring of 10, 1 ms, 20 s undisturbed, --resend always");
    lines.iter().for_each(|line| println!("{line}"));
    bench.show_simulator_lateness();
    assert_eq!(lines.len(), shown.len(), "{output}");
}
