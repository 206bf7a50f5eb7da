//! The `ringcat` program as a user calls it.

use std::io::Read;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

fn ringcat(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ringcat")).args(arguments).output().expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn segment(name: &str) -> String {
    format!("{}/../sim/segments/{name}.toml", env!("CARGO_MANIFEST_DIR"))
}

// covers: demo
#[test]
fn the_demonstration_on_the_embedded_ring_holds() {
    let output = ringcat(&["demo", "--fast"]);
    let said = text(&output.stdout);
    assert!(output.status.success(), "{said}");
    assert_eq!(said.matches("FAILED").count(), 0, "{said}");
    for part in ["19 of 19 SubDevices read", "cutting the cable", "ring open", "ring closed", "answers again"] {
        assert!(said.contains(part), "{part} is missing in:\n{said}");
    }
}

/// SIGINT and SIGTERM, by number.
const SIGNALS: [(&str, &str); 2] = [("-INT", "SIGINT"), ("-TERM", "SIGTERM")];

// covers: signals
#[test]
fn a_signal_ends_the_demonstration_with_a_result() {
    for (signal, name) in SIGNALS {
        let mut child = Command::new(env!("CARGO_BIN_EXE_ringcat"))
            .arg("demo")
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        // Its first line comes when signals are held.
        let mut first = [0];
        child.stdout.as_mut().expect("it is piped").read_exact(&mut first).expect("a line");
        let sent = Command::new("kill").args([signal, &child.id().to_string()]).status().expect("there is a kill");
        let output = child.wait_with_output().expect("it ends");
        assert!(sent.success());
        assert_eq!(output.status.code(), Some(1), "{name}");
        let last = text(&output.stderr).lines().last().map(str::to_owned);
        assert_eq!(last, Some(format!("result: FAILED: ended by {name} before the command had finished")));
    }
}

// covers: demo
#[test]
fn the_demonstration_holds_on_every_example_segment() {
    for name in ["demo", "tree", "junction-ring"] {
        let output = ringcat(&["demo", "--fast", "--segment", &segment(name)]);
        assert!(output.status.success(), "{name}: {}{}", text(&output.stdout), text(&output.stderr));
    }
}

#[test]
fn the_demonstration_holds_on_devices_made_of_real_images() {
    let data = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/sii");
    if !data.is_dir() {
        println!("skipped: {} is not here", data.display());
        return;
    }
    let mut text_of_segment = String::from("[segment]\nring = true\n");
    for image in
        ["beckhoff_ek1100_qitech", "beckhoff_el1008_qitech", "beckhoff_el2809_qitech", "beckhoff_el4002_qitech"]
    {
        text_of_segment += &format!("[[device]]\nsii = \"{image}.bin\"\n");
    }
    let path = std::env::temp_dir().join(format!("ringcat-real-{}.toml", std::process::id()));
    std::fs::write(&path, text_of_segment.replace("sii = \"", &format!("sii = \"{}/", data.display())))
        .expect("writable");
    let output = ringcat(&["demo", "--fast", "--segment", &path.display().to_string()]);
    std::fs::remove_file(&path).expect("it was just written");
    let said = text(&output.stdout);
    assert!(output.status.success(), "{said}{}", text(&output.stderr));
    assert!(said.contains("EL2809"), "{said}");
}

/// Nothing was compared: that is said, as no failure and not as a comparison that held.
#[test]
fn without_process_data_the_demo_reports_that_nothing_was_compared() {
    let path = std::env::temp_dir().join(format!("ringcat-couplers-{}.toml", std::process::id()));
    let couplers = "[segment]\nring = true\n[[device]]\ntype = \"coupler\"\n[[device]]\ntype = \"coupler\"\n";
    std::fs::write(&path, couplers).expect("writable");
    let output = ringcat(&["demo", "--fast", "--segment", &path.display().to_string()]);
    std::fs::remove_file(&path).expect("it was just written");
    let said = text(&output.stdout);
    assert!(output.status.success(), "{said}{}", text(&output.stderr));
    assert!(said.contains("no SubDevice has process data, so none was compared"), "{said}");
    assert!(!said.contains("comparisons") && !said.contains("FAILED"), "{said}");
}

// covers: demo
#[test]
fn two_runs_of_the_demonstration_print_the_same() {
    let run = || text(&ringcat(&["demo", "--fast"]).stdout);
    assert_eq!(run(), run());
}

// covers: demo
#[test]
fn a_wrong_segment_file_is_named_with_its_line() {
    let path: PathBuf = std::env::temp_dir().join(format!("ringcat-wrong-{}.toml", std::process::id()));
    std::fs::write(&path, "[segment]\nring = true\n\n[[device]]\ntype = \"digital-otput-8\"\n").expect("writable");
    let output = ringcat(&["demo", "--segment", &path.display().to_string()]);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2));
    assert!(said.contains(&format!("{}:5:", path.display())), "{said}");
    assert!(said.contains("digital-otput-8"), "{said}");
    std::fs::remove_file(&path).expect("it was just written");
}

#[test]
fn a_reader_that_goes_away_is_no_panic() {
    let mut demo = Command::new(env!("CARGO_BIN_EXE_ringcat"))
        .args(["demo", "--fast"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    drop(demo.stdout.take());
    let output = demo.wait_with_output().expect("it ends");
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(output.stderr.is_empty());
}

// covers: demo
#[test]
fn a_missing_segment_file_is_named() {
    let output = ringcat(&["demo", "--segment", "/nowhere/plant.toml"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("/nowhere/plant.toml"));
}
