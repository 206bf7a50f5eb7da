//! Compares ways into the kernel: blocks of all alternate, medians of the blocks count.

use std::process::Command;

use crate::{Bench, Failed, NAMES, Outcome};

/// Blocks of each path.
const BLOCKS: usize = 5;
/// Round trips of a block, spinning and sleeping.
const COUNTS: [&str; 2] = ["30000", "5000"];
/// Round trips of the shorter and the longer run whose instructions are counted.
const COUNTED: [usize; 2] = [200, 1_200];

/// Measures all of them against a spinning echo.
pub fn compare() -> Outcome {
    let bench = Bench::new("busy")?;
    for size in ["60", "1500"] {
        println!("{size} bytes, medians of {BLOCKS} alternating blocks (lowest to highest block):");
        let mut medians = NAMES.map(|_| Vec::new());
        let mut cpu = NAMES.map(|_| Vec::new());
        let mut refused = NAMES.map(|_| None);
        for _ in 0..BLOCKS {
            for (place, name) in NAMES.iter().enumerate() {
                match ping(&bench, name, size) {
                    Ok([median, share]) => {
                        medians[place].push(median);
                        cpu[place].push(share);
                    }
                    Err(reason) => refused[place] = Some(reason.to_string()),
                }
            }
        }
        for (place, name) in NAMES.iter().enumerate() {
            let (times, cpu) = (&mut medians[place], &mut cpu[place]);
            if times.is_empty() {
                println!("  {name:<24} refused: {}", refused[place].as_deref().unwrap_or("no reason"));
                continue;
            }
            times.sort_unstable_by(f64::total_cmp);
            cpu.sort_unstable_by(f64::total_cmp);
            println!(
                "  {name:<24} {:6.2} us ({:.2} to {:.2}), CPU {:6.2} us",
                times[times.len() / 2],
                times[0],
                times[times.len() - 1],
                cpu[cpu.len() / 2],
            );
        }
    }
    instructions(&bench)
}

/// Median round trip and CPU time per round trip, in microseconds.
fn ping(bench: &Bench, path: &str, size: &str) -> Result<[f64; 2], Failed> {
    let count = COUNTS[usize::from(path.ends_with("block"))];
    let mut command = bench.near(std::env::current_exe()?);
    command.args(["ping", "near", "--path", path, "--size", size, "--count", count, "--cpu", "0"]);
    let output = command.output()?;
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).trim().into());
    }
    if !said.contains("lost 0, wrong 0") {
        return Err(format!("frames were lost: {said}").into());
    }
    let figure = |name: &str| {
        let rest = said.split_once(name).map(|(_, rest)| rest.split_whitespace().next().unwrap_or_default());
        rest.and_then(|figure| figure.parse::<f64>().ok()).ok_or_else(|| format!("no {name} in {said}"))
    };
    Ok([figure("median ")?, figure("CPU ")?])
}

/// User-side instructions per round trip: the difference of two runs under callgrind.
fn instructions(bench: &Bench) -> Outcome {
    if Command::new("valgrind").arg("--version").output().is_err() {
        println!("instructions: skipped, valgrind is not installed");
        return Ok(());
    }
    println!("user-side instructions per round trip, clocks by vDSO not included:");
    for name in NAMES.iter().filter(|name| name.ends_with("block")) {
        let mut collected: Vec<f64> = Vec::new();
        for count in COUNTED.map(|count| count.to_string()) {
            let mut command = bench.near("valgrind");
            command.args(["--tool=callgrind", "--callgrind-out-file=/dev/null"]).arg(std::env::current_exe()?);
            command.args(["ping", "near", "--path", name, "--count", &count]);
            let output = command.output()?;
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            let total =
                said.split_once("Collected : ").and_then(|(_, rest)| rest.split_whitespace().next()?.parse().ok());
            match total.filter(|_| output.status.success()) {
                Some(total) => collected.push(total),
                None => println!("  {name:<24} refused: {}", said.trim().lines().last().unwrap_or_default()),
            }
        }
        if let [shorter, longer] = collected[..] {
            let per_round = (longer - shorter) / (COUNTED[1] - COUNTED[0]) as f64;
            println!("  {name:<24} {per_round:6.0}");
        }
    }
    Ok(())
}
