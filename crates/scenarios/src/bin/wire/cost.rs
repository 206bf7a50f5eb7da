//! What a cycle costs by itself: round trips against a bare client, system calls, the largest rate.

use std::process::{Command, Stdio};

use scenarios::figures::{Figures, of_blocks};

use crate::bench::{TEN, Tried, Wire, after};
use crate::programs::Pace;

/// A cycle on the wire against a bare client, by the bytes of the frame.
const ROUND_TRIP_BARS: [(&str, f64); 2] = [("60", 1.3), ("1500", 1.2)];
/// Cycles of the shorter and the longer run whose system calls are counted.
const COUNTED: [u32; 2] = [2_000, 12_000];

impl Wire {
    pub fn round_trips(&self, figures: &mut Figures) -> Tried<()> {
        let _echo = self.serve(&["bench", "echo"])?;
        for (size, bar) in ROUND_TRIP_BARS {
            let [mut bare, mut whole, mut ratios] = [const { Vec::new() }; 3];
            for _ in 0..self.blocks() {
                // Pairs of blocks alternate within.
                let said = self.bench(&["round-trip", "--size", size, "--count", "10000", "--blocks", "10"])?;
                bare.push(after(&said, "bare echo client median")?);
                whole.push(after(&said, "MainDevice median")?);
                ratios.push(after(&said, "median ratio")?);
            }
            figures.show(&format!("{size} bytes, spinning, bare echo client"), of_blocks(&bare, "us"));
            figures.show(&format!("{size} bytes, spinning, MainDevice"), of_blocks(&whole, "us"));
            figures.at_most_in_blocks(&format!("{size} bytes, ratio"), &ratios, bar, "x");
        }
        Ok(())
    }

    pub fn system_calls(&self, figures: &mut Figures) -> Tried<()> {
        if Command::new("strace").arg("-V").stdout(Stdio::null()).status().is_err() {
            println!("  skipped: strace is not installed");
            return Ok(());
        }
        let _echo = self.serve(&["bench", "echo"])?;
        let (of_any_kind, sends) = self.calls_per_cycle(&[])?;
        figures.at_most("of any kind", of_any_kind, 1.0, "calls per cycle");
        figures.show("of these, sendto", format!("{sends:.2} calls per cycle"));
        // Their number depends on time, not on cycles, and strace makes a cycle take twenty times as long.
        let (with_others, _) = self.calls_per_cycle(&["-f"])?;
        let name = "with the thread that polls the carrier every 5 ms";
        figures.show(name, format!("{with_others:.2} calls per cycle under strace"));
        figures.show("calls that allocate or lock", "counted by ci/bench: none");
        Ok(())
    }

    /// System calls of a cycle, of any kind and `sendto`; of the cyclic thread unless `flags` of strace include others.
    fn calls_per_cycle(&self, flags: &[&str]) -> Tried<(f64, f64)> {
        let mut calls = Vec::new();
        for count in COUNTED.map(|count| count.to_string()) {
            let mut command = self.namespaces.near("strace");
            command.args(flags).args(["-c", "-U", "calls,name", "-o", "/dev/stderr"]).arg(self.ringcat());
            command.args(["bench", "round-trip", "--blocks", "0", "--count", &count]);
            command.args(["--main", "near0", "--receive", "busy", "--cpu", "0"]);
            let output = command.output().map_err(|error| error.to_string())?;
            let table = String::from_utf8_lossy(&output.stderr).into_owned();
            let number = |name: &str| {
                let row = table.lines().find(|line| line.split_whitespace().last() == Some(name));
                row.and_then(|row| row.split_whitespace().next()?.parse::<f64>().ok())
            };
            let total = number("total").ok_or_else(|| format!("strace has no total: {table}"))?;
            calls.push((total, number("sendto").unwrap_or_default()));
        }
        let cycles = f64::from(COUNTED[1] - COUNTED[0]);
        // Some belong to the longer run as a whole, such as memory for its times: less than one per hundred cycles.
        let per_cycle = ((calls[1].0 - calls[0].0) / cycles * 100.0).round() / 100.0;
        Ok((per_cycle, (calls[1].1 - calls[0].1) / cycles))
    }

    pub fn rate(&self, figures: &mut Figures) -> Tried<()> {
        let _simulator = self.simulate(TEN, Pace::RealTime)?;
        let said = self.bench(&["rate"])?;
        said.lines().filter(|line| line.starts_with("every")).for_each(|line| println!("  {line}"));
        let rate = after(&said, "largest rate without a skipped cycle")?;
        figures.show("largest rate without a cycle skipped but by stalls", format!("{rate:.0} Hz"));
        Ok(())
    }
}
