//! Every command with `--json` on a simulated segment: each line holds the keys of `docs/json.md`, no more and no less.

use std::io::Write;
use std::process::{Child, Command, Output};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::bench::{Bench, await_op, finish, program};
use crate::documented::Page;
use crate::{Plant, said};

const RING_OF_6: Plant = Plant { outputs: 2, inputs: 1, servos: 2, coupler: true };
const BOTH: [&str; 4] = ["--main", "main0", "--redundant", "main1"];

/// The result of a command that ran. A busy machine may cost it a cycle: then it says so and exits with 1.
fn result(page: &Page, command: &str, output: &Output) -> Value {
    let (text, errors) = said(output);
    let result = page.check(command, &text);
    println!("{command}: {}", result["result"]);
    let expected = match result["result"]["outcome"].as_str() {
        Some("ok") => 0,
        Some("failed") => 1,
        _ => panic!("{command}: {text}{errors}"),
    };
    assert_eq!((output.status.code(), result["result"]["exit_code"].as_i64()), (Some(expected), Some(expected.into())));
    assert!(errors.trim_end().lines().last().is_some_and(|line| line.starts_with("result: ")), "{command}: {errors}");
    result
}

fn interrupt(child: &Child) {
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(sent.is_ok_and(|status| status.success()));
}

// covers: json
#[test]
fn commands_on_a_ring_print_the_documented_keys() {
    let Some(mut bench) = Bench::new(2) else { return };
    let (page, count) = (Page::read(), RING_OF_6.count());
    bench.simulate(&RING_OF_6.segment(), true);
    let ringcat = |command: &str, options: &[&str]| {
        let arguments: Vec<&str> = command.split(' ').chain(BOTH).chain(options.iter().copied()).collect();
        result(&page, command, &bench.ringcat(&[&arguments[..], &["--json"]].concat()))
    };
    let length = |value: &Value| value.as_array().map_or(0, Vec::len);

    let scan = ringcat("scan", &[]);
    assert_eq!((length(&scan["subdevices"]), scan["main_subdevices"].as_u64()), (count, Some(count as u64)));
    assert_eq!(scan["subdevices"][1]["connected_to"]["position"], 0);

    let ring = ringcat("ring", &[]);
    assert_eq!((ring["ring"].as_str(), length(&ring["cables"])), (Some("closed"), count + 1));
    bench.order("cut 2-3");
    let open = ringcat("ring", &[]);
    assert_eq!((open["ring"].as_str(), open["result"]["outcome"].as_str()), (Some("open"), Some("failed")));
    assert_eq!(open["line_break"]["near"]["position"], 2);
    bench.order("heal all");

    let run = ringcat("run", &["--for", "500ms", "--clocks", "--gateway", "--cycle", "4ms"]);
    assert_eq!((run["reached_op"].as_bool(), run["stopped"].as_bool()), (Some(true), Some(true)));
    assert_eq!((length(&run["states"]), length(&run["interfaces"]), length(&run["clocks"]["clocks"])), (count, 2, 3));
    assert!(run["cycles"]["count"].as_u64() > Some(100) && run["round_trips"]["median_ns"].as_u64() > Some(0));
    assert_eq!(run["gateway"]["connections"], 0);

    let clocks = ringcat("clocks", &["--for", "300ms", "--sync", "auto"]);
    assert_eq!((clocks["locked"].as_bool(), length(&clocks["clocks"])), (Some(true), 3));

    let cycles = ringcat("bench cycles", &["--count", "2000"]);
    assert_eq!(cycles["cycle_times"]["count"], 2000);
    assert_eq!(cycles["start_up"]["subdevices"], count);
    let rate = ringcat("bench rate", &[]);
    assert!(length(&rate["tries"]) > 0);
}

// covers: json
#[test]
fn the_simulator_and_onlookers_print_the_documented_keys() {
    let Some(bench) = Bench::new(1) else { return };
    let page = Page::read();
    let program = program("ringcat");
    let segment = concat!(env!("CARGO_MANIFEST_DIR"), "/../sim/segments/demo.toml");
    let file = std::env::temp_dir().join(format!("ringcat-json-{}.pcapng", std::process::id()));
    let path = file.display().to_string();

    let arguments = ["sim", "--main", "sim0", "--segment", segment, "--receive", "block", "--json"];
    let mut sim = bench.start_at_sim(&program, &arguments);
    let mut orders = sim.stdin.take().expect("it is piped");
    let capture = bench.start(&program, &["capture", "--main", "main0", "--out", &path, "--json"]);
    let scan = result(&page, "scan", &bench.ringcat(&["scan", "--main", "main0", "--json"]));
    assert_eq!(scan["subdevices"].as_array().map(Vec::len), Some(19));
    interrupt(&capture);
    let capture = result(&page, "capture", &finish(capture));
    assert!(capture["frames"].as_u64() > Some(100), "{capture}");
    std::fs::remove_file(&file).expect("it was written");

    orders.write_all(b"cut 1-2\nmake tea\nquit\n").expect("it reads");
    let output = finish(sim);
    let sim = result(&page, "sim", &output);
    assert_eq!((sim["subdevices"].as_u64(), sim["interfaces"][0]["link"].as_str()), (Some(19), Some("main")));
    let text = said(&output).0;
    let answers: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let answer = |order: &str| answers.iter().find(|answer| answer["order"] == order).expect("an answer");
    assert_eq!((answer("cut 1-2")["ok"].as_bool(), answer("make tea")["ok"].as_bool()), (Some(true), Some(false)));
    assert!(answer("cut 1-2")["text"].as_str().is_some_and(|text| text.starts_with("cut: cable between 1 ")));

    let echo = bench.start_at_sim(&program, &["bench", "echo", "--main", "sim0", "--receive", "block", "--json"]);
    std::thread::sleep(std::time::Duration::from_millis(500));
    let arguments = ["bench", "round-trip", "--main", "main0", "--count", "200", "--blocks", "2", "--json"];
    let trip = result(&page, "bench round-trip", &bench.ringcat(&arguments));
    assert_eq!(trip["main_device"]["cycle_times"]["count"], 200);
    interrupt(&echo);
    let echo = result(&page, "bench echo", &finish(echo));
    assert!(echo["frames_answered"].as_u64() >= Some(400), "{echo}");
}

// covers: json, standby
#[test]
fn a_standby_prints_the_documented_keys() {
    let Some(mut bench) = Bench::new(2) else { return };
    bench.add_second_main_device();
    bench.simulate(&RING_OF_6.segment(), true);
    let arguments = ["standby", "--main", "second0", "--redundant", "main1", "--json"];
    let standby = bench.start_other_ringcat(&arguments);
    // The ACTIVE reaches all SubDevices on its main link only if the INACTIVE forwards.
    let until = Instant::now() + Duration::from_secs(5);
    loop {
        let scan = bench.ringcat(&["scan", "--main", "main0", "--redundant", "active1", "--json"]);
        let scan: Value = serde_json::from_str(said(&scan).0.lines().last().expect("a line")).expect("JSON");
        if scan["main_subdevices"] == RING_OF_6.count() {
            break;
        }
        assert!(Instant::now() < until, "{scan}");
    }
    interrupt(&standby);
    let standby = result(&Page::read(), "standby", &finish(standby));
    assert!(standby["forwarded_on_redundant_frames"].as_u64() > Some(10), "{standby}");
}

// covers: json
#[test]
fn a_run_that_is_killed_by_a_second_signal_still_ends_with_a_result() {
    let Some(mut bench) = Bench::new(1) else { return };
    bench.simulate(&RING_OF_6.segment(), false);
    let run = bench.start_ringcat(&["run", "--main", "main0", "--json"]);
    await_op(&bench, RING_OF_6.count());
    bench.set_link("sim0", "down");
    interrupt(&run);
    std::thread::sleep(std::time::Duration::from_millis(50));
    interrupt(&run);
    let output = finish(run);
    let text = said(&output).0;
    let last: Value = serde_json::from_str(text.lines().last().expect("a line")).expect("JSON");
    println!("{last}");
    assert_eq!((last["type"].as_str(), last["result"]["outcome"].as_str()), (Some("result"), Some("failed")));
    assert_eq!(output.status.code(), Some(1));
}
