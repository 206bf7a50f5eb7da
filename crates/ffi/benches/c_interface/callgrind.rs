//! Instructions within one function, by valgrind's callgrind, in the thread that calls it.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::segment::Bench;

/// Counted cycles, and those of a shorter run, whose cost is subtracted with the start.
const LONG: u64 = 600;
const SHORT: u64 = 200;
/// Under valgrind frames are back within this time.
const PERIOD_US: &str = "4000";

/// What a run cost.
#[derive(Clone, Debug, Default)]
struct Run {
    total: u64,
    /// Called functions with their calls.
    calls: BTreeMap<String, u64>,
}

/// Cost of a cycle.
#[derive(Clone, Debug)]
pub struct Cost {
    short: Run,
    long: Run,
}

impl Cost {
    /// Instructions per cycle.
    pub fn per_cycle(&self) -> f64 {
        (self.long.total - self.short.total) as f64 / (LONG - SHORT) as f64
    }

    /// The functions that a cycle calls, with their own calls, instructions per cycle.
    pub fn calls(&self) -> Vec<(&str, f64)> {
        let before = |name: &str| self.short.calls.get(name).copied().unwrap_or(0);
        let each = self.long.calls.iter().map(|(name, cost)| {
            let cost = cost.saturating_sub(before(name)) as f64 / (LONG - SHORT) as f64;
            (name.as_str(), cost)
        });
        each.filter(|(_, cost)| *cost >= 1.0).collect()
    }
}

/// Whether valgrind is installed.
pub fn is_installed() -> bool {
    Command::new("valgrind").arg("--version").stdout(Stdio::null()).status().is_ok_and(|status| status.success())
}

/// Counts instructions of a cycle of this program on the bus of the daemon.
pub fn cost(program: &Path, words: &[&str], bench: &Bench) -> Cost {
    let one = |count: u64| run(program, words, bench, count, || ());
    let (short, long) = (one(SHORT), one(LONG));
    Cost { short, long }
}

/// A run of this number of cycles; `meanwhile` begins when the SubDevices are in OP.
fn run(program: &Path, words: &[&str], bench: &Bench, count: u64, meanwhile: impl FnOnce()) -> Run {
    let directory = crate::library::workshop().join(format!("callgrind-{}-{count}", words.join("-")));
    let _ = std::fs::remove_dir_all(&directory);
    std::fs::create_dir_all(&directory).expect("it can be made");
    let mut valgrind = Command::new("valgrind");
    valgrind.args(["--tool=callgrind", "--quiet", "--compress-strings=no", "--compress-pos=no", "--fair-sched=yes"]);
    valgrind.args(["--separate-threads=yes", "--toggle-collect=measured*"]);
    valgrind.arg(format!("--callgrind-out-file={}/out", directory.display()));
    valgrind.arg(program).args(words).args(["cycles", PERIOD_US, &count.to_string()]);
    valgrind.env("RINGCAT_SOCKET", &bench.socket).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
    let mut child = valgrind.spawn().expect("valgrind is there");
    let mut lines = BufReader::new(child.stdout.take().expect("it is piped"));
    let mut line = String::new();
    lines.read_line(&mut line).expect("it is text");
    assert_eq!(line, "op\n", "{program:?} {words:?}");
    meanwhile();
    child.stdin.take().expect("it is piped").write_all(b"go\n").expect("it reads");
    line.clear();
    lines.read_line(&mut line).expect("it is text");
    let status = child.wait().expect("it ends");
    assert!(status.success() && line.starts_with("incomplete "), "{program:?}: {status}, {line}");
    let parsed = files(&directory).iter().map(|path| parse(path)).max_by_key(|run| run.total).expect("a file");
    std::fs::remove_dir_all(directory).expect("it is there");
    parsed
}

/// A file for each thread.
fn files(directory: &Path) -> Vec<PathBuf> {
    std::fs::read_dir(directory).expect("it is there").flatten().map(|entry| entry.path()).collect()
}

/// Reads the output for one thread: the total, and the inclusive cost of the calls of `measured`.
fn parse(path: &Path) -> Run {
    let text = std::fs::read_to_string(path).expect("it can be read");
    let (mut run, mut is_measured, mut called, mut is_cost) = (Run::default(), false, "", false);
    for line in text.lines() {
        if let Some(name) = line.strip_prefix("fn=") {
            is_measured = name.starts_with("measured");
        } else if let Some(name) = line.strip_prefix("cfn=") {
            called = name;
        } else if line.starts_with("calls=") {
            is_cost = true;
        } else if std::mem::take(&mut is_cost) {
            let cost: u64 = line.rsplit(' ').next().and_then(|word| word.parse().ok()).unwrap_or(0);
            if is_measured {
                *run.calls.entry(called.to_owned()).or_default() += cost;
            }
        } else if let Some(rest) = line.strip_prefix("totals:").or_else(|| line.strip_prefix("summary:")) {
            run.total = run.total.max(rest.split_whitespace().next().and_then(|word| word.parse().ok()).unwrap_or(0));
        }
    }
    run
}

/// Instructions of a cycle while `meanwhile` lasts: the whole run counts, without its start.
pub fn cost_beside(program: &Path, bench: &Bench, begin: impl Fn()) -> f64 {
    let one = |count: u64| run(program, &[], bench, count, &begin).total;
    (one(LONG) - one(SHORT)) as f64 / (LONG - SHORT) as f64
}
