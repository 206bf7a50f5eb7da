//! `ringcat demo --standby` as a user calls it.

use std::process::{Command, Output};

fn demo(more: &[&str]) -> Output {
    let mut arguments = vec!["demo", "--standby", "--fast"];
    arguments.extend(more);
    Command::new(env!("CARGO_BIN_EXE_ringcat")).args(arguments).output().expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

// covers: demo, standby, MR-07, MR-08, MR-16, REQ005, REQ015
#[test]
fn the_demonstration_of_two_controllers_holds_and_fits_80_columns() {
    let output = demo(&[]);
    let said = text(&output.stdout);
    assert!(output.status.success(), "{said}");
    assert!(said.ends_with("result: ok: everything held\n") && !said.contains("FAILED"), "{said}");
    for part in
        ["killing A", "B: taken over: 19 SubDevices", "starting A again", "(handed over)", "is cut", "its power"]
    {
        assert!(said.contains(part), "{part} is missing in:\n{said}");
    }
    let wide: Vec<&str> = said.lines().filter(|line| line.chars().count() > 80).collect();
    assert!(wide.is_empty(), "{wide:#?}");
    let axis = said.lines().find(|line| line.starts_with("  7 axis")).expect("a row of the drive");
    let cells: Vec<&str> = axis.split_whitespace().collect();
    assert_eq!((cells.len(), &cells[10..]), (12, &["0", "0"][..]), "{axis}");
    assert_eq!(said, text(&demo(&[]).stdout), "two runs print the same");
}

// covers: demo, standby, 9.9
#[test]
fn a_time_out_longer_than_the_watchdogs_makes_the_demonstration_fail() {
    let output = demo(&["--timeout", "150"]);
    let said = text(&output.stdout);
    assert_eq!(output.status.code(), Some(1), "{said}");
    let last = said.lines().last().unwrap_or_default();
    assert!(last.starts_with("result: FAILED: changes of states: "), "{said}");
    assert!(said.contains("  FAILED changes of states: "), "{said}");
    assert!(said.contains("SubDevice 2: OP to SAFEOP"), "{said}");
}

// covers: demo, standby
#[test]
fn the_demonstration_holds_on_other_rings_and_with_other_cycles() {
    let path = std::env::temp_dir().join(format!("ringcat-ring-{}.toml", std::process::id()));
    let branch = "[[device]]\nname = \"side\"\ntype = \"digital-output-8\"\nattach = \"head.2\"\n";
    let segments = [
        "[segment]\nring = true\n[[device]]\ntype = \"digital-output-16\"\n".to_owned(),
        format!(
            "[segment]\nring = \"out.1\"\n[[device]]\nname = \"head\"\ntype = \"coupler\"\n[[device]]\nname = \"out\"\n\
             type = \"digital-output-8\"\n{branch}"
        ),
    ];
    for segment in segments {
        std::fs::write(&path, &segment).expect("the temporary directory is writable");
        for cycle in ["500", "1000", "4000"] {
            let output = demo(&["--segment", &path.display().to_string(), "--cycle-us", cycle]);
            assert!(output.status.success(), "{segment}\n{cycle} us: {}", text(&output.stdout));
        }
    }
    std::fs::remove_file(&path).expect("it was just written");
}

// covers: demo, standby
#[test]
fn segments_without_a_ring_or_with_further_rings_are_refused() {
    let path = std::env::temp_dir().join(format!("ringcat-rings-{}.toml", std::process::id()));
    let further = "[segment]\nring = \"head.1\"\n[[device]]\nname = \"head\"\ntype = \"junction\"\n[[device]]\n\
                   name = \"one\"\ntype = \"coupler\"\nattach = \"head.3\"\n\
                   [[cable]]\nfrom = \"one.1\"\nto = \"head.2\"\n";
    let line = "[segment]\n[[device]]\ntype = \"coupler\"\n";
    for (segment, reason) in [(line, "two controllers need a ring"), (further, "rings behind junctions")] {
        std::fs::write(&path, segment).expect("the temporary directory is writable");
        let output = demo(&["--segment", &path.display().to_string()]);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(reason), "{said}");
    }
    std::fs::remove_file(&path).expect("it was just written");
    let alone = Command::new(env!("CARGO_BIN_EXE_ringcat")).args(["demo", "--timeout", "5"]).output();
    assert_eq!(alone.expect("the program starts").status.code(), Some(2), "a time-out is for two controllers");
}
