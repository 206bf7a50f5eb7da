//! A ring of 16 in OP, with each of its cables cut and repaired: the host cables at either end, by switching the
//! interface off, the inner cables by the simulator. No SubDevice leaves OP, and no more cycles are incomplete than the
//! detection time of the cut and stalls of this machine explain; both are measured at each edge and printed. Each edge
//! is reported once, with the counts of both sides and its place. The test takes more than 20 s of cycles.

use std::time::{Duration, Instant};

use ringcat_wire::address::StationAddress;

use crate::bench::{Bench, SimulatorLateness, await_op};
use crate::said::Said;
use crate::{RING_OF_16, states};

const CYCLE_MS: f64 = 1.0;
/// From one edge to the next.
const PAUSE: Duration = Duration::from_millis(550);
/// A cut of the simulator's cables is detected after 10 us: within one cycle.
const INNER_ALLOWED: usize = 1;

/// A cut or repair, and its result.
struct Edge {
    what: String,
    incomplete: usize,
    /// Time from the command until the simulator detected it; for host cables only.
    noticed_ms: Option<f64>,
    simulator: SimulatorLateness,
    /// Cycles that RingCAT skipped because this machine stalled.
    left_out: usize,
    /// Messages about the ring and the links.
    told: Vec<String>,
}

impl Edge {
    /// Incomplete cycles that the detection of the cut explains: for an interface that is switched off
    /// `ceil(detection / cycle) + 1`.
    fn allowed(&self) -> usize {
        self.noticed_ms.map_or(INNER_ALLOWED, |ms| (ms / CYCLE_MS).ceil() as usize + 1)
    }

    /// Incomplete cycles that stalls explain: the cycles of each stall and one more.
    fn stalled(&self) -> usize {
        let SimulatorLateness { count, together_ms } = self.simulator;
        (together_ms / CYCLE_MS).ceil() as usize + count as usize + self.left_out
    }

    fn line(&self) -> String {
        format!(
            "{:<12} | {:>10} | {:>7} | {:>10} | {:>5} {:>8.1} | {:>8}",
            self.what,
            self.incomplete,
            self.allowed(),
            self.noticed_ms.map_or_else(|| "-".to_owned(), |ms| format!("{ms:.1}")),
            self.simulator.count,
            self.simulator.together_ms,
            self.left_out
        )
    }
}

/// Changes a cable and waits until the effects have ended.
fn edge(bench: &Bench, run: &Said, what: &str, noticed: Option<&str>, act: impl FnOnce()) -> Edge {
    let (late, begin) = (bench.simulator_lateness(), Instant::now());
    act();
    std::thread::sleep(PAUSE);
    let end = Instant::now();
    let lines: Vec<String> = run.between(begin, end).into_iter().map(|(_, line)| line).collect();
    let noticed_ms = noticed.map(|words| {
        let said = bench.simulator_said().between(begin, end);
        let line = said.iter().find(|(_, line)| line.ends_with(words));
        let (at, _) = line.unwrap_or_else(|| panic!("{what}: the simulator does not say \"{words}\": {said:?}"));
        at.duration_since(begin).as_secs_f64() * 1e3
    });
    let now = bench.simulator_lateness();
    let simulator =
        SimulatorLateness { count: now.count - late.count, together_ms: now.together_ms - late.together_ms };
    assert_eq!(states(bench, "OP"), 16, "{what}: {}", bench.order("status"));
    let incomplete = incomplete_cycles(&lines).unwrap_or_else(|| panic!("{what}: {lines:#?}"));
    let told = lines.iter().filter_map(|line| line.split_once(" ms  ")).map(|(_, words)| words.to_owned());
    let told =
        told.filter(|words| ["ring", "Line", "redundancy", "MAIN", "REDUNDANT"].iter().any(|it| words.starts_with(it)));
    Edge { what: what.to_owned(), incomplete, noticed_ms, simulator, left_out: left_out(&lines), told: told.collect() }
}

/// Checks the exact messages of a cut or repair of an inner cable.
fn check_words(edge: &Edge, device: usize, is_cut: bool) {
    let (main, redundant) = (device + 1, 15 - device);
    let expected: &[String] = if is_cut {
        &[
            format!("ring open: {main} SubDevices on MAIN, {redundant} on REDUNDANT"),
            "redundancy lost: the ring is open".into(),
        ]
    } else {
        &["redundancy restored: the ring tolerates one break".into()]
    };
    for words in expected {
        assert_eq!(edge.told.iter().filter(|told| *told == words).count(), 1, "{}: {:?}", edge.what, edge.told);
    }
    let places: Vec<&String> = edge.told.iter().filter(|told| told.starts_with("Line")).collect();
    let [place] = places[..] else { panic!("{}: {places:?}", edge.what) };
    let ends = [format!("between SubDevice {device} "), format!("port 1 and SubDevice {} ", device + 1)];
    let station = StationAddress(0x1001 + device as u16 + 1);
    let (begin, end) = match is_cut {
        true => ("Line break ", format!("port 0 ({station})")),
        false => ("Line is fixed ", format!("port 0 ({station}): ring closed, 16 SubDevices on MAIN")),
    };
    let is_right = ends.iter().all(|end| place.contains(end)) && place.starts_with(begin) && place.ends_with(&end);
    assert!(is_right, "{}: {place}", edge.what);
}

/// Number of incomplete cycles, from the times of the evaluations; `None` if the last one was incomplete.
pub fn incomplete_cycles(lines: &[String]) -> Option<usize> {
    let (mut since, mut cycles) = (None, 0);
    for line in lines {
        let Some((ms, judgement)) = line.split_once(" ms  domain 0: ") else { continue };
        if judgement.starts_with("cycle skipped") {
            // No evaluation: the frames of the cycle before were still under way.
            continue;
        }
        let at: f64 = ms.trim().parse().ok()?;
        match (judgement.starts_with("complete"), since) {
            (false, None) => since = Some(at),
            (true, Some(begin)) => {
                cycles += ((at - begin) / CYCLE_MS).round().max(1.0) as usize;
                since = None;
            }
            _ => {}
        }
    }
    since.is_none().then_some(cycles)
}

/// Cycles that RingCAT reports as skipped.
pub fn left_out(lines: &[String]) -> usize {
    let counts = lines.iter().filter_map(|line| line.split_once(" ms  this machine: "));
    counts.map(|(_, rest)| rest.split(' ').next().and_then(|count| count.parse::<usize>().ok()).expect("a count")).sum()
}

// covers: ring-interfaces, run
#[test]
fn cuts_of_16_on_interfaces_cost_only_detection_time_and_stalls() {
    let Some(mut bench) = Bench::new(2) else { return };
    bench.simulate(&RING_OF_16.segment(), true);
    let run = bench.run_ringcat(&["run", "--main", "main0", "--redundant", "main1", "--all-events"]);
    await_op(&bench, 16);
    std::thread::sleep(PAUSE);
    let mut edges = Vec::new();
    for interface in ["main0", "main1", "sim0", "sim1"] {
        for (state, noticed) in [("down", "carrier is gone"), ("up", "carrier is back")] {
            let what = format!("{interface} {state}");
            edges.push(edge(&bench, run.said(), &what, Some(noticed), || bench.set_link(interface, state)));
        }
    }
    for device in 0..15 {
        for verb in ["cut", "heal"] {
            let order = format!("{verb} {device}-{}", device + 1);
            let edge = edge(&bench, run.said(), &order, None, || {
                bench.order(&order);
            });
            check_words(&edge, device, verb == "cut");
            edges.push(edge);
        }
    }
    let (output, errors) = run.interrupt();
    println!("ring of 16, 1 ms; late wake-ups of the simulator: how many, and by how many ms in all");
    println!("edge         | incomplete | allowed | noticed ms | simulator late | left out");
    edges.iter().for_each(|edge| println!("{}", edge.line()));
    let summary = output.find("\nsummary").map_or("", |at| &output[at + 1..]);
    println!("ringcat run, ring of 16, {} edges:\n{summary}", edges.len());
    bench.show_simulator_lateness();
    for edge in &edges {
        let (incomplete, allowed, stalled) = (edge.incomplete, edge.allowed(), edge.stalled());
        assert!(incomplete <= allowed + stalled, "{}: {incomplete} of {allowed} + {stalled}", edge.what);
    }
    for (part, count) in [("ring open", 19), ("ring closed", 19), ("Line break between", 19), ("no longer answers", 0)]
    {
        assert_eq!(output.matches(part).count(), count, "{part}: {output}{errors}");
    }
    assert!(output.contains("ring open: 8 SubDevices on MAIN, 8 on REDUNDANT"), "{output}");
    assert!(output.contains("stopped: outputs zero, all SubDevices in INIT"), "{output}{errors}");
}
