//! Jumps of the application's time in OP, in segments of all kinds (protocol 7.2, 7.3).

use ringcat::PulseGrid;
use scenarios::clocks::{EPOCH, config, differences, spread};
use scenarios::pulses::Pulses;

use super::clock_times::{Host, network, with_sync0};

const CYCLE_NS: u64 = 1_000_000;

#[test]
fn explore_jumps() {
    for (kind, count) in [("line", 10), ("tree", 10), ("ring", 10)] {
        for jump in [450_000_i64, -330_000] {
            let config = config().with_bus_shift(true).with_pulse_grid(PulseGrid::FirstApplicationTime);
            let mut host = Host { base: EPOCH };
            let mut world = with_sync0(43, network(kind, count), config, &host);
            let mut pulses = Pulses::new(world.network(), 0..count, CYCLE_NS);
            let all: Vec<usize> = (0..count).collect();
            host.base = host.base.wrapping_add_signed(jump);
            println!("{kind} of {count}, jump of {jump} ns");
            for cycle in 0..6_000 {
                host.cycle(&mut world);
                pulses.observe(world.network());
                if cycle % 50 == 0 && (cycle < 500 || cycle % 500 == 0) {
                    println!(
                        "  {cycle}: {} ns apart, pulses {:?} apart, worst {}, {:?}",
                        spread(world.network(), &all),
                        pulses.apart_ns(),
                        pulses.worst_ns(),
                        differences(world.network(), &all)
                    );
                }
            }
        }
    }
}
