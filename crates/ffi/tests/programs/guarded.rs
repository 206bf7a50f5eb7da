//! Panics within calls of C: each function is guarded, and a master in which one happened is not used any more.

use std::path::Path;

use crate::daemon::Bench;
use crate::library::{here, outputs, program};

/// The call with which a guarded function ends.
const GUARDS: [&str; 4] = ["call(", "call_for(", "ask(", "caught("];
/// Functions that end in a guard themselves, to which functions of C pass their arguments.
const PASSING: [&str; 5] = ["add_sdo(", "create(", "load(", "named(", "register("];

/// The functions of a file whose head begins with one of these words: head and body, as rustfmt lays them out.
fn functions<'a>(text: &'a str, heads: &'a [&str]) -> Vec<(&'a str, &'a str)> {
    let begins = |line: &&str| heads.iter().any(|head| line.starts_with(head));
    let heads = text.lines().filter(begins);
    let body = |head: &'a str| {
        let from = text.find(head).expect("a line of it");
        let (_, rest) = text[from..].split_once("{\n").expect("a body");
        (head, rest.split("\n}").next().expect("an end"))
    };
    heads.map(body).collect()
}

/// Whether a body has only closures and one guarded call, so that all of its code runs in the guard.
fn is_guarded(body: &str) -> bool {
    let mut lines = body.lines().filter(|line| !line.trim().starts_with("//")).peekable();
    while let Some(line) = lines.next() {
        let Some(statement) = line.strip_prefix("    ") else { return line.is_empty() && lines.peek().is_none() };
        if let Some((_, value)) = statement.split_once(" =").filter(|_| statement.starts_with("let ")) {
            let value = if value.is_empty() { lines.next().unwrap_or("") } else { value };
            if !value.trim().starts_with('|') {
                return false;
            }
            while lines.next_if(|line| line.starts_with("     ") || line.trim() == "};").is_some() {}
            continue;
        }
        // The last expression.
        let call = statement.trim_start_matches("unsafe {").trim();
        let call = if call.is_empty() { lines.next().unwrap_or("").trim() } else { call };
        let call = call.trim_start_matches("waiting::");
        let is_call = GUARDS.iter().chain(&PASSING).any(|guard| call.starts_with(guard));
        return is_call && lines.all(|line| line.starts_with("     ") || line.trim_start().starts_with(['}', ')']));
    }
    false
}

/// The sources of the functions of C.
fn sources() -> Vec<(String, String)> {
    let files = std::fs::read_dir(here().join("src/c")).expect("the sources").flatten().map(|file| file.path());
    let read = |path: &Path| std::fs::read_to_string(path).expect("a source");
    files.map(|path| (path.file_name().expect("a name").to_string_lossy().into_owned(), read(&path))).collect()
}

// covers: c-interface
#[test]
fn each_function_of_c_runs_in_the_guard_of_panics() {
    let heads = ["unsafe extern \"C\" fn ", "extern \"C\" fn "];
    let (mut count, mut unguarded) = (0, Vec::new());
    for (file, text) in &sources() {
        let passing = PASSING.map(|name| format!("unsafe fn {}", name.trim_end_matches('(')));
        let mut passing: Vec<String> = passing.iter().flat_map(|head| [head.clone(), format!("pub {head}")]).collect();
        passing.iter_mut().for_each(|head| head.push('('));
        let generic = passing.iter().map(|head| head.replace('(', "<")).collect::<Vec<_>>();
        let passing: Vec<&str> = passing.iter().chain(&generic).map(String::as_str).collect();
        let all = functions(text, &heads);
        count += all.len();
        let all = all.into_iter().chain(functions(text, &passing));
        unguarded.extend(all.filter(|(_, body)| !is_guarded(body)).map(|(head, _)| format!("{file}: {head}")));
    }
    assert!(unguarded.is_empty(), "{unguarded:#?}");
    // Those of both headers, and what `exit` calls.
    assert_eq!(count, 103 + 9 + 1);
    assert!(is_guarded("    // SAFETY: x.\n    unsafe { call(a, |b| b.c()) }"));
    assert!(is_guarded("    let f = |a| {\n        a\n    };\n    unsafe {\n        ask(f)\n    }"));
    for wrong in ["    a.b()", "    let x = f();\n    unsafe { call(x) }", "    caught(0, 0, f);\n    g()"] {
        assert!(!is_guarded(wrong), "{wrong}");
    }
    // No other file has functions for C but those that a fork calls, which adds one to a number.
    for file in ["host.rs", "locks.rs", "code.rs"] {
        let text = std::fs::read_to_string(here().join("src").join(file)).expect("a source");
        assert_eq!(functions(&text, &heads).len(), usize::from(file == "host.rs"), "{file}");
    }
}

// covers: c-interface
#[test]
fn a_panic_within_a_call_fails_its_master_alone_until_that_is_released() {
    let Some(panics) = program(&here().join("tests/c/panics.c"), &[]) else { return };
    let segment = here().join("tests/c/services.toml");
    let second = format!("RINGCAT_SIM_1={}", segment.display());
    let (said, reported, status) = outputs("env".as_ref(), &segment, &[&second, panics.to_str().expect("a path")]);
    assert!(status.success(), "{said}\n{reported}");
    assert_eq!(said, "all as expected\n", "{reported}");
    let line = "EtherCAT: Internal error: provoked by a test. The master takes no calls until it is released.";
    assert_eq!(reported.lines().filter(|reported| *reported == line).count(), 1, "{reported}");
}

/// On a segment in this process, and on one behind sockets of a daemon, as on interfaces; libfakeethercat, too.
// covers: c-interface, daemon
#[test]
fn no_call_is_a_cancellation_point() {
    let Some(cancelled) = program(&here().join("tests/c/cancelled.c"), &["-pthread"]) else { return };
    let segment = here().join("tests/c/services.toml");
    let (said, reported, status) = outputs(&cancelled, &segment, &[]);
    assert!(status.success(), "{said}\n{reported}");
    assert_eq!(said, "no call was cancelled\n", "{reported}");
    let bench = Bench::start(&segment, "cancelled");
    let output = bench.command(&cancelled).output().expect("it runs");
    let (said, reported) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{said}\n{reported}");
    assert_eq!(said, "no call was cancelled\n", "{reported}");
    bench.wait_for_preop();
}
