//! Figures of descriptions of networks and devices, each with its bar: `target/release/descriptions [DIR]`.
//!
//! Reads each device description (ESI) of a folder, without an argument of `../shared/data/esi` beside the repository:
//! the best of five reads, and the largest resident memory of a process that holds it. Opens the folder without and
//! with a kept index, the best of three each. Makes a network file of a simulated segment of 100 SubDevices with the
//! program `ringcat` beside this one. Fails where a bar is missed; a folder that is not there is skipped.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::time::{Duration, Instant};
use std::{env, fs};

use ringcat::esi::EsiFolder;
use ringcat_config::esi::{NoReferences, read_with};

/// Resident memory of a process that holds a description.
const MEMORY_KIB: u64 = 50 << 10;
/// Reading a description of at most this many bytes, and a larger one.
const LARGE: usize = 2_500_000;
const READ: [Duration; 2] = [Duration::from_millis(100), Duration::from_millis(200)];
/// Opening the folder without an index, and with one.
const COLD: Duration = Duration::from_secs(1);
const WARM: Duration = Duration::from_millis(50);
/// `ringcat init` on 100 SubDevices beyond its scan.
const INIT: Duration = Duration::from_secs(2);
/// Mark of the process that reads one file for its memory.
const ONE: &str = "--memory-of";

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    if let [mark, file] = &arguments[..]
        && mark == ONE
    {
        let bytes = fs::read(file).expect("the file was there");
        let esi = read_with(file, &bytes, &NoReferences).expect("the file was read");
        println!("{} {}", resident_kib(), esi.devices.len());
        return ExitCode::SUCCESS;
    }
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/esi");
    let folder = arguments.first().map_or_else(beside, PathBuf::from);
    let mut missed = Vec::new();
    if folder.is_dir() {
        files(&folder, &mut missed);
        index(&folder, &mut missed);
    } else {
        println!("skipped: {} is not there", folder.display());
    }
    init(&mut missed);
    match missed.is_empty() {
        true => println!("result: ok: descriptions within their bars"),
        false => println!("result: FAILED: {}", missed.join(", ")),
    }
    ExitCode::from(u8::from(!missed.is_empty()))
}

/// Prints a figure with its bar.
fn figure(what: &str, got: Duration, bar: Duration, missed: &mut Vec<String>) {
    let ms = |time: Duration| time.as_secs_f64() * 1e3;
    println!("{what}: {:.1} ms, at most {:.0} ms", ms(got), ms(bar));
    if got > bar {
        missed.push(format!("{what} took {:.1} ms", ms(got)));
    }
}

fn files(folder: &Path, missed: &mut Vec<String>) {
    let entries = fs::read_dir(folder).into_iter().flatten();
    let mut files: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    files.retain(|path| path.extension().is_some_and(|ending| ending == "xml"));
    files.sort();
    let mut refused = 0;
    for path in &files {
        let name = path.display().to_string();
        let bytes = fs::read(path).unwrap_or_default();
        let Some(best) = (0..5).filter_map(|_| time(&name, &bytes)).min() else {
            refused += 1;
            continue;
        };
        let short = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let memory = memory_of(&name);
        figure(
            &format!("{short}, {} bytes, {memory} KiB", bytes.len()),
            best,
            READ[usize::from(bytes.len() > LARGE)],
            missed,
        );
        if memory > MEMORY_KIB {
            missed.push(format!("{short} takes {memory} KiB"));
        }
    }
    println!("{} files, {refused} refused, each within {MEMORY_KIB} KiB", files.len());
}

/// The folder without an index, and with the index that this has made.
fn index(folder: &Path, missed: &mut Vec<String>) {
    let kept = env::temp_dir().join(format!("ringcat-descriptions-{}.index", std::process::id()));
    let open = |fresh: bool| {
        let _ = fresh.then(|| fs::remove_file(&kept));
        let begin = Instant::now();
        EsiFolder::open(folder, Some(&kept)).map(|_| begin.elapsed())
    };
    for (what, fresh, bar) in [("folder without an index", true, COLD), ("folder with its index", false, WARM)] {
        let times: Result<Vec<Duration>, _> = (0..3).map(|_| open(fresh)).collect();
        match times {
            Ok(times) => figure(what, times.into_iter().min().unwrap_or_default(), bar, missed),
            Err(error) => missed.push(format!("{what}: {error}")),
        }
    }
    let _ = fs::remove_file(&kept);
}

/// A network file of 100 SubDevices, by the program.
fn init(missed: &mut Vec<String>) {
    let here = env::current_exe().ok().and_then(|path| Some(path.parent()?.join("ringcat")));
    let (program, folder) = (here.unwrap_or_default(), env::temp_dir());
    let file = |ending: &str| folder.join(format!("ringcat-descriptions-{}.{ending}", std::process::id()));
    let (segment, out) = (file("segment.toml"), file("network.toml"));
    let devices = [("coupler", 1), ("digital-output-8", 29), ("digital-input-8", 30), ("servo", 40)];
    let text: String =
        devices.map(|(kind, count)| format!("[[device]]\ntype = \"{kind}\"\ncount = {count}\n")).concat();
    let written = fs::write(&segment, text);
    let mut command = Command::new(&program);
    command.args(["--json", "init", "--sim"]).arg(&segment).arg("--out").arg(&out);
    let output = written.and_then(|()| command.output()).map(|output| output.stdout).unwrap_or_default();
    let text = String::from_utf8_lossy(&output).into_owned();
    let number = |key: &str| -> Option<u64> {
        let behind = text.split_once(&format!("\"{key}\":"))?.1;
        behind.chars().take_while(char::is_ascii_digit).collect::<String>().parse().ok()
    };
    match (number("subdevices"), number("file_us")) {
        (Some(100), Some(us)) => {
            figure("init of 100 SubDevices beyond its scan", Duration::from_micros(us), INIT, missed)
        }
        _ => missed.push(format!("{} init: no figure: {text}", program.display())),
    }
    let _ = fs::remove_file(&segment).and(fs::remove_file(&out));
}

fn time(name: &str, bytes: &[u8]) -> Option<Duration> {
    let begin = Instant::now();
    let esi = read_with(name, bytes, &NoReferences).map_err(|error| println!("refused: {error}")).ok()?;
    let time = begin.elapsed();
    drop(esi);
    Some(time)
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
