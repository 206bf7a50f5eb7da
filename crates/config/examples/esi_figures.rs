//! Time and memory of reading device descriptions:
//! `cargo run --release -p ringcat-config --example esi_figures -- DIR`.
//!
//! Prints the best of five reads of each file, their sum, and the largest resident memory of a process that holds one
//! file. The bars of `docs/esi.md` are checked; the last line says what did not hold.

use std::process::{Command, ExitCode};
use std::time::{Duration, Instant};
use std::{env, fs};

use ringcat_config::esi::{NoReferences, read_with};

/// Largest resident memory of a read.
const MEMORY_KIB: u64 = 50 << 10;
/// Mark of the process that reads one file for its memory.
const ONE: &str = "--memory-of";

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    match &arguments[..] {
        [mark, file] if mark == ONE => {
            let bytes = fs::read(file).expect("the file was there");
            let esi = read_with(file, &bytes, &NoReferences).expect("the file was read");
            println!("{} {}", resident_kib(), esi.devices.len());
            ExitCode::SUCCESS
        }
        [folder] => figures(folder),
        _ => {
            eprintln!("expected a folder of device descriptions");
            ExitCode::from(2)
        }
    }
}

fn figures(folder: &str) -> ExitCode {
    let Ok(entries) = fs::read_dir(folder) else {
        eprintln!("{folder} cannot be read");
        return ExitCode::from(2);
    };
    let mut files: Vec<_> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    files.retain(|path| path.extension().is_some_and(|ending| ending == "xml"));
    files.sort();
    let (mut missed, mut all) = (Vec::new(), Duration::ZERO);
    for path in &files {
        let name = path.display().to_string();
        let bytes = fs::read(path).unwrap_or_default();
        let best = (0..5).map(|_| time(&name, &bytes)).min().unwrap_or_default();
        all += best;
        let limit = if bytes.len() > 2_500_000 { 200 } else { 100 };
        let memory = memory_of(&name);
        println!("{name}: {} bytes, {:.1} ms, {memory} KiB", bytes.len(), best.as_secs_f64() * 1e3);
        if best > Duration::from_millis(limit) || memory > MEMORY_KIB {
            missed.push(name);
        }
    }
    println!("{} files, {:.1} ms in all", files.len(), all.as_secs_f64() * 1e3);
    if missed.is_empty() {
        println!("result: ok: each within its time and {MEMORY_KIB} KiB");
        return ExitCode::SUCCESS;
    }
    println!("result: FAILED: beyond a bar: {}", missed.join(", "));
    ExitCode::FAILURE
}

fn time(name: &str, bytes: &[u8]) -> Duration {
    let begin = Instant::now();
    let esi = read_with(name, bytes, &NoReferences);
    let time = begin.elapsed();
    drop(esi);
    time
}

/// Largest resident memory of a process of its own that reads the file.
fn memory_of(name: &str) -> u64 {
    let program = env::current_exe().expect("a running program has a file");
    let output = Command::new(program).args([ONE, name]).output().map(|output| output.stdout).unwrap_or_default();
    String::from_utf8_lossy(&output).split(' ').next().and_then(|number| number.parse().ok()).unwrap_or(u64::MAX)
}

/// `VmHWM` of this process.
fn resident_kib() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|text| text.trim().split(' ').next()?.parse().ok()).unwrap_or(u64::MAX)
}
