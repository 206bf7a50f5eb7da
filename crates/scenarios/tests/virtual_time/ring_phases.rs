//! Rings of 2, 5, 16 and 64 SubDevices, cut and repaired in every phase ([`scenarios::ring_matrix`]): all cables of the
//! small ones, some of the large ones. `ci/bench` does all of them.

use std::time::Duration;

use scenarios::ring_matrix::{Bed, Phase};

/// Runs some cables of a ring in all phases, each at another moment; returns the number of runs.
fn cables(count: usize, cables: impl Iterator<Item = usize> + Clone) -> usize {
    let bed = Bed::new(count, Duration::from_micros(10));
    let mut runs = 0;
    let (mut worst, mut compared, mut taken) = ([0; 2], 0, 0);
    for (number, phase) in Phase::ALL.into_iter().enumerate() {
        for cable in cables.clone() {
            let outcome = bed.run(cable, phase, ((cable * 37 + number * 131) % 1000) as u32);
            worst = [0, 1].map(|at| worst[at].max(outcome.incomplete[at]));
            (compared, taken) = (compared + outcome.compared, taken + outcome.taken);
            runs += 1;
        }
    }
    println!(
        "ring of {count}: {runs} runs, at cut and repair {worst:?} incomplete cycles at the most, {compared} bytes as \
         in the twin, outputs taken over once per cycle {taken} times"
    );
    assert!(compared > 0 && taken > 0);
    runs
}

// covers: CR-02, CR-03, CR-14, CR-15, CR-19, CR-20, CR-23, ring-phases
#[test]
fn any_cable_of_rings_of_2_and_5_is_cut_and_repaired_in_every_phase() {
    assert_eq!(cables(2, 0..=2) + cables(5, 0..=5), 99);
}

// covers: CR-02, CR-03, CR-14, CR-15, CR-19, CR-20, ring-phases
#[test]
fn some_cables_of_rings_of_16_and_64_are_cut_and_repaired_in_every_phase() {
    assert_eq!(cables(16, [0, 8, 9, 16].into_iter()) + cables(64, [33].into_iter()), 55);
}

/// Slow link detection: the cut costs the detection time and no more.
// covers: CR-14, CR-15, ring-cut
#[test]
fn slow_link_detection_costs_rings_no_more_than_its_delay() {
    for (count, detection_us, chosen) in
        [(2, 1_700, &[0, 1, 2][..]), (5, 1_700, &[0, 2, 5]), (5, 20_000, &[3]), (64, 1_700, &[33])]
    {
        let detection = Duration::from_micros(detection_us);
        let bed = Bed::new(count, detection);
        let mut worst = [0; 2];
        for cable in chosen {
            for phase in [Phase::Idle, Phase::Foe] {
                let outcome = bed.run(*cable, phase, (cable * 137 % 1000) as u32);
                worst = [0, 1].map(|at| worst[at].max(outcome.incomplete[at]));
            }
        }
        println!("ring of {count}, {detection_us} us: at cut and repair {worst:?} incomplete cycles at the most");
        assert!(worst[0] > 1, "a cut that is detected late costs more than one cycle");
    }
}
