//! The tool beside an application with cycles of 1 ms: what it costs them.

use std::time::{Duration, Instant};

use ringcat::automatic;

use crate::bench::{Bench, Counts, Driver};
use crate::several::ring;

/// Blocks without and with the tool, by turns.
const BLOCKS: usize = 8;
/// Length of a block.
const BLOCK: Duration = Duration::from_millis(500);
/// Cycles of 1 ms in all blocks of a kind.
const CYCLES: u64 = BLOCKS as u64 * BLOCK.as_millis() as u64;

fn block(driver: &Driver, mut work: impl FnMut()) -> Counts {
    let (before, begin) = (driver.counts(), Instant::now());
    while begin.elapsed() < BLOCK {
        work();
    }
    driver.counts().since(&before)
}

// covers: daemon
#[test]
fn cycles_go_on_beside_a_loop_of_lists_and_are_counted() {
    let bench = Bench::start(vec![ring(20, true)]);
    let driver = Driver::start(&bench, |found| automatic(found, Duration::from_millis(1)));
    bench.wait_until("OP", || bench.good(&["slaves"]).matches("  OP  ").count() == 20);
    let (mut without, mut with, mut runs) = (Counts::default(), Counts::default(), 0);
    for _ in 0..BLOCKS {
        without += block(&driver, || std::thread::sleep(Duration::from_millis(5)));
        with += block(&driver, || {
            assert_eq!(bench.good(&["slaves"]).lines().count(), 20);
            runs += 1;
        });
    }
    println!("cycles of 1 ms, 20 SubDevices, {BLOCKS} blocks of {BLOCK:?} each, by turns");
    println!("  without the tool: {without:?}\n  with 'ethercat slaves' in a loop, {runs} runs: {with:?}");
    assert!(runs >= BLOCKS);
    // Both processors of a small machine are in use: it is counted what comes late. The bus stays in operation.
    assert!(without.cycles >= CYCLES / 2 && with.cycles >= CYCLES / 2, "{without:?} {with:?}");
    assert_eq!(bench.good(&["slaves"]).matches("  OP  ").count(), 20);
}
