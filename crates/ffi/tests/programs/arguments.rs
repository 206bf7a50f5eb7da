//! Return codes of functions with arguments that are wrong or extreme, compared with the second table of docs/ecrt.md.

use std::collections::BTreeMap;

use crate::daemon::Bench;
use crate::library::{here, on_segment, program, root};

/// Calls with their codes.
type Codes = BTreeMap<(String, String), String>;

/// The table: function and argument, with the code.
fn table() -> Codes {
    let page = std::fs::read_to_string(root().join("docs/ecrt.md")).expect("docs/ecrt.md");
    let mut table = BTreeMap::new();
    for line in page.lines().filter(|line| line.starts_with("| `ecrt_")) {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        if let [function, argument, code, _source] = &cells[..] {
            let call = (function.trim_matches('`').to_owned(), (*argument).to_owned());
            assert_eq!(table.insert(call, (*code).to_owned()), None, "twice: {line}");
        }
    }
    table
}

/// Compares what the program has printed with the table. A call may come several times, with the same code.
fn compare(output: &str) {
    let expected = table();
    assert!(expected.len() > 100, "{} rows", expected.len());
    let (mut called, mut wrong) = (Codes::new(), Vec::new());
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for line in output.lines() {
        let [function, argument, got] = line.split('|').collect::<Vec<_>>()[..] else { panic!("{line}") };
        let call = (function.to_owned(), argument.to_owned());
        let wanted = expected.get(&call).map(String::as_str);
        if wanted != Some(got) {
            wrong.push(format!("{call:?}: expected {wanted:?}, got {got}"));
        }
        called.insert(call, got.to_owned());
        *counts.entry(function).or_default() += 1;
    }
    wrong
        .extend(expected.keys().filter(|call| !called.contains_key(*call)).map(|call| format!("{call:?}: not called")));
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    // Two threads, in two phases.
    assert_eq!(counts["ecrt_master_link_state"], 4 * 5, "{output}");
}

// covers: c-interface
#[test]
fn wrong_and_extreme_arguments_get_the_codes_of_the_table() {
    let Some(calls) = program(&here().join("tests/c/arguments.c"), &[]) else { return };
    let (output, ended) = on_segment(&calls, &here().join("tests/c/services.toml"), &[]);
    assert_eq!(ended, Ok(()), "{output}");
    compare(&output);
}

// covers: c-interface, daemon
#[test]
fn wrong_and_extreme_arguments_get_the_same_codes_on_the_bus_of_a_daemon() {
    let Some(calls) = program(&here().join("tests/c/arguments.c"), &[]) else { return };
    let bench = Bench::start(&here().join("tests/c/services.toml"), "arguments");
    let output = bench.command(&calls).output().expect("it runs");
    let (said, reported) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{said}\n{reported}");
    compare(&said);
    bench.wait_for_preop();
}

/// The calls of both threads beside each other; the program and its calls into the library are checked.
// covers: c-interface
#[test]
fn memcheck_finds_nothing_while_wrong_arguments_come_from_two_threads() {
    let Some(calls) = program(&here().join("tests/c/arguments.c"), &[]) else { return };
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
    compare(&output);
}
