//! A ring of 16 in OP, with each of its cables cut and repaired: the host cables at either end, by switching the
//! interface off, the inner cables by the simulator. No SubDevice leaves OP, and no more cycles are incomplete than the
//! detection time of the cut and stalls of this machine explain; both are measured at each edge and printed. Each edge
//! is reported once, with the counts of both sides and its place. The test takes more than 20 s of cycles. At most two
//! cables are cut and repaired once more where neither explains what an edge cost.

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
/// Cables that may be cut and repaired once more, of 19: a stall in the kernel, or one of less than a cycle, is
/// measured neither by the simulator nor by RingCAT, and would be taken for a fault.
const REPEATED: usize = 2;

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
    reports: Vec<String>,
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

    fn is_explained(&self) -> bool {
        self.incomplete <= self.allowed() + self.stalled()
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

/// A cable of the ring.
#[derive(Clone, Copy)]
enum Cable {
    /// At an interface, which is switched off and on.
    Host(&'static str),
    /// Behind this SubDevice, cut and repaired by the simulator.
    Inner(usize),
}

impl Cable {
    fn change(self, bench: &Bench, run: &Said, is_repair: bool) -> Edge {
        match self {
            Cable::Host(interface) => {
                let (state, noticed) = if is_repair { ("up", "carrier is back") } else { ("down", "carrier is gone") };
                let what = format!("{interface} {state}");
                edge(bench, run, &what, Some(noticed), || bench.set_link(interface, state))
            }
            Cable::Inner(device) => {
                let order = format!("{} {device}-{}", if is_repair { "heal" } else { "cut" }, device + 1);
                let edge = edge(bench, run, &order, None, || {
                    bench.order(&order);
                });
                check_words(&edge, device, !is_repair);
                edge
            }
        }
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
    let reports = lines.iter().filter_map(|line| line.split_once(" ms  ")).map(|(_, words)| words.to_owned());
    let reports = reports
        .filter(|words| ["ring", "Line", "redundancy", "MAIN", "REDUNDANT"].iter().any(|it| words.starts_with(it)));
    Edge {
        what: what.to_owned(),
        incomplete,
        noticed_ms,
        simulator,
        left_out: left_out(&lines),
        reports: reports.collect(),
    }
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
        assert_eq!(
            edge.reports.iter().filter(|reports| *reports == words).count(),
            1,
            "{}: {:?}",
            edge.what,
            edge.reports
        );
    }
    let places: Vec<&String> = edge.reports.iter().filter(|reports| reports.starts_with("Line")).collect();
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

/// Number of incomplete cycles, and of cycles that were skipped between the first of them and the next complete one;
/// `None` if the last evaluated one was incomplete.
pub fn incomplete_cycles(lines: &[String]) -> Option<usize> {
    let (mut is_complete, mut skipped, mut cycles) = (true, 0, 0);
    for line in lines {
        let Some((_, status)) = line.split_once(" ms  domain 0: ") else { continue };
        if status.starts_with("cycle skipped") {
            // No evaluation: the frames of the cycle before were still under way.
            skipped += usize::from(!is_complete);
            continue;
        }
        is_complete = status.starts_with("complete");
        if is_complete {
            let counted = status.split_once(", after ").and_then(|(_, rest)| rest.split(' ').next());
            cycles += counted.map_or(0, |count| count.parse().expect("a number of cycles")) + skipped;
            skipped = 0;
        }
    }
    is_complete.then_some(cycles)
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
    let host = ["main0", "main1", "sim0", "sim1"].map(Cable::Host);
    let (mut edges, mut repeated) = (Vec::new(), Vec::new());
    for cable in host.into_iter().chain((0..15).map(Cable::Inner)) {
        let mut pair = [false, true].map(|is_repair| cable.change(&bench, run.said(), is_repair));
        if repeated.len() < REPEATED && !pair.iter().all(Edge::is_explained) {
            repeated.extend(pair);
            pair = [false, true].map(|is_repair| cable.change(&bench, run.said(), is_repair));
        }
        edges.extend(pair);
    }
    let (output, errors) = run.interrupt();
    println!("ring of 16, 1 ms; late wake-ups of the simulator: how many, and by how many ms in all");
    println!("edge         | incomplete | allowed | noticed ms | simulator late | left out");
    edges.iter().for_each(|edge| println!("{}", edge.line()));
    repeated.iter().for_each(|edge| println!("{} not explained, repeated above", edge.line()));
    let summary = output.find("\nsummary").map_or("", |at| &output[at + 1..]);
    println!("ringcat run, ring of 16, {} edges:\n{summary}", edges.len());
    bench.show_simulator_lateness();
    for edge in &edges {
        let (incomplete, allowed, stalled) = (edge.incomplete, edge.allowed(), edge.stalled());
        assert!(edge.is_explained(), "{}: {incomplete} of {allowed} + {stalled}", edge.what);
    }
    let pairs = (edges.len() + repeated.len()) / 2;
    for (part, count) in
        [("ring open", pairs), ("ring closed", pairs), ("Line break between", pairs), ("no longer answers", 0)]
    {
        assert_eq!(output.matches(part).count(), count, "{part}: {output}{errors}");
    }
    assert!(output.contains("ring open: 8 SubDevices on MAIN, 8 on REDUNDANT"), "{output}");
    assert!(output.contains("stopped: outputs zero, all SubDevices in INIT"), "{output}{errors}");
}
