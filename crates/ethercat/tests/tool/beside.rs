//! The tool beside an application with cycles of 1 ms: what it costs them.

use std::time::{Duration, Instant};

use ringcat::automatic;

use crate::bench::{Bench, Counts, Driver};
use crate::several::ring;

/// Blocks without and with the tool, by turns.
const BLOCKS: usize = 8;
/// Length of a block.
const BLOCK: Duration = Duration::from_millis(500);
/// Tries on a busy machine.
const ROUNDS: usize = 3;
/// Cycles of 1 ms in all blocks of a kind.
const CYCLES: u64 = BLOCKS as u64 * BLOCK.as_millis() as u64;

fn block(driver: &Driver, mut work: impl FnMut()) -> Counts {
    let (before, begin) = (driver.counts(), Instant::now());
    while begin.elapsed() < BLOCK {
        work();
    }
    driver.counts().since(&before)
}

/// Cycles that began late, were left out or had incomplete process data.
const fn disturbed(counts: &Counts) -> u64 {
    counts.late + counts.skipped + counts.incomplete
}

// covers: daemon
#[test]
fn lists_in_a_loop_disturb_cycles_no_more_than_a_program_without_a_request() {
    let bench = Bench::start(vec![ring(20, true)]);
    let driver = Driver::start(&bench, |found| automatic(found, Duration::from_millis(1)));
    bench.wait_until("OP", || bench.good(&["slaves"]).matches("  OP  ").count() == 20);
    println!("cycles of 1 ms, 20 SubDevices, {BLOCKS} blocks of {BLOCK:?} each, by turns");
    for round in 1..=ROUNDS {
        let [mut without, mut started, mut with] = [Counts::default(); 3];
        let (mut starts, mut runs) = (0, 0);
        for _ in 0..BLOCKS {
            without += block(&driver, || std::thread::sleep(Duration::from_millis(5)));
            // The same program, which asks the daemon for nothing.
            started += block(&driver, || {
                assert!(bench.good(&["version"]).starts_with("IgH EtherCAT master 1.6.6"));
                starts += 1;
            });
            with += block(&driver, || {
                assert_eq!(bench.good(&["slaves"]).lines().count(), 20);
                runs += 1;
            });
        }
        println!("  without the tool: {without:?}\n  with 'ethercat version' in a loop, {starts} runs: {started:?}");
        println!("  with 'ethercat slaves' in a loop, {runs} runs: {with:?}");
        assert!(runs >= BLOCKS && starts >= BLOCKS);
        assert_eq!(bench.good(&["slaves"]).matches("  OP  ").count(), 20);
        let is_undisturbed = disturbed(&with) <= 2 * disturbed(&started) + CYCLES / 20;
        let has_run = [without, started, with].iter().all(|counts| counts.cycles >= CYCLES / 2);
        if is_undisturbed && has_run {
            return;
        }
        // Other programs on the machine may take its processors in the blocks of one kind.
        println!("  round {round} of {ROUNDS}: disturbed, or the machine is busy");
    }
    panic!("cycles were disturbed in {ROUNDS} rounds");
}
