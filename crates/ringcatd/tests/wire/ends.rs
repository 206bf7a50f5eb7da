//! Ends of applications on an interface: hand-over, SIGKILL, core dumps, SIGSTOP.

use std::fs;
use std::io::Write;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use ringcat::AlState;
use ringcat::daemon::{Answer, Query};
use ringcat_link::monotonic;

use crate::bench::{Bench, LINE};
use crate::roles::MEMORY;

/// A signal is delivered, and all threads of the process have stopped, within this time in nanoseconds.
const DELIVERY: u64 = 1_000_000;
/// From SIGKILL to the daemon's first frame: median, longest.
const FIRST_FRAME: [Duration; 2] = [Duration::from_millis(5), Duration::from_millis(20)];

/// Cores are files in the directory of a process, not the input of a program.
fn writes_cores() -> bool {
    fs::read_to_string("/proc/sys/kernel/core_pattern").is_ok_and(|pattern| pattern.starts_with("core"))
}

/// Ends applications with a signal; SIGQUIT writes one with 64 MB. Shows times until the daemon has the bus.
fn killed(bench: &mut Bench, signal: &str, count: usize) {
    let (mut first, mut preop) = (Vec::new(), Vec::new());
    // It has the command built in, so that no time goes into the start of a program.
    let mut shell = Command::new("sh").stdin(Stdio::piped()).spawn().expect("it is there");
    let mut orders = shell.stdin.take().expect("it is piped");
    for _ in 0..count {
        let mut child = bench.application("killed");
        bench.wait_for(AlState::Op);
        let at = monotonic::now_ns();
        writeln!(orders, "kill -{signal} {}", child.id()).expect("it reads");
        // Until the signal is delivered the application goes on; its own frames are no answer.
        first.push(bench.first_frame(at + DELIVERY) + Duration::from_nanos(DELIVERY));
        bench.wait_for(AlState::PreOp);
        preop.push(Duration::from_nanos(monotonic::now_ns() - at));
        child.wait().expect("it has ended");
    }
    drop(orders);
    shell.wait().expect("it ends");
    let cores = fs::read_dir(&bench.place).expect("it is there").flatten().filter(|entry| {
        let is_core = entry.file_name().to_string_lossy().starts_with("core");
        is_core && entry.metadata().is_ok_and(|data| data.len() as usize > MEMORY)
    });
    let cores = cores.map(|entry| fs::remove_file(entry.path()).expect("it is there")).count();
    first.sort_unstable();
    preop.sort_unstable();
    let (median, longest) = (first[count / 2], first[count - 1]);
    println!("{signal} of {count}, cores {cores}: first frame of the daemon {median:?}, longest {longest:?}");
    println!("    PREOP {:?}, longest {:?}", preop[count / 2], preop[count - 1]);
    assert!(signal != "QUIT" || cores > 0 || !writes_cores(), "no core was written");
    assert!(median <= FIRST_FRAME[0] && longest <= FIRST_FRAME[1], "{first:?}, bars {FIRST_FRAME:?}");
}

// covers: daemon, links
#[test]
fn the_daemon_hands_an_interface_over_and_has_it_back() {
    let Some(mut bench) = Bench::make(LINE, &[0]) else { return };
    bench.start_segment("0");
    bench.start_daemon(&["--master", "0=near0"]);
    bench.wait_for(AlState::PreOp);
    for _ in 0..3 {
        let mut child = bench.application("orderly");
        assert!(child.wait().expect("it ends").success());
        bench.wait_for(AlState::PreOp);
    }
    killed(&mut bench, "KILL", 50);
    killed(&mut bench, "QUIT", 9);
    // A stopped application loses the interface, and what it sends later goes nowhere.
    let mut child = bench.application("killed");
    bench.wait_for(AlState::Op);
    let signal = |name: &str| Command::new("kill").args([name, &child.id().to_string()]).status().expect("it is there");
    assert!(signal("-STOP").success());
    bench.wait_for(AlState::PreOp);
    assert!(signal("-CONT").success());
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_millis(500) {
        assert_eq!(bench.states(), "2 2 2 ");
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().expect("it runs");
    child.wait().expect("it has ended");
    let Ok((Answer::State(state), _)) = bench.client().ask(0, Query::State, Vec::new()) else {
        panic!("it is a state")
    };
    assert_eq!(state.subdevices.len(), 3);
    assert_eq!(state.acyclic.foreign, 0, "no frame of another MainDevice");
}
