//! `ethercat ring` and `ethercat clocks`, with and without an application.

use std::time::Duration;

use ringcat::sim::cable::CableId;
use ringcat::sim::fault::Fault;
use ringcat::{ClockConfig, SyncSignals, WhenUnlocked, automatic};

use crate::bench::{Bench, Driver};
use crate::several::ring;

const CYCLE: Duration = Duration::from_millis(1);

fn cut(bench: &Bench, is_cut: bool) {
    let fault = if is_cut { Fault::Cut(CableId(2)) } else { Fault::Heal(CableId(2)) };
    bench.inside(0, move |segment| segment.network_mut().apply(fault));
}

// covers: daemon, ring-status
#[test]
fn a_ring_and_its_break_are_shown_with_and_without_an_application() {
    let bench = Bench::start(vec![ring(4, true), ring(2, false)]);
    let shown = || bench.good(&["ring", "-m0"]);
    let closed = "ring        closed\nMAIN        4 slaves\nREDUNDANT   0 slaves\n";
    let open = "ring        OPEN: the next break isolates slaves\nMAIN        2 slaves\nREDUNDANT   2 slaves\n";
    let cables = "the MAIN interface - slave 0 port 0\n";
    for is_active in [false, true] {
        let driver = is_active.then(|| Driver::start(&bench, |found| automatic(found, CYCLE)));
        bench.wait_until("a closed ring", || shown().starts_with(closed));
        // Cables are known to an application.
        let lines = if is_active { 9 } else { 3 };
        assert!(shown().contains(cables) == is_active && shown().lines().count() == lines, "{}", shown());
        cut(&bench, true);
        bench.wait_until("an open ring", || shown().starts_with(open));
        if is_active {
            let place = "slave 1 port 1 - slave 2 port 0";
            bench.wait_until("its place", || shown().contains(&format!("line break  {place}\n")));
            assert!(shown().contains(&format!("{place}  <- line break\n")), "{}", shown());
        }
        cut(&bench, false);
        bench.wait_until("a closed ring again", || shown().starts_with(closed));
        if let Some(driver) = driver {
            driver.end();
        }
    }
    let both = bench.good(&["ring"]);
    assert!(both.starts_with("Master0\nring        closed\n"), "{both}");
    assert!(both.contains("Master1\nring        one link\nMAIN        2 slaves\n"), "{both}");
}

// covers: daemon, dc-tools
#[test]
fn clocks_are_shown_while_an_application_uses_them() {
    let bench = Bench::start(vec![
        ringcat::sim::segment::Segment::from_toml(
            "[[device]]\ntype = \"coupler\"\n[[device]]\ntype = \"servo\"\ncount = 2\n",
            std::path::Path::new("."),
        )
        .expect("it is right"),
    ]);
    let none = bench.tool(&["clocks"]);
    let wanted = (Some(0), "No application uses the distributed clocks.\n");
    assert_eq!((none.code, none.err.as_str()), wanted, "{none:?}");
    let declare = |found: &[ringcat::SubDeviceInfo]| {
        let mut declaration = automatic(found, CYCLE);
        for subdevice in declaration.subdevices.iter_mut().skip(1) {
            subdevice.sync = Some(SyncSignals::sync0(1_000_000, 0));
        }
        // A busy machine sends drift compensation late.
        declaration.with_clocks(ClockConfig::default().with_when_unlocked(WhenUnlocked::GoOn))
    };
    let _driver = Driver::start(&bench, declare);
    let shown = || bench.good(&["clocks"]);
    bench.wait_until("a clock with a difference", || shown().lines().count() == 4 && !shown().contains("  -  "));
    let shown = shown();
    let mut lines = shown.lines();
    assert_eq!(lines.next().map(|line| line.split("  ").last()), Some(Some("state")), "{shown}");
    assert_eq!(shown.matches("reference\n").count(), 1, "{shown}");
    let numbers = |line: &str| line.split_whitespace().take(5).all(|word| word.parse::<i64>().is_ok());
    assert!(lines.all(|line| numbers(line) || line.contains("reference")), "{shown}");
}
