//! Rings behind junctions and crossed lines on interfaces: modes `automatic` and `strict` of `ringcat run`, and
//! enhanced detection, which takes the redundant interface down and brings it back.

use std::time::Duration;

use crate::bench::{Bench, await_op};

/// A junction with a ring of three on port 3 that comes back to port 1, and one more on its port 2.
const JUNCTION: &str = include_str!("../../../sim/segments/junction-ring.toml");
/// A ring of two interfaces, whose third SubDevice has IN and OUT swapped, and a branch that processes only the
/// redundant copy: a closed ring does not show which of the two is crossed.
const CROSSED: &str = r#"
[segment]
name = "crossed"

[[device]]
name = "first"
type = "junction"

[[device]]
name = "second"
type = "digital-output-8"
attach = "first.1"

[[device]]
name = "crossed"
type = "servo"
attach = "second.1"
port = 1

[[device]]
name = "last"
type = "digital-input-8"
attach = "crossed.0"

[[device]]
name = "branch"
type = "coupler"
attach = "first.2"

[[cable]]
from = "last.1"
to = "redundant"
"#;
/// Cables that are cut, by the devices at their ends, and the text of both ends: an inner cable, the closing cable, the
/// first cable.
const BROKEN: [(&str, [&str; 2]); 3] = [
    ("2-3", [" SubDevice 2 ", " port 1 and SubDevice 3 "]),
    ("1-4", [" SubDevice 4 ", " port 1 and SubDevice 1 "]),
    ("1-2", [" SubDevice 1 ", " port 3 and SubDevice 2 "]),
];
/// Time from a command to the report of its effect: a repair is reported after 50 ms.
const PAUSE: Duration = Duration::from_millis(250);

// covers: JR-03, JR-07, junctions
#[test]
fn a_local_ring_break_and_repair_are_reported_in_both_junction_modes() {
    let Some(mut bench) = Bench::new(1) else { return };
    for mode in ["automatic", "strict=1:1-4:1"] {
        bench.simulate(JUNCTION, false);
        let run = bench.run_ringcat(&["run", "--main", "main0", "--junction", mode]);
        await_op(&bench, 6);
        std::thread::sleep(PAUSE);
        for (cable, _) in &BROKEN {
            for verb in ["cut", "heal"] {
                bench.order(&format!("{verb} {cable}"));
                std::thread::sleep(PAUSE);
            }
        }
        let (output, errors) = run.interrupt();
        let learned = output.matches("ring behind a junction found: its closing cable is from SubDevice 4").count();
        assert_eq!(learned, usize::from(mode == "automatic"), "{mode}: {output}{errors}");
        for (cable, ends) in &BROKEN {
            for words in ["Line break between", "Line is fixed between"] {
                let is_it = |line: &&str| line.contains(words) && ends.iter().all(|end| line.contains(end));
                assert_eq!(output.lines().filter(is_it).count(), 1, "{mode}, {cable}: {output}{errors}");
            }
        }
        assert_eq!(output.matches("Line break between SubDevice").count(), 3, "{mode}: {output}{errors}");
        assert_eq!(output.matches("Line is fixed between SubDevice").count(), 3, "{mode}: {output}{errors}");
        for trouble in ["line crossed", "no longer answers", "no frame comes back"] {
            assert!(!output.contains(trouble), "{mode}: {output}{errors}");
        }
        assert!(output.contains("stopped: outputs zero, all SubDevices in INIT"), "{mode}: {output}{errors}");
        println!("--junction {mode}: three cables cut and repaired, each reported once with both ends");
    }
}

// covers: LC-03, crossed-enhanced
#[test]
fn enhanced_detection_takes_the_redundant_interface_down_and_brings_it_back() {
    let Some(mut bench) = Bench::new(2) else { return };
    bench.simulate(CROSSED, true);
    let run = bench.run_ringcat(&["run", "--main", "main0", "--redundant", "main1", "--enhanced-line-crossed"]);
    await_op(&bench, 5);
    std::thread::sleep(PAUSE);
    let at_the_scan = run.said().so_far();
    assert_eq!(at_the_scan.matches("line crossed").count(), 1, "{at_the_scan}");
    assert_eq!(bench.simulator_said().so_far().matches("carrier is gone").count(), 1, "the scan took it down");
    // A change of ports: the branch is unplugged and plugged in again.
    for verb in ["cut", "heal"] {
        bench.order(&format!("{verb} 0-4"));
        std::thread::sleep(4 * PAUSE);
    }
    let said = bench.simulator_said().so_far();
    let (downs, ups) = (said.matches("carrier is gone").count(), said.matches("carrier is back").count());
    assert!(downs >= 2 && ups == downs, "{said}");
    assert!(
        bench.links_main().lines().any(|line| line.contains("main1") && line.contains("state UP")),
        "{}",
        bench.links_main()
    );
    let (output, errors) = run.interrupt();
    for reports in ["ring open", "cannot be taken down"] {
        assert!(!output.contains(reports), "a controlled break is not reported: {output}{errors}");
    }
    println!("{downs} times the redundant interface was taken down and came back");
    assert!(output.contains("stopped: outputs zero, all SubDevices in INIT"), "{output}{errors}");
}
