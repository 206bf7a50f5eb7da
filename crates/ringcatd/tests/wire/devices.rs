//! Interfaces that a configuration names by their address, or not at all; those that are switched with the daemon.

use std::process::Command;
use std::time::{Duration, Instant};

use ringcat::daemon::{Answer, Query};
use ringcat::{Activity, AlState};
use ringcat_control::message::{ToolAnswer, ToolQuery};

use crate::bench::{Bench, LINE, RING, ip};

/// Output of a command in the near namespace.
fn near(bench: &Bench, command: &str) -> String {
    let output = Command::new("ip").args(["netns", "exec", &bench.near]).args(command.split(' ')).output();
    String::from_utf8_lossy(&output.expect("ip is there").stdout).into_owned()
}

fn index(bench: &Bench, name: &str) -> String {
    let shown = near(bench, &format!("ip -o link show {name}"));
    shown.split(':').next().expect("it has a number").to_owned()
}

/// Numbers of the interfaces that sockets for EtherCAT have; those that were taken away have the loopback (1).
fn used(bench: &Bench) -> Vec<String> {
    let table = near(bench, "cat /proc/thread-self/net/packet");
    let interface = |line: &str| {
        let columns: Vec<&str> = line.split_whitespace().collect();
        let interface = columns.get(4).filter(|it| !["0", "1"].contains(it))?;
        (columns[3] == "88a4").then(|| (*interface).to_owned())
    };
    let mut all: Vec<String> = table.lines().skip(1).filter_map(interface).collect();
    all.sort();
    all.dedup();
    all
}

fn has_flag_up(bench: &Bench, name: &str) -> bool {
    let shown = near(bench, &format!("ip -o link show {name}"));
    let flags = shown.split(['<', '>']).nth(1).unwrap_or_default();
    flags.split(',').any(|flag| flag == "UP")
}

/// The daemon makes its checks of each second a few times.
fn stays(bench: &Bench, what: &str, holds: impl Fn(&Bench) -> bool) {
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_millis(2500) {
        assert!(holds(bench), "{what}: {:?}, {:?}, {:#?}", bench.states(), used(bench), bench.lines());
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Waits until the daemon that runs now has found all SubDevices.
fn wait_for_scan(bench: &Bench) {
    let is_scanned = || match bench.client().ask(0, Query::State, Vec::new()) {
        Ok((Answer::State(state), _)) => state.activity == Activity::Scanned && state.subdevices.len() == 3,
        _ => false,
    };
    bench.wait_until("it is scanned", is_scanned);
}

const FIRST: &str = "0=ff:ff:ff:ff:ff:ff";

// covers: daemon
#[test]
fn the_first_interface_is_none_that_the_host_uses_in_any_way() {
    let Some(mut bench) = Bench::make(LINE, &[1, 2, 3, 4, 5, 6]) else { return };
    let near = bench.near.clone();
    ip(&format!("-n {near} address add 192.0.2.1/24 dev near1"));
    ip(&format!("-n {near} link add br0 type bridge"));
    ip(&format!("-n {near} link set near2 master br0"));
    ip(&format!("-n {near} link set br0 up"));
    ip(&format!("-n {near} route add default dev near3"));
    ip(&format!("-n {near} link set near4 down"));
    ip(&format!("-n {near} link add link near5 name macvlan5 type macvlan"));
    ip(&format!("-n {near} address add 2001:db8::1/64 dev near6"));
    bench.start_segment("0,7");
    bench.start_daemon(&["--master", FIRST]);
    let reasons = [
        "near1: near1 has the IP address 192.0.2.1",
        "near2: near2 is a member of the bridge br0",
        "near3: the host has a route over it",
        "near4: it is switched off",
        "near5: macvlan5 uses it",
        "near6: near6 has the IP address 2001:db8::1",
        "br0: it is of the kind \"bridge\"",
    ];
    for reason in reasons {
        bench.wait_for_line(reason);
    }
    stays(&bench, "no interface is taken", |bench| used(bench).is_empty());
    // One that nothing uses comes.
    bench.plug_in(0);
    bench.wait_for(AlState::PreOp);
    assert_eq!(used(&bench), [index(&bench, "near0")]);
}

// covers: daemon
#[test]
fn an_interface_that_was_chosen_is_left_when_the_host_begins_to_use_it() {
    let Some(mut bench) = Bench::make(LINE, &[0]) else { return };
    let near = bench.near.clone();
    bench.start_segment("0");
    bench.start_daemon(&["--master", FIRST]);
    bench.wait_for(AlState::PreOp);
    ip(&format!("-n {near} address add 192.0.2.1/24 dev near0"));
    bench.wait_for_line("master 0 is not driven: leaves near0 alone: near0 has the IP address 192.0.2.1");
    bench.wait_until("it is left", || used(&bench).is_empty());
    stays(&bench, "it is left alone", |bench| used(bench).is_empty());
    ip(&format!("-n {near} address flush dev near0"));
    bench.wait_until("it is taken again", || used(&bench) == [index(&bench, "near0")]);
    bench.wait_for(AlState::PreOp);
    // A machine that runs keeps its bus, and its SubDevices are brought to the safe state at its end.
    let mut child = bench.application("killed");
    bench.wait_for(AlState::Op);
    let before = bench.lines().len();
    ip(&format!("-n {near} address add 192.0.2.1/24 dev near0"));
    stays(&bench, "it runs", |bench| bench.states() == "8 8 8 ");
    child.kill().expect("it runs");
    child.wait().expect("it has ended");
    bench.wait_for(AlState::PreOp);
    bench.wait_until("it is left", || bench.lines()[before..].iter().any(|line| line.contains("leaves near0 alone")));
    bench.wait_until("it is left", || used(&bench).is_empty());
}

/// Carriers of the links in the process that drives the master.
fn carriers(bench: &Bench) -> Vec<Option<bool>> {
    match bench.client().ask(0, Query::Tool(ToolQuery::Master), Vec::new()) {
        Ok((Answer::Tool(ToolAnswer::Master(report)), _)) => report.links.iter().map(|it| it.carrier).collect(),
        _ => Vec::new(),
    }
}

// covers: daemon, links
#[test]
fn links_are_found_by_their_address_whatever_their_name_is() {
    let Some(mut bench) = Bench::make(RING, &[0]) else { return };
    let near = bench.near.clone();
    ip(&format!("-n {near} link set near0 address 02:00:00:00:00:70"));
    bench.start_segment("0,1");
    bench.start_daemon(&["--master", "0=02:00:00:00:00:70,02:00:00:00:00:71"]);
    bench.wait_for(AlState::PreOp);
    bench.wait_for_line("master 0: interface 02:00:00:00:00:71 is not there; the ring goes on without it");
    let mut child = bench.application("killed");
    bench.wait_for(AlState::Op);
    // It comes with a name unknown to the application.
    bench.plug_in(1);
    ip(&format!("-n {near} link set near1 address 02:00:00:00:00:71"));
    bench.wait_for_line("master 0: interface near1 is there");
    bench.wait_until("both have a carrier", || carriers(&bench) == [Some(true), Some(true)]);
    assert_eq!(bench.states(), "8 8 8 ");
    child.kill().expect("it runs");
    child.wait().expect("it has ended");
    bench.wait_for(AlState::PreOp);
}

// covers: daemon
#[test]
fn interfaces_are_switched_with_the_daemon_but_not_under_an_application() {
    let Some(mut bench) = Bench::make(RING, &[0, 1]) else { return };
    let near = bench.near.clone();
    bench.pull_out(1);
    ip(&format!("-n {near} link set near0 down"));
    let conf = bench.place.join("ethercat.conf");
    let text =
        "MASTER0_DEVICE=near0\nMASTER0_BACKUP=near1\nUPDOWN_INTERFACES=\"near0 near1\"\nRINGCAT_BACKUP=required\n";
    std::fs::write(&conf, text).expect("it can be written");
    let conf = conf.to_str().expect("text").to_owned();
    bench.start_segment("0,1");
    let daemon = bench.start_daemon(&["--conf", &conf]);
    bench.wait_for_line("interface near1 is not there; it is switched on when it comes");
    bench.wait_for_line("master 0 is not driven: waits for interface near1");
    bench.wait_until("it is on", || has_flag_up(&bench, "near0"));
    stays(&bench, "it waits for its backup interface", |bench| used(bench).is_empty());
    bench.plug_in(1);
    bench.wait_for(AlState::PreOp);
    bench.wait_for_line("Slave(s) responding: 3");
    bench.end_daemon(daemon);
    assert!(!has_flag_up(&bench, "near0") && !has_flag_up(&bench, "near1"));
    let daemon = bench.start_daemon(&["--conf", &conf]);
    wait_for_scan(&bench);
    let said = || bench.lines().iter().filter(|line| line.contains("Slave(s) responding: 3")).count();
    bench.wait_until("both daemons have said so", || said() == 2);
    bench.wait_until("both are on", || has_flag_up(&bench, "near0") && has_flag_up(&bench, "near1"));
    bench.wait_for(AlState::PreOp);
    let mut child = bench.application("killed");
    bench.wait_for(AlState::Op);
    bench.end_daemon(daemon);
    bench.wait_for_line("interface near0 stays on: an application drives a bus");
    stays(&bench, "it runs", |bench| bench.states() == "8 8 8 " && has_flag_up(bench, "near0"));
    child.kill().expect("it runs");
    child.wait().expect("it has ended");
}

// covers: daemon, other-main-device
#[test]
fn other_users_of_an_interface_that_is_named_are_reported_at_the_start() {
    let Some(mut bench) = Bench::make(LINE, &[0]) else { return };
    ip(&format!("-n {} address add 192.0.2.1/24 dev near0", bench.near));
    bench.start_segment("0");
    bench.start_daemon(&["--master", "0=near0"]);
    bench.wait_for(AlState::PreOp);
    bench.wait_for_line("ringcatd: master 0: near0 has the IP address 192.0.2.1, so other programs send");
    // A second daemon is reported of the first one's sockets.
    let socket = bench.place.join("second");
    bench.start_daemon_at(&socket, &["--master", "0=near0"]);
    bench.wait_for_line("receives EtherCAT frames on near0 already");
}
