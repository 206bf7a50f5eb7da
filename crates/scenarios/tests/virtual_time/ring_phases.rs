//! Rings of 2, 5, 16 and 64 SubDevices, cut and healed in every phase of their life ([`scenarios::ring_matrix`]): all
//! cables of the small ones, some of the large ones. `ci/bench` does all of them.

use std::time::Duration;

use scenarios::ring_matrix::{Bed, Phase};

/// Runs some cables of a ring in all phases, each at another moment; returns how many runs there were.
fn cables(count: usize, cables: impl Iterator<Item = usize> + Clone) -> usize {
    let bed = Bed::new(count, Duration::from_micros(10));
    let mut runs = 0;
    let (mut worst, mut compared) = ([0; 2], 0);
    for (number, phase) in Phase::ALL.into_iter().enumerate() {
        for cable in cables.clone() {
            let outcome = bed.run(cable, phase, ((cable * 37 + number * 131) % 1000) as u32);
            worst = [0, 1].map(|at| worst[at].max(outcome.incomplete[at]));
            compared += outcome.compared;
            runs += 1;
        }
    }
    println!(
        "ring of {count}: {runs} runs, at cut and repair {worst:?} incomplete cycles at the most, {compared} bytes as in \
         the twin"
    );
    assert!(compared > 0);
    runs
}

#[test]
fn any_cable_of_rings_of_2_and_5_is_cut_and_healed_in_every_phase_cr_02_cr_03_cr_14_cr_15_cr_19_cr_20_cr_23() {
    assert_eq!(cables(2, 0..=2) + cables(5, 0..=5), 99);
}

#[test]
fn some_cables_of_rings_of_16_and_64_are_cut_and_healed_in_every_phase_cr_02_cr_03_cr_14_cr_15_cr_19_cr_20() {
    assert_eq!(cables(16, [0, 8, 9, 16].into_iter()) + cables(64, [33].into_iter()), 55);
}
