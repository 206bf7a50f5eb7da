//! Debug interfaces: they show all frames of a link, whatever process drives the master, and nothing gets into the bus
//! through them.

use std::process::Command;

use ringcat::AlState;

use crate::bench::{Bench, LINE, RING, ip};
use crate::c_program::CProgram;

const MAIN: &str = "ecdbgm0";
const BACKUP: &str = "ecdbgb0";
/// Three with process data, so that each cycle of an application changes working counters.
const OUTPUTS: &str = "[segment]\n[[device]]\ntype = \"digital-output-8\"\ncount = 3\n";

/// Whether an interface is there.
fn is_there(bench: &Bench, name: &str) -> bool {
    let shown = Command::new("ip").args(["-n", &bench.near, "-o", "link", "show", name]).output().expect("ip is there");
    shown.status.success()
}

fn set_up(bench: &Bench, name: &str) {
    bench.wait_until(name, || is_there(bench, name));
    ip(&format!("-n {} link set {name} up", bench.near));
}

/// Frames on an interface in half a second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Seen {
    sent_cyclic: u32,
    received_cyclic: u32,
    sent_acyclic: u32,
    received_acyclic: u32,
    others: u32,
}

fn listen(bench: &Bench, name: &str) -> Seen {
    bench.with_interface("listen", name);
    let text = std::fs::read_to_string(bench.place.join("listened")).expect("it was written");
    let counts: Vec<u32> = text.split(' ').map(|count| count.parse().expect("a number")).collect();
    let [sent_cyclic, received_cyclic, sent_acyclic, received_acyclic, others] = counts[..] else {
        panic!("{text}");
    };
    Seen { sent_cyclic, received_cyclic, sent_acyclic, received_acyclic, others }
}

/// Frames of the acyclic half in both directions, and none of an application for half a second: on a busy machine the
/// last frames of one that was killed may come late.
fn check_idle(bench: &Bench, what: &str) {
    bench.wait_until(what, || {
        let (seen, backup) = (listen(bench, MAIN), listen(bench, BACKUP));
        println!("{what}: {seen:?}, {backup:?}");
        let is_idle = |seen: &Seen| seen.sent_cyclic + seen.received_cyclic + seen.others == 0;
        // In a ring that is closed, frames of one link arrive at the other one.
        seen.sent_acyclic > 0
            && backup.sent_acyclic + backup.received_acyclic > 0
            && seen.received_acyclic + backup.received_acyclic > 0
            && is_idle(&seen)
            && is_idle(&backup)
    });
}

/// Cycles of 4 ms: about 125 frames in half a second in each direction.
fn check_cycles(bench: &Bench, what: &str) {
    for name in [MAIN, BACKUP] {
        let seen = listen(bench, name);
        assert!(seen.sent_cyclic + seen.received_cyclic > 50 && seen.others == 0, "{what}, {name}: {seen:?}");
        // In a ring one direction executes the datagrams.
        if name == MAIN {
            assert!(seen.sent_cyclic > 25, "{what}, {name}: {seen:?}");
        }
    }
}

// covers: daemon, capture
#[test]
fn debug_interfaces_show_all_frames_of_both_links_whatever_drives_the_master() {
    let Some(mut bench) = Bench::make(RING, &[0, 1]) else { return };
    bench.start_segment("0,1");
    let options = ["--master", "0=near0,near1", "--debug-if"];
    let daemon = bench.start_daemon(&options);
    bench.wait_for(AlState::PreOp);
    [MAIN, BACKUP].into_iter().for_each(|name| set_up(&bench, name));
    bench.wait_until("frames of the daemon", || listen(&bench, MAIN).sent_acyclic > 0);
    check_idle(&bench, "idle");
    let before = bench.states();
    for name in [MAIN, BACKUP] {
        bench.with_interface("inject", name);
    }
    check_idle(&bench, "after frames that were sent into them");
    assert_eq!(bench.states(), before, "no SubDevice has got them");
    let mut child = bench.application("killed");
    bench.wait_for(AlState::Op);
    check_cycles(&bench, "beside an application");
    for name in [MAIN, BACKUP] {
        bench.with_interface("inject", name);
        ip(&format!("-n {} link set {name} down", bench.near));
        ip(&format!("-n {} link set {name} up", bench.near));
    }
    bench.wait_for(AlState::Op);
    bench.wait_until("frames after down and up", || listen(&bench, MAIN).sent_cyclic > 25);
    child.kill().expect("it runs");
    child.wait().expect("it has ended");
    bench.wait_for(AlState::PreOp);
    check_idle(&bench, "after SIGKILL of an application");
    let mut child = bench.application("killed");
    bench.wait_for(AlState::Op);
    bench.kill_daemon(daemon);
    check_cycles(&bench, "after SIGKILL of the daemon, beside an application");
    let daemon = bench.start_daemon(&options);
    bench.wait_for_line("waits for the end of \"application\"");
    child.kill().expect("it runs");
    child.wait().expect("it has ended");
    bench.wait_for(AlState::PreOp);
    check_idle(&bench, "with the next daemon");
    bench.end_daemon(daemon);
    bench.wait_until("the interfaces end with a daemon in order", || {
        !is_there(&bench, MAIN) && !is_there(&bench, BACKUP)
    });
}

// covers: daemon, capture
#[test]
fn a_line_has_one_debug_interface_and_a_daemon_without_permission_has_none() {
    let Some(mut bench) = Bench::make(LINE, &[0]) else { return };
    bench.start_segment("0");
    let daemon = bench.start_daemon(&["--master", "0=near0", "--debug-if"]);
    bench.wait_for(AlState::PreOp);
    set_up(&bench, MAIN);
    bench.wait_until("frames of the daemon", || {
        let seen = listen(&bench, MAIN);
        seen.sent_acyclic > 0 && seen.received_acyclic > 0
    });
    assert!(!is_there(&bench, BACKUP));
    bench.end_daemon(daemon);
    bench.wait_until("it ends with the daemon", || !is_there(&bench, MAIN));
    let daemon = bench.start_daemon(&["--master", "0=near0"]);
    bench.client();
    bench.wait_for(AlState::PreOp);
    assert!(!is_there(&bench, MAIN), "the default is none");
    bench.end_daemon(daemon);
    let master = format!("0=sim:{}", bench.place.join("segment.toml").display());
    bench.start_daemon_as_user(&["--master", &master, "--debug-if"]);
    bench.client();
    bench.wait_for_line("master 0: no debug interface: not permitted to make the network interface ecdbgm0");
    assert!(!is_there(&bench, MAIN));
}

/// On a line each frame is seen twice: as it is sent, and as it comes back.
fn check_both_directions(what: &str, sent: u32, received: u32) {
    // Half a second begins and ends while a frame is under way, and a busy machine shows some frames late.
    assert!(sent > 25 && sent.abs_diff(received) <= sent / 10 + 2, "{what}: {sent} sent, {received} received");
}

// covers: daemon, capture, c-interface
#[test]
fn a_debug_interface_shows_both_directions_beside_a_c_program_and_behind_it() {
    let Some(mut bench) = Bench::make(OUTPUTS, &[0]) else { return };
    bench.start_segment("0");
    let daemon = bench.start_daemon(&["--master", "0=near0", "--debug-if"]);
    bench.wait_for(AlState::PreOp);
    set_up(&bench, MAIN);
    let is_idle = |bench: &Bench| {
        let seen = listen(bench, MAIN);
        seen.sent_acyclic > 0 && seen.received_acyclic > 0 && seen.sent_cyclic + seen.received_cyclic + seen.others == 0
    };
    bench.wait_until("the daemon before it", || is_idle(&bench));
    let Some(program) = CProgram::start(&bench) else { return };
    bench.wait_for(AlState::Op);
    let seen = listen(&bench, MAIN);
    println!("beside a C program: {seen:?}");
    check_both_directions("cyclic frames of a C program", seen.sent_cyclic, seen.received_cyclic);
    assert!(seen.sent_acyclic > 0 && seen.received_acyclic > 0 && seen.others == 0, "{seen:?}");
    program.end();
    bench.wait_for(AlState::PreOp);
    bench.wait_until("the daemon after it", || is_idle(&bench));
    // A program that is killed gives nothing back itself.
    let Some(program) = CProgram::start(&bench) else { return };
    bench.wait_for(AlState::Op);
    drop(program);
    bench.wait_for(AlState::PreOp);
    bench.wait_until("the daemon after a program that was killed", || is_idle(&bench));
    bench.end_daemon(daemon);
}
