//! Return codes of functions with arguments that are wrong or extreme, compared with the second table of docs/ecrt.md.

use crate::daemon::Bench;
use crate::library::{here, on_segment};
use crate::tables::conformance;

/// The program has compared all results.
fn check(output: &str) {
    assert!(output.ends_with(" rows, 0 wrong\n"), "{output}");
}

// covers: c-interface
#[test]
fn wrong_and_extreme_arguments_get_the_codes_of_the_table() {
    let Some(calls) = conformance("arguments.c", &[]) else { return };
    let (output, ended) = on_segment(&calls, &here().join("tests/c/services.toml"), &[]);
    assert_eq!(ended, Ok(()), "{output}");
    check(&output);
}

// covers: c-interface, daemon
#[test]
fn wrong_and_extreme_arguments_get_the_same_codes_on_the_bus_of_a_daemon() {
    let Some(calls) = conformance("arguments.c", &[]) else { return };
    let bench = Bench::start(&here().join("tests/c/services.toml"), "arguments");
    let output = bench.command(&calls).output().expect("it runs");
    let (said, reported) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{said}\n{reported}");
    check(&said);
    bench.wait_for_preop();
}

/// The calls of both threads beside each other; the program and its calls into the library are checked.
// covers: c-interface
#[test]
fn memcheck_finds_nothing_while_wrong_arguments_come_from_two_threads() {
    let Some(calls) = conformance("arguments.c", &[]) else { return };
    if std::process::Command::new("valgrind").arg("--version").output().is_err() {
        println!("skipped: there is no valgrind");
        return;
    }
    let suppressions = format!("--suppressions={}", here().join("tests/c/memcheck.supp").display());
    let arguments = ["--quiet", "--error-exitcode=9", "--leak-check=no", "--fair-sched=yes", &suppressions];
    let calls = calls.to_str().expect("a path");
    let (all, segment) = ([&arguments[..], &[calls]].concat(), here().join("tests/c/services.toml"));
    let (output, ended) = on_segment("valgrind".as_ref(), &segment, &all);
    assert_eq!(ended, Ok(()), "{output}");
    check(&output);
}
