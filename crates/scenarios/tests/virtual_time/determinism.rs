//! The same seed gives the same run, bit for bit: all frames on both links with their times, and all events.

use std::time::Duration;

use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::network::NetworkOptions;
use scenarios::dice::Dice;
use scenarios::segments::{SIXTEEN, descriptions, ring};
use scenarios::tap::Fingerprint;
use scenarios::world::World;

/// A run with cuts, power cycles and corrupt frames, all from the seed.
fn run(seed: u64) -> (Fingerprint, usize) {
    let mut dice = Dice::new(seed);
    let options = NetworkOptions::default().with_seed(seed);
    let network = ring(descriptions(&SIXTEEN), options.with_detection_delay(Duration::from_micros(300)));
    let mut world = World::in_op(seed, network);
    world.evaluate_latched(false);
    for _ in 0..10 {
        let (cable, device) = (CableId(dice.below(17) as usize), DeviceIndex(dice.below(16) as usize));
        world.corrupt(CableId(dice.below(17) as usize), 3);
        world.cut(cable);
        world.run_cycles(dice.below(40));
        world.heal(cable);
        world.power_off(device);
        world.run_cycles(dice.below(40));
        world.power_on(device);
        world.run_cycles(dice.below(60));
    }
    (world.fingerprint(), world.events(world.beginning()).len())
}

// covers: determinism
#[test]
fn the_same_seed_gives_the_same_frames_and_events_bit_for_bit() {
    for seed in 0..4 {
        let (first, second) = (run(seed), run(seed));
        println!("seed {seed}: fingerprint {:#018x}, {} events", first.0.0, first.1);
        assert_eq!(first, second, "seed {seed}");
    }
}

// covers: determinism
#[test]
fn another_seed_gives_another_run() {
    assert_ne!(run(10).0, run(11).0);
}
