//! Messages when a command cannot start, or when the segment is disturbed: each message states the remedy.

use std::path::Path;
use std::time::Duration;

use crate::bench::{Bench, Client, await_op, finish, program};
use crate::{Plant, RING_OF_16, said};

const TERMINAL: Plant = Plant { outputs: 1, inputs: 0, servos: 0, coupler: false };
/// Returns frames unchanged, like a cable into a switch or a loop.
pub const MIRROR: &str = "
import socket
s = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(0x88A4))
s.bind(('sim0', 0x88A4))
print('ready', flush=True)
while True:
    frame, origin = s.recvfrom(2000)
    if origin[2] != 4:
        s.send(frame)
";
const OTHER_MAIN_DEVICE: &str = "another MainDevice sends into this segment: frames from ";

/// Standard error of a `ringcat` command that fails.
fn error_of(bench: &Bench, arguments: &[&str]) -> String {
    let output = bench.ringcat(arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    said(&output).1
}

// covers: links
#[test]
fn a_command_that_cannot_start_prints_the_remedy() {
    let Some(bench) = Bench::new(1) else { return };
    for command in ["scan", "run"] {
        let missing = error_of(&bench, &[command, "--main", "nowhere"]);
        assert!(missing.contains("\"nowhere\"; there are: ") && missing.contains("main0"), "{missing}");
        let other = error_of(&bench, &[command, "--main", "lo"]);
        assert!(other.contains("lo is not an Ethernet interface; take the one"), "{other}");
    }
    let silent = error_of(&bench, &["scan", "--main", "main0"]);
    assert!(silent.contains("is the cable plugged and the first SubDevice powered?"), "{silent}");
    bench.set_link("sim0", "down");
    let dark = error_of(&bench, &["run", "--main", "main0"]);
    assert!(dark.contains("main0 has no link: is the cable plugged in"), "{dark}");
    bench.set_link("main0", "down");
    let off = error_of(&bench, &["scan", "--main", "main0"]);
    assert!(off.contains("main0 is switched off: sudo ip link set main0 up"), "{off}");
}

// covers: links
#[test]
fn a_cable_without_subdevices_is_distinguished_from_a_dead_cable() {
    let Some(bench) = Bench::new(1) else { return };
    // It prints that it is ready.
    let mirror = Client::new(bench.start_at_sim(Path::new("python3"), &["-c", MIRROR]));
    assert_eq!(mirror.line, "ready");
    let unchanged = error_of(&bench, &["scan", "--main", "main0"]);
    assert!(unchanged.contains("frames return, but no SubDevice processes them"), "{unchanged}");
    assert!(unchanged.contains("is this the cable to the SubDevices?"), "{unchanged}");
}

// covers: links
#[test]
fn a_missing_permission_is_reported_with_its_setcap_line() {
    let Some(bench) = Bench::new(1) else { return };
    let unprivileged = ["--reuid", "65534", "--regid", "65534", "--clear-groups", "--inh-caps", "-all"];
    let program = program("ringcat").display().to_string();
    for command in ["scan", "run", "sim", "capture"] {
        let mut arguments = vec![program.as_str(), command, "--main", "main0"];
        if command == "sim" {
            arguments.extend(["--segment", concat!(env!("CARGO_MANIFEST_DIR"), "/../sim/segments/demo.toml")]);
        }
        if command == "capture" {
            arguments.extend(["--out", "/dev/null"]);
        }
        let output = finish(bench.start(Path::new("setpriv"), &[&unprivileged, &arguments[..]].concat()));
        let errors = said(&output).1;
        if errors.contains("failed to execute") {
            println!("skipped: other users may not run {program}");
            return;
        }
        assert_eq!(output.status.code(), Some(2), "{errors}");
        assert!(errors.contains("not permitted to send and receive raw frames on main0; run as root or"), "{errors}");
        let program = std::fs::canonicalize(&program).expect("the program has a file");
        let capabilities = "cap_net_raw,cap_net_admin,cap_ipc_lock,cap_sys_nice=ep";
        let line = format!("sudo setcap {capabilities} {}", program.display());
        assert!(errors.contains(&line), "{errors}");
    }
}

// covers: stray-ring-cable
#[test]
fn a_ring_cable_at_another_interface_is_reported_with_its_name() {
    let Some(mut bench) = Bench::new(2) else { return };
    bench.simulate(&RING_OF_16.segment(), true);
    for command in ["scan", "run"] {
        let reports = error_of(&bench, &[command, "--main", "main0"]);
        assert!(reports.contains("frames sent on main0 arrive on main1: a cable of this segment"), "{reports}");
        let advice = "they arrive on main1; add --redundant main1 to run a ring, or unplug that cable";
        assert!(reports.contains(&format!("scan: no frame returns, {advice}")), "{reports}");
        assert!(!reports.contains("another MainDevice"), "{reports}");
    }
    // The same with marks in other bytes of the source address.
    let marked = error_of(&bench, &["scan", "--main", "main0", "--source-address", "id-last"]);
    assert!(marked.contains("frames sent on main0 arrive on main1: a cable of this segment"), "{marked}");
    // Both remedies of the message help.
    let (_, errors) = said(&bench.ringcat(&["scan", "--main", "main0", "--redundant", "main1"]));
    assert!(!errors.contains("arrive on"), "{errors}");
    bench.set_link("main1", "down");
    // An interface on top of the used one shows the same frames: this is not another cable.
    bench.ip_main("link add above link main0 type macvlan mode bridge");
    bench.ip_main("link set above up");
    let (listed, errors) = said(&bench.ringcat(&["scan", "--main", "main0", "--json"]));
    assert_eq!(listed.matches("\"station\"").count(), 16, "{errors}");
    assert!(!errors.contains("arrive on"), "{errors}");
}

// covers: stray-ring-cable
#[test]
fn a_cable_plugged_into_another_interface_in_operation_is_reported() {
    let Some(mut bench) = Bench::new(2) else { return };
    bench.set_link("main1", "down");
    bench.simulate(&TERMINAL.segment(), true);
    let run = bench.start_ringcat(&["run", "--main", "main0", "--for", "1s"]);
    await_op(&bench, 1);
    bench.set_link("main1", "up");
    std::thread::sleep(Duration::from_millis(200));
    bench.set_link("main1", "down");
    let (output, errors) = said(&finish(run));
    assert_eq!(errors.matches("frames sent on main0 arrive on main1").count(), 1, "{errors}{output}");
}

// covers: other-main-device
#[test]
fn a_main_device_at_the_other_end_of_the_segment_is_reported_once() {
    let Some(mut bench) = Bench::new(2) else { return };
    bench.give_away_main1();
    bench.set_link("sim1", "down");
    bench.simulate(&TERMINAL.segment(), true);
    let run = bench.start_ringcat(&["run", "--main", "main0", "--for", "3s"]);
    await_op(&bench, 1);
    bench.set_link("sim1", "up");
    let other = bench.start_other_ringcat(&["scan", "--main", "main1", "--force"]);
    // It gets no response: each MainDevice receives the other's frames.
    let (_, errors) = said(&finish(other));
    assert_eq!(errors.matches(OTHER_MAIN_DEVICE).count(), 1, "{errors}");
    assert!(errors.contains("arrive on main1 (MAIN)"), "{errors}");
    assert!(errors.contains("no frame returns"), "{errors}");
    assert!(errors.contains("frames of another MainDevice arrived: from ..:"), "{errors}");
    let (output, errors) = said(&finish(run));
    assert_eq!(errors.matches(OTHER_MAIN_DEVICE).count(), 1, "{errors}");
    assert!(errors.contains("arrive on main0 (MAIN)"), "{errors}");
    assert!(output.contains("  other MainDevices: "), "{output}");
}

#[test]
fn both_ends_of_a_veth_pair_in_one_namespace_are_not_a_wrong_cable() {
    let Some(bench) = Bench::new(1) else { return };
    bench.ip_main("link add near type veth peer name far");
    for interface in ["near", "far"] {
        bench.ip_main(&format!("link set {interface} addrgenmode none"));
        bench.ip_main(&format!("link set {interface} up"));
    }
    let segment = concat!(env!("CARGO_MANIFEST_DIR"), "/../sim/segments/demo.toml");
    let simulator = bench.run_ringcat(&["sim", "--main", "far", "--segment", segment]);
    while !simulator.said().so_far().contains("SubDevices are on the wire") {
        std::thread::sleep(Duration::from_millis(20));
    }
    let output = bench.ringcat(&["scan", "--main", "near"]);
    let (listed, errors) = said(&output);
    assert_eq!(output.status.code(), Some(0), "{listed}{errors}");
    assert!(listed.contains("result: ok: 19 SubDevices") && !errors.contains("arrive on"), "{listed}{errors}");
}
