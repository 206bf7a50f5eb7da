//! Whole programs on simulated machines: the examples, all services.

use crate::library::{here, on_segment, outputs, program, root, workshop};

// covers: c-interface
#[test]
fn the_first_application_of_the_manual_reaches_op_and_prints_its_lines() {
    let examples = root().join("examples/c");
    let Some(first) = program(&examples.join("first_application.c"), &[]) else { return };
    let (output, ended) = on_segment(&first, &examples.join("first_application.toml"), &["8000"]);
    assert_eq!(ended, Ok(()), "{output}");
    let lines: Vec<&str> = output.lines().collect();
    // One LRW: 2 for each of the two SubDevices with outputs, 1 for the one with inputs.
    for wanted in ["Domain1: WC 5.", "Domain1: State 2.", "5 slave(s).", "Link is up.", "AnaIn: State 0x08."] {
        assert!(lines.contains(&wanted), "{wanted}\n{output}");
    }
    assert!(lines.contains(&"AnaIn: operational.") && lines.contains(&"AnaIn: online."), "{output}");
    // The SubDevice at position 1 stays in PREOP.
    assert!(lines.contains(&"AL states: 0x0A."), "{output}");
    assert!(!lines.iter().any(|line| line.starts_with("AL states: 0x01")), "{output}");
}

// covers: c-interface
#[test]
fn the_lines_that_users_search_for_are_on_standard_error() {
    let examples = root().join("examples/c");
    let Some(first) = program(&examples.join("first_application.c"), &[]) else { return };
    let (said, reported, status) = outputs(&first, &examples.join("first_application.toml"), &["3000"]);
    assert!(status.success(), "{said}\n{reported}");
    let mut rest = reported.as_str();
    for wanted in [
        "EtherCAT: Link state changed to UP.",
        "EtherCAT: Slave(s) responding: 5.",
        "EtherCAT: Scanning bus.",
        "EtherCAT: Bus scanning completed in ",
        "EtherCAT: Domain 0: Working counter changed to ",
    ] {
        let (_, behind) = rest.split_once(wanted).unwrap_or_else(|| panic!("{wanted} is missing in\n{reported}"));
        rest = behind;
    }
    assert!(reported.contains("EtherCAT: Slave states: "), "{reported}");
}

/// How well the clocks follow is tested in virtual time (`clock_times.rs`): here the calls come with the delays of a
/// busy host. The difference is printed; it is known, and the reference is read.
// covers: c-interface, dc-sync
#[test]
fn drives_with_clocks_reach_op_and_their_differences_are_known() {
    let examples = root().join("examples/c");
    let Some(clocks) = program(&examples.join("clocks.c"), &[]) else { return };
    let (output, ended) = on_segment(&clocks, &examples.join("clocks.toml"), &["6000"]);
    assert_eq!(ended, Ok(()), "{output}");
    assert!(output.contains("2 of 2 drives operational."), "{output}");
    let last = output.lines().rfind(|line| line.starts_with("AL states")).expect("a line about clocks");
    println!("{last}");
    assert!(last.contains("reference read"), "{output}");
    let difference = last.split("at most ").nth(1).and_then(|rest| rest.split(' ').next()).expect(last);
    assert!((1..1_000_000).contains(&difference.parse::<i64>().expect(last)), "{output}");
}

/// In the loop of the application frames count as on the wire until it receives again.
// covers: c-interface, dc-delays
#[test]
fn delays_are_measured_in_loops_of_1_to_50_ms() {
    let Some(periods) = program(&here().join("tests/c/periods.c"), &[]) else { return };
    for period_us in ["1000", "5000", "20000", "50000"] {
        let (output, ended) = on_segment(&periods, &root().join("examples/c/clocks.toml"), &[period_us]);
        println!("{period_us} us: {output}");
        assert_eq!(ended, Ok(()), "{period_us} us: {output}");
    }
}

/// Watchdog, SYNC signals, control of SyncManagers.
// covers: c-interface
#[test]
fn what_was_configured_is_in_the_registers_of_the_subdevices() {
    let Some(effects) = program(&here().join("tests/c/effects.c"), &[]) else { return };
    let (output, ended) = on_segment(&effects, &here().join("tests/c/effects.toml"), &["usual"]);
    assert_eq!(ended, Ok(()), "{output}");
}

// covers: c-interface
#[test]
fn a_state_change_that_takes_longer_than_its_limit_fails_and_a_line_says_so() {
    let Some(effects) = program(&here().join("tests/c/effects.c"), &[]) else { return };
    let (said, reported, status) = outputs(&effects, &here().join("tests/c/effects.toml"), &["short"]);
    assert!(status.success(), "{said}\n{reported}");
    assert!(reported.contains("EtherCAT: Slave configuration 0 failed: "), "{reported}");
}

// covers: c-interface
#[test]
fn each_service_does_its_work_on_simulated_subdevices() {
    let Some(services) = program(&here().join("tests/c/services.c"), &[]) else { return };
    let (output, ended) = on_segment(&services, &here().join("tests/c/services.toml"), &[]);
    assert_eq!(ended, Ok(()), "{output}");
    assert_eq!(output.lines().last(), Some("all services work"), "{output}");
}

// covers: c-interface
#[test]
fn a_configuration_is_for_the_subdevice_at_its_position_alone() {
    let Some(places) = program(&here().join("tests/c/places.c"), &[]) else { return };
    let segment = workshop().join("places.toml");
    let devices = ["digital-output-8", "digital-output-16"].map(|kind| format!("[[device]]\ntype = \"{kind}\"\n"));
    std::fs::write(&segment, format!("[segment]\n{}", devices.concat())).expect("a file");
    let (output, ended) = on_segment(&places, &segment, &[]);
    assert_eq!(ended, Ok(()), "{output}");
}

/// The segment file of the example cuts and repairs two cables.
// covers: c-interface, ring-cut, ring-status
#[test]
fn the_example_of_a_ring_stays_in_op_while_its_cables_are_cut_and_repaired() {
    let Some(ring) = program(&root().join("examples/c/ring.c"), &[]) else { return };
    // A machine that stalls for longer than a watchdog takes SubDevices out of OP.
    let run = || on_segment(&ring, &root().join("examples/c/ring.toml"), &["5500"]);
    let (output, ended) = (0..3).map(|_| run()).find(|(_, ended)| ended.is_ok()).unwrap_or_else(run);
    println!("{output}");
    assert_eq!(ended, Ok(()), "{output}");
    let changes = [
        "6 SubDevice(s) in OP.",
        "The ring is closed.",
        "Redundant link: up, 4 SubDevice(s).",
        "The ring is open.",
        "Redundant link: up, 0 SubDevice(s).",
        "The ring is closed.",
        "Redundant link: down, 0 SubDevice(s).",
        "The ring is open.",
        "Redundant link: up, 0 SubDevice(s).",
        "The ring is closed.",
    ];
    let mut lines = output.lines();
    for change in changes {
        assert!(lines.any(|line| line.ends_with(change)), "{change} did not follow: {output}");
    }
}
