//! Return codes of each function in each phase, compared with the table of docs/ecrt.md.

use crate::daemon::Bench;
use crate::library::{here, on_segment, program};
use crate::tables::conformance;

// covers: c-interface
#[test]
fn each_function_returns_the_code_of_the_table_in_each_phase() {
    let Some(calls) = conformance("conformance.c", &[]) else { return };
    let (output, ended) = on_segment(&calls, &here().join("tests/c/services.toml"), &[]);
    assert_eq!(ended, Ok(()), "{output}");
    check(&output);
}

// covers: c-interface, daemon
#[test]
fn the_codes_are_the_same_on_the_bus_of_a_daemon() {
    let Some(calls) = conformance("conformance.c", &[]) else { return };
    let bench = Bench::start(&here().join("tests/c/services.toml"), "conformance");
    let output = bench.command(&calls).output().expect("it runs");
    let (said, reported) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{said}\n{reported}");
    check(&said);
    bench.wait_for_preop();
}

/// The program has compared all results; what is left are the version, and calls with handles that were released.
fn check(output: &str) {
    let lines: Vec<&str> = output.lines().collect();
    let (last, others) = lines.split_last().expect("lines");
    assert!(last.ends_with(" rows, 0 wrong"), "{output}");
    let (version, released) = others.split_first().expect("lines");
    assert_eq!(*version, "ecrt_version_magic positive");
    assert!(released.len() > 40, "{output}");
    for line in released {
        let (function, result) = line.split_once(' ').expect(line);
        let wanted: &[&str] = match function {
            // (uint32_t) -1.
            "ecrt_master_sync_monitor_process" => &["positive"],
            _ if function.ends_with("_data_size") => &["0"],
            _ => &["EINVAL", "NULL", "ERROR"],
        };
        assert!(wanted.contains(&result), "{line}");
    }
}

// covers: c-interface
#[test]
fn memcheck_finds_nothing_while_each_function_is_called_in_each_phase() {
    let Some(calls) = conformance("conformance.c", &[]) else { return };
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
    let Some(calls) = conformance("conformance.c", &arguments) else { return };
    // Memory of ended handles is kept, so that late calls find them ended.
    let (all, segment) = (["ASAN_OPTIONS=detect_leaks=0", calls.to_str().expect("a path")], "tests/c/services.toml");
    let (output, ended) = on_segment("env".as_ref(), &here().join(segment), &all);
    assert_eq!(ended, Ok(()), "{output}");
    check(&output);
    // It finds what is wrong: a program that reads behind an array.
    let wrong = crate::library::workshop().join("wrong.c");
    let text = "int main(int n, char **v) { int a[4] = {0}; (void) v; return a[n + 3]; }\n";
    std::fs::write(&wrong, text).expect("a file");
    let wrong = program(&wrong, &arguments).expect("there is a compiler");
    let (_, ended) = on_segment(&wrong, &here().join(segment), &[]);
    assert!(ended.is_err_and(|text| text.contains("AddressSanitizer") || text.contains("runtime error")));
}
