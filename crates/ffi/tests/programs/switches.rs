//! What the switches of `configure` decide, as settings: variables of a program that opens links itself, and settings
//! of a daemon, which a program gets with its bus.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use ringcat::daemon::known::ToolQuery;
use ringcat::daemon::{BusSettings, Query};
use ringcat::sim::cable::DeviceIndex;
use ringcat::sim::fault::Fault;

use crate::daemon::{Bench, wait_for_line};
use crate::library::{here, program, workshop};

/// Two SubDevices of one kind, the second one with an alias.
fn segment(test: &str) -> PathBuf {
    let path = workshop().join(format!("switches-{test}.toml"));
    let text = "[[device]]\ntype = \"digital-output-8\"\n[[device]]\ntype = \"digital-output-8\"\nalias = 7\n";
    std::fs::write(&path, text).expect("it can be written");
    path
}

/// The output of the program for a SubDevice with this place and identity; its error if it fails.
fn said(command: &mut Command, place: [&str; 4]) -> Result<String, String> {
    let Output { status, stdout, stderr } = command.args(place).output().expect("it runs");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    if status.success() { Ok(text(&stdout)) } else { Err(text(&stderr)) }
}

const ANY: &str = "0xffffffff";
const FOUND: &str = "alias 7, operational\n";
const MISSING: &str = "alias 7, not there\n";

// covers: c-interface
#[test]
fn variables_of_a_program_with_links_of_its_own_are_switches() {
    let Some(switches) = program(&here().join("tests/c/switches.c"), &[]) else { return };
    let segment = segment("own");
    let run = |variables: &[(&str, &str)], place| {
        let mut command = Command::new(&switches);
        said(command.env("RINGCAT_SIM", &segment).envs(variables.iter().copied()), place)
    };
    assert_eq!(run(&[], ["0", "1", "own", "own"]).as_deref(), Ok(FOUND));
    for place in [["0", "1", ANY, ANY], ["0", "1", "own", ANY], ["7", "0", ANY, "own"]] {
        assert_eq!(run(&[], place).as_deref(), Ok(MISSING), "{place:?}");
        assert_eq!(run(&[("RINGCAT_WILDCARDS", "yes")], place).as_deref(), Ok(FOUND), "{place:?}");
    }
    let wrong = run(&[("RINGCAT_REGALIAS", "1")], ["0", "1", ANY, ANY]).expect_err("the variable is wrong");
    assert!(wrong.contains("RINGCAT_REGALIAS: expected yes or no, got \"1\""), "{wrong}");
}

// covers: c-interface, daemon
#[test]
fn a_program_has_the_settings_of_its_daemon() {
    let Some(switches) = program(&here().join("tests/c/switches.c"), &[]) else { return };
    let run = |bench: &Bench, switches: &Path, place| said(&mut bench.command(switches), place);
    let (segment, mut settings) = (segment("daemon"), BusSettings::default());
    let plain = Bench::start_with(&segment, "switches", settings.clone());
    assert_eq!(run(&plain, &switches, ["7", "0", ANY, "own"]).as_deref(), Ok(MISSING));
    settings.has_wildcards = true;
    let wild = Bench::start_with(&segment, "wild", settings);
    assert_eq!(run(&wild, &switches, ["7", "0", ANY, "own"]).as_deref(), Ok(FOUND));
    // With a daemon the variables of the program have no effect.
    let mut command = plain.command(&switches);
    assert_eq!(said(command.env("RINGCAT_WILDCARDS", "yes"), ["7", "0", ANY, "own"]).as_deref(), Ok(MISSING));
}

// covers: c-interface, daemon, eeprom
#[test]
fn an_alias_that_was_written_counts_at_once_or_stays_that_of_the_register() {
    let Some(switches) = program(&here().join("tests/c/switches.c"), &[]) else { return };
    let segment = segment("alias");
    for (reads_alias_register, expected) in [(false, "alias 9, operational\n"), (true, "alias 7, operational\n")] {
        let mut settings = BusSettings::default();
        settings.reads_alias_register = reads_alias_register;
        let bench = Bench::start_with(&segment, &format!("alias-{reads_alias_register}"), settings);
        bench.ask(Query::Tool(ToolQuery::AliasWrite { position: 1, alias: 9, force: false }));
        let alias = if reads_alias_register { "7" } else { "9" };
        let said = said(&mut bench.command(&switches), [alias, "0", "own", "own"]);
        assert_eq!(said.as_deref(), Ok(expected), "register: {reads_alias_register}");
    }
}

// covers: c-interface, daemon
#[test]
fn without_rt_syslog_no_line_is_about_a_working_counter() {
    let Some(program) = program(&here().join("tests/c/lossless.c"), &[]) else { return };
    let segment = segment("lines");
    for prints_cyclic_lines in [true, false] {
        let mut settings = BusSettings::default();
        settings.prints_cyclic_lines = prints_cyclic_lines;
        let bench = Bench::start_with(&segment, &format!("lines-{prints_cyclic_lines}"), settings);
        let mut command = bench.command(&program);
        let command = command.args(["2000", "once"]).stdin(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("it runs");
        let _lines = wait_for_line(&mut child, "op");
        bench.inside(|segment| segment.network_mut().apply(Fault::PowerOff(DeviceIndex(1))));
        std::thread::sleep(Duration::from_secs(3));
        child.kill().expect("it runs");
        let output = child.wait_with_output().expect("it has ended");
        let text = String::from_utf8_lossy(&output.stderr);
        // The absence of the SubDevice is reported without a cyclic line, too.
        assert!(text.contains("responding: 1."), "{text}");
        assert_eq!(text.contains("orking counter"), prints_cyclic_lines, "{text}");
    }
}
