//! Programs that end without a release.

use std::time::{Duration, Instant};

use crate::daemon::Bench;
use crate::library::{here, program, workshop};

// covers: c-interface, daemon
#[test]
fn a_program_that_ends_without_a_release_leaves_its_bus_to_the_daemon() {
    let Some(exits) = program(&here().join("tests/c/exits.c"), &[]) else { return };
    let segment = workshop().join("exits.toml");
    std::fs::write(&segment, "[segment]\n[[device]]\ntype = \"digital-output-8\"\n").expect("it can be written");
    let bench = Bench::start(&segment, "exits");
    for way in ["exit", "_exit", "return", "exit"] {
        let before = bench.connected_ns();
        let output = bench.command(&exits).arg(way).output().expect("it runs");
        let reported = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{way}: {reported}");
        assert_eq!(String::from_utf8_lossy(&output.stdout), "op: 1\n", "{way}: {reported}");
        let begin = Instant::now();
        while bench.connected_ns() == before || bench.outputs_are_set() {
            assert!(begin.elapsed() < Duration::from_secs(10), "{way}: outputs are set, or the daemon has no bus");
            std::thread::sleep(Duration::from_millis(1));
        }
        println!("{way}: the daemon has the bus, and no output is set, after {:?}", begin.elapsed());
        bench.wait_for_preop();
    }
}
