//! Return codes of each function in each phase, compared with the table of docs/ecrt.md.

use std::collections::BTreeMap;

use crate::daemon::Bench;
use crate::library::{here, on_segment, program, root};

/// Columns of the table by the phases that the program prints.
const PHASES: [&str; 5] = ["opened", "requested", "active", "deactivated", "NULL"];

/// The table: function and phase, with the code.
fn table() -> BTreeMap<(String, &'static str), String> {
    let page = std::fs::read_to_string(root().join("docs/ecrt.md")).expect("docs/ecrt.md");
    let mut table = BTreeMap::new();
    for line in page.lines().filter(|line| line.starts_with("| `ecrt_")) {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        if let [function, codes @ .., _source] = &cells[..]
            && codes.len() == PHASES.len()
        {
            for (phase, code) in PHASES.into_iter().zip(codes) {
                table.insert((function.trim_matches('`').to_owned(), phase), (*code).to_owned());
            }
        }
    }
    table
}

// covers: c-interface
#[test]
fn each_function_returns_the_code_of_the_table_in_each_phase() {
    let Some(calls) = program(&here().join("tests/c/conformance.c"), &[]) else { return };
    let (output, ended) = on_segment(&calls, &here().join("tests/c/services.toml"), &[]);
    assert_eq!(ended, Ok(()), "{output}");
    compare(&output);
}

// covers: c-interface, daemon
#[test]
fn the_codes_are_the_same_on_the_bus_of_a_daemon() {
    let Some(calls) = program(&here().join("tests/c/conformance.c"), &[]) else { return };
    let bench = Bench::start(&here().join("tests/c/services.toml"), "conformance");
    let output = bench.command(&calls).output().expect("it runs");
    let (said, reported) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{said}\n{reported}");
    compare(&said);
    bench.wait_for_preop();
}

/// Compares what the program has printed with the table.
fn compare(output: &str) {
    let mut expected = table();
    assert!(expected.len() > 95 * PHASES.len(), "{} rows", expected.len());
    let mut wrong = Vec::new();
    for line in output.lines() {
        let [function, phase, got] = line.split(' ').collect::<Vec<_>>()[..] else { panic!("{line}") };
        let Some(phase) = PHASES.into_iter().find(|known| *known == phase) else { continue };
        let wanted = expected.remove(&(function.to_owned(), phase));
        if wanted.as_deref() != Some(got) {
            wrong.push(format!("{function} {phase}: expected {wanted:?}, got {got}"));
        }
    }
    // What the table promises and the program does not call.
    let promised = expected.iter().filter(|(_, code)| *code != "-");
    wrong.extend(promised.map(|(call, code)| format!("{call:?} {code}: not called")));
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let released = output.lines().filter(|line| line.contains(" released "));
    assert!(released.clone().count() > 40);
    let good = ["EINVAL", "NULL", "ERROR", "0", "positive"];
    assert!(released.clone().all(|line| good.iter().any(|good| line.ends_with(good))), "{output}");
}

// covers: c-interface
#[test]
fn memcheck_finds_nothing_while_each_function_is_called_in_each_phase() {
    let Some(calls) = program(&here().join("tests/c/conformance.c"), &[]) else { return };
    if std::process::Command::new("valgrind").arg("--version").output().is_err() {
        println!("skipped: there is no valgrind");
        return;
    }
    let suppressions = format!("--suppressions={}", here().join("tests/c/memcheck.supp").display());
    let arguments = ["--quiet", "--error-exitcode=9", "--leak-check=no", &suppressions];
    let calls = calls.to_str().expect("a path");
    let (all, segment) = ([&arguments[..], &[calls]].concat(), here().join("tests/c/services.toml"));
    let (output, ended) = on_segment("valgrind".as_ref(), &segment, &all);
    assert_eq!(ended, Ok(()), "{output}");
}

/// The program and its calls into the C library are checked; the library itself is memcheck's.
// covers: c-interface
#[test]
fn the_address_sanitizer_finds_nothing_while_each_function_is_called_in_each_phase() {
    let library = std::process::Command::new("cc").arg("-print-file-name=libasan.so").output();
    // Without the library the compiler prints the bare name.
    let has_library = library.is_ok_and(|output| String::from_utf8_lossy(&output.stdout).contains('/'));
    if !has_library {
        println!("skipped: the C compiler has no address sanitizer");
        return;
    }
    let arguments = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-omit-frame-pointer"];
    let Some(calls) = program(&here().join("tests/c/conformance.c"), &arguments) else { return };
    // Memory of ended handles is kept, so that late calls find them ended.
    let (all, segment) = (["ASAN_OPTIONS=detect_leaks=0", calls.to_str().expect("a path")], "tests/c/services.toml");
    let (output, ended) = on_segment("env".as_ref(), &here().join(segment), &all);
    assert_eq!(ended, Ok(()), "{output}");
    compare(&output);
    // It finds what is wrong: a program that reads behind an array.
    let wrong = crate::library::workshop().join("wrong.c");
    let text = "int main(int n, char **v) { int a[4] = {0}; (void) v; return a[n + 3]; }\n";
    std::fs::write(&wrong, text).expect("a file");
    let wrong = program(&wrong, &arguments).expect("there is a compiler");
    let (_, ended) = on_segment(&wrong, &here().join(segment), &[]);
    assert!(ended.is_err_and(|text| text.contains("AddressSanitizer") || text.contains("runtime error")));
}
