//! Delays in port reports without an application: of rings, of rings behind junctions and in one another's branches,
//! compared with the true delays of the simulator (protocol 7.1).

use ringcat::JunctionMode;
use scenarios::delays::Shape;
use scenarios::delays::idle::{Reported, report};

/// Shapes of a seed.
fn shapes(seed: u64) -> [(Shape, JunctionMode); 5] {
    let size = 1 + (seed % 20) as usize;
    [
        (Shape::Ring(1 + size), JunctionMode::Automatic),
        (Shape::LocalRing(size), JunctionMode::Automatic),
        (Shape::Tree, JunctionMode::Automatic),
        (Shape::Gaps, JunctionMode::Automatic),
        (Shape::Tree, JunctionMode::Disabled),
    ]
}

fn all(seeds: impl Iterator<Item = u64>, cuts: usize) -> Reported {
    seeds.fold(Reported::default(), |mut sum, seed| {
        shapes(seed).into_iter().for_each(|(shape, mode)| sum.add(report(shape, mode, seed, cuts)));
        sum
    })
}

// covers: registers, dc-delays
#[test]
fn delays_without_an_application_are_right_in_rings_behind_junctions_too() {
    let reported = all(0..12, 1);
    assert_eq!(reported.wrong, Vec::<String>::new());
    assert_eq!(reported.missing_when_whole, Vec::<String>::new());
    assert!(reported.right > 1_000, "{reported:?}");
}

#[test]
fn seeds_from_the_environment() {
    let runs = |seeds: std::ops::Range<u64>| {
        let reported = all(seeds, 2);
        assert_eq!(reported.wrong, Vec::<String>::new());
        assert_eq!(reported.missing_when_whole, Vec::<String>::new());
        println!("{} delays right, {} of the same link not known", reported.right, reported.missing);
    };
    crate::explorer::from_environment(|seed| runs(seed..seed + 1), runs);
}
