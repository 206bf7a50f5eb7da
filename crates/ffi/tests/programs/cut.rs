//! A cable is cut, repaired and disturbed under a program in C: the lines of the manual on its standard error.

use std::io::{BufRead, BufReader};
use std::process::{ChildStderr, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use ringcat::sim::cable::CableId;
use ringcat::sim::fault::Fault;

use crate::daemon::{Bench, wait_for_line};
use crate::library::{here, program, workshop};

/// The cable to the first SubDevice.
const FIRST: CableId = CableId(0);
/// The cable between both.
const SECOND: CableId = CableId(1);
/// A busy machine delays a line at most for so long.
const LONG: Duration = Duration::from_secs(30);

/// Lines of a program as they come.
struct Reported {
    lines: Receiver<String>,
    all: Vec<String>,
}

impl Reported {
    fn new(stderr: ChildStderr) -> Reported {
        let (sender, lines) = channel();
        std::thread::spawn(move || {
            let lines = BufReader::new(stderr).lines().map_while(Result::ok);
            lines.map(|line| sender.send(line)).take_while(Result::is_ok).count()
        });
        Reported { lines, all: Vec::new() }
    }

    /// Waits until lines begin so and contain this, in any order, from this call on.
    fn wait_for(&mut self, wanted: &[(&str, &str)]) {
        let (begin, first) = (Instant::now(), self.all.len());
        let is = |line: &str, (start, part): &(&str, &str)| {
            line.strip_prefix("EtherCAT: ").is_some_and(|line| line.starts_with(start) && line.contains(part))
        };
        while !wanted.iter().all(|wanted| self.all[first..].iter().any(|line| is(line, wanted))) {
            let line = self.lines.recv_timeout(LONG.saturating_sub(begin.elapsed()));
            let line = line.unwrap_or_else(|_| panic!("{wanted:?} did not all come: {:#?}", self.all));
            self.all.push(line);
        }
    }
}

// covers: c-interface, daemon
#[test]
fn a_cut_cable_under_a_program_is_reported_in_the_lines_of_the_manual() {
    let Some(cut) = program(&here().join("tests/c/cut.c"), &[]) else { return };
    let segment = workshop().join("cut.toml");
    std::fs::write(&segment, "[segment]\n[[device]]\ntype = \"digital-output-8\"\ncount = 2\n").expect("a file");
    let bench = Bench::start(&segment, "cut");
    let apply = |fault: Fault| bench.inside(move |segment| segment.network_mut().apply(fault));
    let mut child = bench.command(&cut).stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it runs");
    let mut reported = Reported::new(child.stderr.take().expect("it is piped"));
    let lines = wait_for_line(&mut child, "op");
    reported.wait_for(&[("Link state changed to UP.", ""), ("WARNING: ", "SKIPPED!")]);
    apply(Fault::Cut(SECOND));
    // At once, or with the summary of a second.
    reported.wait_for(&[("Slave(s) responding: 1.", ""), ("Domain 0: ", " 1/2.")]);
    apply(Fault::Cut(FIRST));
    let down = [
        ("Link state changed to DOWN.", ""),
        ("Slave(s) responding: 0.", ""),
        ("Domain 0: ", " 0/2."),
        ("WARNING: ", " TIMED OUT!"),
    ];
    reported.wait_for(&down);
    apply(Fault::Heal(FIRST));
    apply(Fault::Heal(SECOND));
    let up = [("Link state changed to UP.", ""), ("Slave(s) responding: 2.", ""), ("Slave states: OP.", "")];
    reported.wait_for(&up);
    // Frames that arrive twice.
    apply(Fault::Duplicate { cable: FIRST, direction: None, count: 1000 });
    reported.wait_for(&[("WARNING: ", " UNMATCHED!")]);
    drop((child.stdin.take(), lines));
    assert!(child.wait().expect("it ends").success(), "{:#?}", reported.all);
    bench.wait_for_preop();
}
