//! The files of the service `ringcat-standby@`: read by systemd, and by the program that it starts.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::files::{Place, ringcat};

const UNIT: &str = "ringcat-standby@.service";
const SEGMENT: &str =
    "[segment]\nring = true\n[[device]]\ntype = \"coupler\"\n[[device]]\ntype = \"digital-output-4\"\n";
/// Maximum exposure level that `systemd-analyze security` may report, in tenths.
const EXPOSURE: &str = "--threshold=35";

fn packaged(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../packaging").join(name);
    fs::read_to_string(path).expect(name)
}

/// Assignments of the example, with those that a `#` disables.
fn assignments() -> Vec<(String, String)> {
    let text = packaged("ringcat-standby.conf");
    let pair = |line: &str| {
        let (name, value) = line.trim_start_matches('#').split_once('=')?;
        let is_name = name.starts_with("RINGCAT_") && !name.contains(' ');
        is_name.then(|| (name.to_owned(), value.trim_matches('"').to_owned()))
    };
    text.lines().filter_map(pair).collect()
}

/// The variables of the command of the unit.
fn variables() -> Vec<String> {
    let unit = packaged(UNIT);
    let command = unit.lines().find(|line| line.starts_with("ExecStart=")).expect("it starts a program");
    let names = command.split(' ').filter_map(|word| word.strip_prefix('$'));
    names.map(|name| name.trim_matches(['{', '}']).to_owned()).collect()
}

// covers: standby
#[test]
fn each_set_of_options_of_the_example_is_accepted_by_the_program() {
    let place = Place::new("service");
    let (segment, network, eni) = (place.write("ring.toml", SEGMENT), place.path("machine.toml"), place.path("it.xml"));
    let made = ringcat(&["init", "--sim", &segment, "--cycle", "5ms", "--out", &network]);
    assert_eq!(made.code, Some(0), "{}", made.all());
    let made = ringcat(&["eni", "export", "--network", &network, "--out", &eni]);
    assert_eq!(made.code, Some(0), "{}", made.all());
    let assignments = assignments();
    let options: Vec<&str> =
        assignments.iter().filter(|it| it.0 == "RINGCAT_OPTIONS").map(|it| it.1.as_str()).collect();
    assert_eq!(options.len(), 5, "{options:?}");
    for options in options {
        let there = options.replace("/etc/ringcat/machine.toml", &network).replace("/etc/ringcat/machine.xml", &eni);
        assert!(!there.contains("/etc/"), "{there}");
        let words: Vec<&str> = there.split(' ').collect();
        let refused =
            ringcat(&[&["standby", "--main", "no-such-if", "--redundant", "none-either"], &words[..]].concat());
        assert!(refused.verdict().contains("there is no network interface"), "{options}: {}", refused.all());
    }
}

// covers: standby
#[test]
fn the_command_of_the_unit_uses_the_variables_of_the_example_and_no_other() {
    let mut used = variables();
    let mut set: Vec<String> = assignments().into_iter().map(|(name, _)| name).collect();
    for names in [&mut used, &mut set] {
        names.sort();
        names.dedup();
    }
    assert_eq!(used, ["RINGCAT_MAIN", "RINGCAT_OPTIONS", "RINGCAT_REDUNDANT"]);
    assert_eq!(used, set);
}

/// The output of a program of systemd; `None`, with a printed line, where it is not installed.
fn analyze(arguments: &[&str], unit: &Path) -> Option<(Output, String)> {
    let output = Command::new("systemd-analyze").args(arguments).arg(unit).output();
    let output = output.inspect_err(|error| println!("skipped: systemd-analyze: {error}")).ok()?;
    let said = String::from_utf8_lossy(&[&output.stdout[..], &output.stderr].concat()).into_owned();
    Some((output, said))
}

/// The unit with the program of this build in place of the one that is installed.
fn unit(place: &Place) -> PathBuf {
    let text = packaged(UNIT);
    assert!(text.contains("ExecStart=/usr/bin/ringcat standby --main "), "{text}");
    PathBuf::from(place.write(UNIT, &text.replace("/usr/bin/ringcat", env!("CARGO_BIN_EXE_ringcat"))))
}

// covers: standby
#[test]
fn systemd_accepts_the_template_and_rates_its_exposure_as_low() {
    let place = Place::new("unit");
    let unit = unit(&place);
    let Some((verified, about)) = analyze(&["verify", "--man=no"], &unit) else { return };
    // An unknown key does not fail: systemd prints a line with the path of the unit.
    let is_named = about.lines().any(|line| line.contains("ringcat-standby"));
    assert!(verified.status.success() && !is_named, "{about}");
    let (security, about) = analyze(&["security", "--offline=yes", EXPOSURE], &unit).expect("it is there");
    println!("{}", about.lines().last().unwrap_or_default());
    assert!(security.status.success() && about.contains("Overall exposure level"), "{about}");
}
