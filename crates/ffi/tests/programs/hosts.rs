//! Programs of several kinds: with locked memory, with children, with the rights of another user, that unload the
//! library.

use std::os::unix::fs::PermissionsExt;
use std::process::Command;

use ringcatd::rights::Rights;

use crate::daemon::Bench;
use crate::library::{copy_program, here, installed, on_segment, outputs, program};

fn ends_well(mode: &[&str]) {
    let Some(hosts) = program(&here().join("tests/c/hosts.c"), &[]) else { return };
    let (output, ended) = on_segment(&hosts, &here().join("tests/c/services.toml"), mode);
    assert_eq!(ended, Ok(()), "{mode:?}\n{output}");
    println!("{output}");
}

/// The simulated segment in it included; 8 MiB are usual.
// covers: c-interface
#[test]
fn a_program_that_locks_its_memory_needs_at_most_6_mib_for_the_library() {
    ends_well(&["locked", "6"]);
}

// covers: c-interface
#[test]
fn a_program_with_too_little_memory_to_lock_gets_the_limit_to_set() {
    let Some(hosts) = program(&here().join("tests/c/hosts.c"), &[]) else { return };
    for mib in ["1", "2", "3", "4", "5"] {
        let (said, reported, status) = outputs(&hosts, &here().join("tests/c/services.toml"), &["locked", mib]);
        let is_reported = reported.contains("expected a limit of 16384 KiB at least") && status.code() == Some(1);
        assert!(status.success() || is_reported, "{mib} MiB: {status}\n{said}\n{reported}");
        println!("{mib} MiB: {status}");
    }
}

/// With the threads that answer questions of the daemon's clients.
// covers: c-interface, daemon
#[test]
fn a_program_on_a_daemons_bus_that_locks_its_memory_needs_at_most_6_mib() {
    let Some(hosts) = program(&here().join("tests/c/hosts.c"), &[]) else { return };
    // The user that the program becomes.
    let rights = Rights { group: Some(65534), mode: 0o666 };
    let bench = Bench::start_for(&here().join("tests/c/services.toml"), "locked", rights);
    let output = bench.command(&hosts).args(["locked", "6"]).output().expect("it runs");
    let (said, reported) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{said}\n{reported}");
    println!("{said}");
    bench.wait_for_preop();
}

// covers: c-interface
#[test]
fn handles_of_a_parent_are_refused_in_a_child_which_may_open_a_master_of_its_own() {
    ends_well(&["fork"]);
}

// covers: c-interface
#[test]
fn a_child_that_is_made_while_another_thread_requests_a_master_requests_one_too() {
    let Some(beside) = program(&here().join("tests/c/fork_beside.c"), &[]) else { return };
    let (output, ended) = on_segment(&beside, &here().join("tests/c/services.toml"), &[]);
    assert_eq!(ended, Ok(()), "{output}");
    println!("{output}");
}

// covers: c-interface
#[test]
fn threads_of_the_library_block_all_signals_install_no_handler_and_end_at_release() {
    ends_well(&["threads"]);
}

// covers: c-interface
#[test]
fn a_program_that_ends_without_a_release_leaves_all_subdevices_in_preop() {
    let Some(hosts) = program(&here().join("tests/c/hosts.c"), &[]) else { return };
    let (said, reported, status) = outputs(&hosts, &here().join("tests/c/services.toml"), &["exit"]);
    assert!(status.success(), "{said}\n{reported}");
    let states = reported.lines().filter_map(|line| line.split_once("Slave states: "));
    let states: Vec<&str> = states.map(|(_, states)| states).collect();
    assert!(states.contains(&"PREOP, OP.") && states.last() == Some(&"PREOP."), "{reported}");
}

// covers: c-interface
#[test]
fn the_library_is_opened_and_closed_a_hundred_times_in_one_process() {
    let Some(unloaded) = program(&here().join("tests/c/unloaded.c"), &["-Wl,--as-needed"]) else { return };
    let library = installed().expect("it was compiled").join("lib/libethercat.so.1");
    let segment = here().join("tests/c/services.toml");
    let (output, ended) = on_segment(&unloaded, &segment, &[library.to_str().expect("a path")]);
    assert_eq!((output.as_str(), ended), ("100 rounds\n", Ok(())));
}

/// Needs root, to make a program that runs with other rights than its user, and `setpriv`.
// covers: c-interface
#[test]
fn a_set_uid_program_ignores_the_variables_of_its_user() {
    let Some(hosts) = program(&here().join("tests/c/hosts.c"), &[]) else { return };
    let place = std::env::temp_dir().join(format!("ringcat-set-uid-{}", std::process::id()));
    assert!(copy_program(&hosts, &place));
    std::fs::set_permissions(&place, PermissionsExt::from_mode(0o4755)).expect("permissions");
    let library = std::fs::canonicalize(installed().expect("it was compiled").join("lib/libethercat.so.1"));
    let segment = here().join("tests/c/services.toml");
    let as_other = |program: &str| {
        let mut command = Command::new("setpriv");
        command.args(["--reuid", "65534", "--clear-groups", program, "open"]).env("RINGCAT_SIM", &segment);
        command.output()
    };
    let is_root = std::os::unix::fs::MetadataExt::uid(&std::fs::metadata("/proc/self").expect("proc")) == 0;
    let usual = as_other(hosts.to_str().expect("a path"));
    let (true, Ok(usual), Ok(_)) = (is_root, usual, library) else {
        let _ = std::fs::remove_file(&place);
        println!("skipped: needs root and setpriv");
        return;
    };
    let secure = as_other(place.to_str().expect("a path"));
    let _ = std::fs::remove_file(&place);
    let secure = secure.expect("setpriv");
    let said = String::from_utf8_lossy(&secure.stderr);
    if !usual.status.success() || said.contains("error while loading") {
        println!("skipped: another user cannot read this directory: {said}");
        return;
    }
    assert_eq!(secure.status.code(), Some(1), "{said}");
    assert!(said.contains("or RINGCAT_MAIN (an interface) or RINGCAT_SIM"), "{said}");
}
