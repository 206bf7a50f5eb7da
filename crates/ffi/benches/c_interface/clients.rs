//! An application beside many clients of the daemon.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use ringcat::daemon::{Client, Query};

use crate::callgrind::{self, cost_beside};
use crate::segment::Bench;

const CLIENTS: u64 = 50;
/// Questions of each in a second.
const RATE: u64 = 100;
/// Cycles at 1 kHz.
const CYCLES: u64 = 3_000;

/// Clients that ask until this is over.
#[derive(Default)]
struct Crowd {
    begins: AtomicBool,
    is_over: AtomicBool,
    answered: AtomicU64,
    refused: AtomicU64,
}

impl Crowd {
    fn ask(&self, bench: &Bench, number: u64) {
        while !self.begins.load(Ordering::Acquire) {
            if self.is_over.load(Ordering::Acquire) {
                return;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        let begin = Instant::now();
        let mut client = Client::connect(&bench.socket, "crowd").expect("there is room");
        for round in 0_u64.. {
            let at = Duration::from_micros((round * CLIENTS + number) * 1_000_000 / (RATE * CLIENTS));
            std::thread::sleep(at.saturating_sub(begin.elapsed()));
            if self.is_over.load(Ordering::Acquire) {
                return;
            }
            let count = match client.ask(0, Query::AlStatus { position: (round % 4) as u16 }, Vec::new()) {
                Ok(_) => &self.answered,
                Err(_) => &self.refused,
            };
            count.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Runs something beside the clients; it signals them to begin.
    fn beside<T>(bench: &Bench, is_there: bool, work: impl FnOnce(&AtomicBool) -> T) -> (T, u64, u64) {
        let crowd = Crowd::default();
        let result = std::thread::scope(|scope| {
            for number in 0..if is_there { CLIENTS } else { 0 } {
                let crowd = &crowd;
                scope.spawn(move || crowd.ask(bench, number));
            }
            let result = work(&crowd.begins);
            crowd.is_over.store(true, Ordering::Release);
            result
        });
        (result, crowd.answered.into_inner(), crowd.refused.into_inner())
    }
}

/// Cycles at 1 kHz at full speed; incomplete ones.
fn incomplete(program: &Path, bench: &Bench, begins: &AtomicBool) -> u64 {
    let mut command = Command::new(program);
    command.args(["cycles", "1000", &CYCLES.to_string()]).env("RINGCAT_SOCKET", &bench.socket);
    let mut child =
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("it runs");
    let mut lines = BufReader::new(child.stdout.take().expect("it is piped"));
    let mut line = String::new();
    lines.read_line(&mut line).expect("it is text");
    begins.store(true, Ordering::Release);
    child.stdin.take().expect("it is piped").write_all(b"go\n").expect("it reads");
    line.clear();
    lines.read_line(&mut line).expect("it is text");
    child.wait().expect("it ends");
    let count = line.trim().strip_prefix("incomplete ").and_then(|count| count.parse().ok());
    count.unwrap_or_else(|| panic!("{line:?}"))
}

/// Prints instructions per cycle and lost cycles, without and with the clients, in turn.
pub fn beside_clients(program: &Path) {
    let bench = Bench::start(4, "digital-output-8");
    for round in 0..3 {
        for is_there in [false, true] {
            let (lost, answered, refused) =
                Crowd::beside(&bench, is_there, |begins| incomplete(program, &bench, begins));
            let clients = if is_there { CLIENTS } else { 0 };
            println!(
                "{clients:>2} clients, {CYCLES} cycles at 1 kHz, round {round}: {lost} incomplete; {answered} \
                 questions answered, {refused} refused"
            );
        }
    }
    if !callgrind::is_installed() {
        return;
    }
    for is_there in [false, true] {
        let (cost, answered, refused) = Crowd::beside(&bench, is_there, |begins| {
            cost_beside(program, &bench, || begins.store(true, Ordering::Release))
        });
        let clients = if is_there { CLIENTS } else { 0 };
        println!(
            "{clients:>2} clients: {cost:.0} instructions per cycle in the thread of the cycles (under valgrind \
             {answered} questions answered, {refused} refused)"
        );
    }
}
