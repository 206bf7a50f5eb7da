//! Interfaces that are absent, are removed and come back, while the daemon or an application drives the segment.

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use ringcat::AlState;
use ringcat::daemon::{Answer, Query};
use ringcat_control::message::{ToolAnswer, ToolQuery};
use ringcat_control::tool::MasterReport;

use crate::bench::{Bench, LINE, RING, ip};

/// What `ethercat master` shows.
fn report(bench: &Bench) -> Option<Box<MasterReport>> {
    match bench.client().ask(0, Query::Tool(ToolQuery::Master), Vec::new()) {
        Ok((Answer::Tool(ToolAnswer::Master(report)), _)) => Some(report),
        _ => None,
    }
}

fn wait_for_report(bench: &Bench, what: &str, holds: impl Fn(&MasterReport) -> bool) {
    bench.wait_until(what, || report(bench).is_some_and(|report| holds(&report)));
}

/// SubDevices that answer now on the main and on the redundant link.
fn counts(bench: &Bench) -> [u16; 2] {
    match bench.client().ask(0, Query::Overview, Vec::new()) {
        Ok((Answer::Overview(seen), _)) => seen.counts,
        _ => [0; 2],
    }
}

/// Whether the ring is closed and passes frames in both directions.
fn is_redundant(bench: &Bench) -> bool {
    let Ok((Answer::State(state), _)) = bench.client().ask(0, Query::State, Vec::new()) else { return false };
    state.ring.redundant == Some(true)
}

// covers: daemon, links
#[test]
fn an_interface_that_is_removed_and_comes_back_is_opened_again() {
    let Some(mut bench) = Bench::make(LINE, &[0]) else { return };
    bench.start_segment("0");
    bench.start_daemon(&["--master", "0=near0"]);
    bench.wait_for(AlState::PreOp);
    wait_for_report(&bench, "a device", |it| !it.is_orphaned && it.subdevices == 3);
    // Without a carrier a device is attached all the same.
    crate::bench::ip(&format!("-n {} link set far0 down", bench.far));
    wait_for_report(&bench, "no carrier", |it| !it.is_orphaned && it.links[0].carrier == Some(false));
    crate::bench::ip(&format!("-n {} link set far0 up", bench.far));
    wait_for_report(&bench, "a carrier", |it| it.links[0].carrier == Some(true));
    for _ in 0..3 {
        bench.pull_out(0);
        bench.wait_for_line("master 0: interface near0 was removed");
        wait_for_report(&bench, "no device", |it| it.is_orphaned && it.links[0].carrier == Some(false));
        bench.plug_in(0);
        bench.wait_for_line("master 0: interface near0 is there");
        bench.wait_until("all answer", || counts(&bench) == [3, 0]);
        wait_for_report(&bench, "a device", |it| !it.is_orphaned && it.subdevices == 3);
    }
    bench.wait_for(AlState::PreOp);
    // An application gets the links as they are now.
    let mut child = bench.application("orderly");
    assert!(child.wait().expect("it ends").success());
    bench.wait_for(AlState::PreOp);
}

/// Whether the main interface is switched on.
fn is_on(bench: &Bench) -> bool {
    let shown = Command::new("ip").args(["-n", &bench.near, "-o", "link", "show", "near0"]).output();
    let shown = String::from_utf8_lossy(&shown.expect("ip is there").stdout).into_owned();
    let flags = shown.split(['<', '>']).nth(1).unwrap_or_default();
    flags.split(',').any(|flag| flag == "UP")
}

// covers: daemon, links
#[test]
fn an_owner_has_its_link_switched_by_the_daemon_and_it_is_on_after_its_end() {
    let Some(mut bench) = Bench::make(LINE, &[0]) else { return };
    bench.start_segment("0");
    bench.start_daemon(&["--master", "0=near0"]);
    bench.wait_for(AlState::PreOp);
    let mut owner = bench.application("switch");
    let is_at = |step: &str| std::fs::read_to_string(bench.place.join("switched")).is_ok_and(|it| it == step);
    for (step, is_on_then) in [("0", false), ("1", true), ("2", false)] {
        bench.wait_until("the next step", || is_at(step));
        bench.wait_until("the link follows", || is_on(&bench) == is_on_then);
    }
    assert!(owner.wait().expect("it ends").success());
    bench.wait_until("it is on again", || is_on(&bench));
    bench.wait_for(AlState::PreOp);
}

/// Capabilities of a process and the processes that it has started.
fn capabilities(pid: u32) -> Vec<(String, u64)> {
    let text = |pid: u32, file: &str| std::fs::read_to_string(format!("/proc/{pid}/{file}")).unwrap_or_default();
    let children: Vec<u32> =
        text(pid, &format!("task/{pid}/children")).split_whitespace().filter_map(|it| it.parse().ok()).collect();
    let of = |pid: u32| {
        let status = text(pid, "status");
        let permitted = status.lines().find_map(|line| line.strip_prefix("CapPrm:")).expect("it runs");
        (text(pid, "cmdline"), u64::from_str_radix(permitted.trim(), 16).expect("a number"))
    };
    [pid].into_iter().chain(children).map(of).collect()
}

// covers: daemon
#[test]
fn only_the_process_that_opens_sockets_may_send_raw_frames() {
    const ADMIN: u64 = 1 << 12;
    const RAW: u64 = 1 << 13;
    let Some(mut bench) = Bench::make(LINE, &[0]) else { return };
    bench.start_segment("0");
    let daemon = bench.start_daemon(&["--master", "0=near0"]);
    bench.wait_for(AlState::PreOp);
    let all = capabilities(bench.pid(daemon));
    let [(_, own), (opener, raw)] = &all[..] else { panic!("{all:?}") };
    assert_eq!((*own, *raw), (ADMIN, RAW), "{all:?}");
    assert!(opener.contains("--open-sockets"));
    // Sockets come from it for each owner, and when the interface comes back.
    for _ in 0..5 {
        let mut child = bench.application("orderly");
        assert!(child.wait().expect("it ends").success());
    }
    bench.wait_for(AlState::PreOp);
}

// covers: daemon, links, ring-events
#[test]
fn a_ring_with_one_interface_absent_is_driven_over_the_other() {
    let Some(mut bench) = Bench::make(RING, &[0]) else { return };
    bench.start_segment("0,1");
    bench.start_daemon(&["--master", "0=near0,near1"]);
    bench.wait_for(AlState::PreOp);
    assert_eq!(counts(&bench), [3, 0]);
    let mut child = bench.application("killed");
    bench.wait_for(AlState::Op);
    // The cable comes while the application drives: it closes the ring without a hand-over.
    bench.plug_in(1);
    bench.wait_for_line("master 0: interface near1 is there");
    bench.wait_until("the ring is closed", || is_redundant(&bench));
    // The main interface is removed: all answer on the other one, and stay in OP.
    bench.pull_out(0);
    bench.wait_for_line("master 0: interface near0 was removed");
    bench.wait_until("the other way", || counts(&bench) == [0, 3]);
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_secs(1) {
        assert_eq!(bench.states(), "8 8 8 ");
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().expect("it runs");
    child.wait().expect("it has ended");
    bench.wait_for(AlState::PreOp);
    assert_eq!(counts(&bench), [0, 3]);
    wait_for_report(&bench, "one device is there", |it| !it.is_orphaned);
    bench.plug_in(0);
    bench.wait_for_line("master 0: interface near0 is there");
    bench.wait_for(AlState::PreOp);
}

// covers: daemon, other-main-device
#[test]
fn a_segment_that_another_main_device_controls_is_left_alone_until_that_ends() {
    let Some(mut bench) = Bench::make(LINE, &[0]) else { return };
    bench.start_segment("0");
    let first = bench.start_daemon(&["--master", "0=near0"]);
    bench.wait_for(AlState::PreOp);
    let mut owner = bench.application("killed");
    bench.wait_for(AlState::Op);
    let socket = bench.place.join("second");
    bench.start_daemon_at(&socket, &["--master", "0=near0"]);
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_secs(3) {
        let fault = fault(&bench, &socket);
        assert!(fault.as_ref().is_some_and(|text| text.starts_with(OTHER)), "{fault:?}");
        assert_eq!(bench.states(), "8 8 8 ");
        std::thread::sleep(Duration::from_millis(5));
    }
    // The first daemon drives it without an application, and its frames arrive as well.
    owner.kill().expect("it runs");
    owner.wait().expect("it has ended");
    bench.wait_for(AlState::PreOp);
    std::thread::sleep(Duration::from_secs(2));
    assert!(fault(&bench, &socket).is_some(), "{:#?}", bench.lines());
    bench.kill_daemon(first);
    bench.wait_until("the second one drives it", || fault(&bench, &socket).is_none());
    bench.wait_for(AlState::PreOp);
}

/// What a daemon says of a segment that another MainDevice drives.
const OTHER: &str = "another MainDevice controls this segment: its frames, from ";

/// Why the daemon at this socket does not drive its master.
fn fault(bench: &Bench, socket: &Path) -> Option<String> {
    match bench.client_at(socket).ask(0, Query::Masters, Vec::new()) {
        Ok((Answer::Masters(masters), _)) => masters[0].fault.clone(),
        other => panic!("{other:?}"),
    }
}

// covers: daemon, other-main-device
#[test]
fn a_segment_is_listened_to_from_when_its_cable_is_plugged_in() {
    let Some(mut bench) = Bench::make(LINE, &[0]) else { return };
    let near = bench.near.clone();
    let near = |arguments: &str| ip(&format!("-n {near} link {arguments}"));
    // A hub with the segment, and two interfaces: the cable of the second one is out.
    near("add hub type bridge");
    near("set hub addrgenmode none up");
    near("set near0 master hub");
    for name in ["a", "b"] {
        near(&format!("add {name}0 type veth peer name {name}1"));
        near(&format!("set {name}0 addrgenmode none up"));
        near(&format!("set {name}1 addrgenmode none master hub"));
    }
    near("set a1 up");
    bench.start_segment("0");
    let first = bench.start_daemon(&["--master", "0=a0"]);
    bench.wait_for(AlState::PreOp);
    let mut owner = bench.application("killed");
    bench.wait_for(AlState::Op);
    let socket = bench.place.join("second");
    bench.start_daemon_at(&socket, &["--master", "0=b0"]);
    assert_eq!(fault(&bench, &socket), None, "it waits for a link");
    std::thread::sleep(Duration::from_millis(600));
    near("set b1 up");
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_secs(3) {
        assert_eq!(bench.states(), "8 8 8 ");
        std::thread::sleep(Duration::from_millis(5));
    }
    let text = fault(&bench, &socket);
    assert!(text.as_ref().is_some_and(|text| text.starts_with(OTHER)), "{text:?}");
    let reports = bench.lines().iter().filter(|line| line.contains(OTHER)).count();
    assert_eq!(reports, 1, "it is reported once: {:#?}", bench.lines());
    owner.kill().expect("it runs");
    owner.wait().expect("it has ended");
    bench.kill_daemon(first);
    bench.wait_until("the second one drives it", || fault(&bench, &socket).is_none());
    bench.wait_for(AlState::PreOp);
}
