//! The process that `socket_cycle` measures: a MainDevice on the interface `near0`, which runs cycles and prints its
//! CPU time and its resident memory. Nothing of the measurement is in it, so that its memory is that of an application.

use std::collections::BTreeMap;
use std::fs;
use std::hint::black_box;
use std::io::{BufRead, BufReader};
use std::process::ExitCode;
use std::time::Duration;

use ringcat::packet::{PacketLinks, ReceiveMode};
use ringcat::{
    AcyclicHalf, AlState, Application, DomainId, LastOutputs, MainDevice, Options, ProcessData, SupervisorThread,
    automatic, realtime,
};
use scenarios::callgrind::BATCH;
use scenarios::cpu_time::process_cpu_time;

type Tried<T> = Result<T, String>;

/// Cycles before those that are counted.
const WARM_UP: u64 = 50;
/// Time limit from activation to OP, under valgrind.
const OP_LIMIT: Duration = Duration::from_secs(60);
const STOP_LIMIT: Duration = Duration::from_secs(10);
/// Bytes of the list of mappings that are read at once.
const LIST_BUFFER: usize = 1_024;
/// The spinning part of a hybrid wait, as in `ringcat run`.
const SPIN: Duration = Duration::from_micros(200);

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match words[..] {
        [threads, mode, period, cycles, resend] => run(threads, mode, period, cycles, resend),
        _ => Err("usage: cycle_process one|two block|hybrid|busy PERIOD_US CYCLES never|always".to_owned()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("cycle_process: {error}");
            ExitCode::FAILURE
        }
    }
}

fn receive_mode(name: &str) -> Tried<ReceiveMode> {
    match name {
        "block" => Ok(ReceiveMode::Blocking),
        "hybrid" => Ok(ReceiveMode::Hybrid { spin: SPIN }),
        "busy" => Ok(ReceiveMode::BusyPoll),
        _ => Err(format!("no such mode: {name}")),
    }
}

/// A MainDevice on `near0` that runs this many cycles and prints its resources. `resend`: whether lost frames are sent
/// again, `never` or `always`.
fn run(threads: &str, mode: &str, period_us: &str, cycles: &str, resend: &str) -> Tried<()> {
    let (period_us, cycles): (u64, u64) = (number(period_us)?, number(cycles)?);
    let (mode, period) = (receive_mode(mode)?, Duration::from_micros(period_us));
    let options = Options::default();
    realtime::precise_timers();
    match threads {
        "two" => {
            let (cyclic, acyclic) = PacketLinks::open_halves("near0", None, mode).map_err(said)?;
            let supervisor = SupervisorThread::start(acyclic, &options, realtime::precise_timers).map_err(said)?;
            let scan = supervisor.scan().map_err(said)?;
            let declaration = automatic(&scan.subdevices, period).with_sends_again(resend == "always");
            drop(scan);
            let mut application = supervisor.activate(declaration, cyclic).map_err(|refused| said(refused.error))?;
            exchange(&mut application, cycles)?;
            application.stop(LastOutputs::Zero, AlState::Init, STOP_LIMIT).map(drop).map_err(said)
        }
        "one" => {
            let links = PacketLinks::open("near0", None, mode).map_err(said)?;
            let mut main_device = MainDevice::request(links, &options);
            let scan = main_device.scan().map_err(said)?;
            let declaration = automatic(&scan.subdevices, period).with_sends_again(resend == "always");
            drop(scan);
            let mut application = main_device.activate(declaration).map_err(|refused| said(refused.error))?;
            exchange(&mut application, cycles)?;
            application.stop(LastOutputs::Zero, AlState::Init, STOP_LIMIT).map(drop).map_err(said)
        }
        _ => Err(format!("one thread or two, not {threads}")),
    }
}

fn exchange<H: AcyclicHalf>(application: &mut Application<PacketLinks, H>, cycles: u64) -> Tried<()> {
    let until = application.now() + OP_LIMIT;
    while !application.all_settled() {
        application.cycle(work);
        if application.now() >= until {
            return Err("not all SubDevices reached OP".to_owned());
        }
    }
    for _ in 0..WARM_UP {
        application.cycle(work);
    }
    let (before, cpu, begin) = (application.cyclic_counters(), process_cpu_time(), application.now());
    for _ in 0..cycles / BATCH {
        measured_batch(application);
    }
    let (cpu, elapsed) = (process_cpu_time() - cpu, application.now().since(begin));
    let after = application.cyclic_counters();
    let disturbed = (after.lost - before.lost).max(after.incomplete - before.incomplete);
    println!("cycles: {cycles}");
    println!("disturbed: {disturbed}");
    println!("skipped: {}", application.pace().skipped);
    println!("cpu percent: {:.1}", 100.0 * cpu.as_secs_f64() / elapsed.as_secs_f64());
    for (name, kilobytes) in memory()? {
        println!("{name}: {kilobytes} kB");
    }
    Ok(())
}

/// Cycles that are counted together.
#[inline(never)]
fn measured_batch<H: AcyclicHalf>(application: &mut Application<PacketLinks, H>) {
    for _ in 0..BATCH {
        measured_cycle(application);
    }
}

/// A cycle that is counted.
#[inline(never)]
fn measured_cycle<H: AcyclicHalf>(application: &mut Application<PacketLinks, H>) {
    application.cycle(work);
}

/// Minimal work of an application: it reads an input and changes an output.
fn work(data: &mut ProcessData<'_>) {
    black_box(data.image(DomainId(0)).last());
    if let Ok([first]) = data.outputs_mut(DomainId(0), 0..1) {
        *first = first.wrapping_add(1);
    }
}

/// Resident memory in kB: in total, and by mapping. The kernel's list is read line by line, because memory for all of
/// it would be in it.
fn memory() -> Tried<Vec<(String, u64)>> {
    let mut maps = BufReader::with_capacity(LIST_BUFFER, fs::File::open("/proc/self/smaps").map_err(said)?);
    let (mut parts, mut line) = (BTreeMap::<&str, u64>::new(), String::new());
    let mut part = "";
    while maps.read_line(&mut line).map_err(said)? > 0 {
        let mut words = line.split_whitespace();
        match (words.next(), words.next()) {
            (Some("Rss:"), Some(size)) => *parts.entry(part).or_default() += number::<u64>(size)?,
            (Some(range), Some(_)) if range.contains('-') => part = kind(words.nth(3)),
            _ => {}
        }
        line.clear();
    }
    let all = ("resident".to_owned(), parts.values().sum());
    Ok(std::iter::once(all).chain(parts.into_iter().map(|(name, size)| (format!("of it {name}"), size))).collect())
}

/// Kind of a mapping.
fn kind(name: Option<&str>) -> &'static str {
    match name {
        None => "stacks and heaps of threads",
        Some(name) if name.contains("[heap]") => "heap",
        Some(name) if name.contains("[stack]") => "stacks and heaps of threads",
        Some(name) if name.starts_with("socket:") => "receive rings",
        Some(name) if name.contains(".so") => "libraries",
        Some(name) if name.starts_with('[') => "kernel",
        Some(_) => "program",
    }
}

fn number<T: std::str::FromStr>(text: &str) -> Tried<T> {
    text.parse().map_err(|_| format!("not a number: {text}"))
}

fn said(error: impl std::fmt::Display) -> String {
    error.to_string()
}
