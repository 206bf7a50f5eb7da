//! Network interfaces of EoE, which the daemon makes: they outlast applications, and daemons that are killed.

use std::process::Command;

use ringcat::AlState;

use crate::bench::{Bench, ip};

/// A SubDevice with an IP stack between two others.
const DEVICES: &str = "[segment]\n[[device]]\ntype = \"digital-output-8\"\n[[device]]\ntype = \"ethernet-terminal\"\n\
                       ip = \"192.168.77.2/24\"\n[[device]]\ntype = \"servo\"\n";
const NAME: &str = "eoe0s1";

/// Number of the interface; `None` if it is not there.
fn index(bench: &Bench) -> Option<u32> {
    let shown = Command::new("ip").args(["-n", &bench.near, "-o", "link", "show", NAME]).output().expect("ip is there");
    String::from_utf8_lossy(&shown.stdout).split(':').next()?.parse().ok()
}

/// The host's end of the network.
fn set_up(bench: &Bench) -> u32 {
    bench.wait_until("the interface", || index(bench).is_some());
    ip(&format!("-n {} link set {NAME} up", bench.near));
    ip(&format!("-n {} addr add 192.168.77.1/24 dev {NAME}", bench.near));
    index(bench).expect("it is there")
}

/// A connection to the SubDevice passes frames: its stack answers.
fn check_answers(bench: &Bench, what: &str) {
    bench.wait_until(what, || bench.fetches("192.168.77.2:80"));
}

// covers: daemon, eoe-interfaces
#[test]
fn interfaces_of_eoe_outlast_applications_and_killed_daemons() {
    let Some(mut bench) = Bench::make(DEVICES, &[0]) else { return };
    bench.start_segment("0");
    let options = ["--master", "0=near0"];
    let daemon = bench.start_daemon(&options);
    bench.wait_for(AlState::PreOp);
    let first = set_up(&bench);
    check_answers(&bench, "idle");
    bench.wait_for_line("master 0: network interface eoe0s1 leads to");
    let mut orderly = bench.application("orderly");
    assert!(orderly.wait().expect("it ends").success());
    bench.wait_for(AlState::PreOp);
    check_answers(&bench, "after a release");
    let mut child = bench.application("killed");
    bench.wait_for(AlState::Op);
    check_answers(&bench, "beside an application");
    child.kill().expect("it runs");
    child.wait().expect("it has ended");
    bench.wait_for(AlState::PreOp);
    check_answers(&bench, "after SIGKILL of an application");
    let mut child = bench.application("killed");
    bench.wait_for(AlState::Op);
    bench.kill_daemon(daemon);
    check_answers(&bench, "after SIGKILL of the daemon, beside an application");
    let daemon = bench.start_daemon(&options);
    bench.wait_for_line("waits for the end of \"application\"");
    assert_eq!(index(&bench), Some(first));
    child.kill().expect("it runs");
    child.wait().expect("it has ended");
    bench.wait_for(AlState::PreOp);
    check_answers(&bench, "with the next daemon");
    bench.kill_daemon(daemon);
    assert_eq!(index(&bench), Some(first), "nothing has it open");
    let daemon = bench.start_daemon(&options);
    bench.client();
    check_answers(&bench, "with the third daemon");
    assert_eq!(index(&bench), Some(first), "it was there all the time, with its address");
    bench.end_daemon(daemon);
    bench.wait_until("the interface ends with a daemon in order", || index(&bench).is_none());
}

// covers: daemon, eoe-interfaces
#[test]
fn a_simulated_segment_has_interfaces_of_eoe_where_the_daemon_may_make_them() {
    let Some(mut bench) = Bench::make(DEVICES, &[]) else { return };
    let master = format!("0=sim:{}", bench.place.join("segment.toml").display());
    let daemon = bench.start_daemon(&["--master", &master]);
    set_up(&bench);
    check_answers(&bench, "idle");
    bench.end_daemon(daemon);
    bench.wait_until("the interface ends with the daemon", || index(&bench).is_none());
    let daemon = bench.start_daemon(&["--master", &master, "--no-eoe"]);
    bench.client();
    std::thread::sleep(std::time::Duration::from_millis(1500));
    assert!(index(&bench).is_none());
    assert!(!bench.lines().iter().any(|line| line.contains("EoE")), "{:#?}", bench.lines());
    bench.end_daemon(daemon);
    // Without the capability it says that there are none, and drives the segment all the same.
    bench.start_daemon_as_user(&["--master", &master]);
    bench.client();
    bench.wait_for_line("master 0: EoE: not permitted to make the network interface eoe0s1");
    assert!(index(&bench).is_none());
}
