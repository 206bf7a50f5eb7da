//! Delays that are written during process data exchange: rings of 2 to 64, local rings, random trees with
//! rings, compared with the true delays of the simulator ([`scenarios::delays`]). The environment variable `DELAYS` is
//! the number of changes of each kind and seed; the default is a share of the full number. `SEED` selects other
//! segments (`17` or `17..20`).

use std::process::ExitCode;
use std::thread;

use scenarios::delays::{Outcome, Shape, run};
use scenarios::dice::Dice;
use scenarios::figures::{Figures, verdict};
use scenarios::seeds;

/// Default number of changes of each kind.
const CHANGES: u64 = 60;
/// Changes of one segment.
const OF_ONE: u64 = 20;

pub fn main() -> ExitCode {
    let wanted = std::env::var("DELAYS").ok().and_then(|text| text.parse().ok()).unwrap_or(CHANGES);
    let mut figures = Figures::new("delays written while cycles of 1 ms go on, cables cut and healed, in virtual time");
    type Draw = fn(&mut Dice) -> Shape;
    let kinds: [(&str, Draw); 6] = [
        ("rings of 2 to 16", |dice| Shape::Ring(2 + dice.below(15) as usize)),
        ("rings of 17 to 64", |dice| Shape::Ring(17 + dice.below(48) as usize)),
        ("local rings of 2 to 12", |dice| Shape::LocalRing(2 + dice.below(11) as usize)),
        ("local rings of 13 to 32", |dice| Shape::LocalRing(13 + dice.below(20) as usize)),
        ("random trees with rings", |_| Shape::Tree),
        ("the same, a third without a clock", |_| Shape::Gaps),
    ];
    for seed in seeds::from_environment().unwrap_or(14..15) {
        let mut dice = Dice::new(seed);
        for (name, draw) in kinds {
            let runs: Vec<_> = (0..wanted.div_ceil(OF_ONE)).map(|_| (draw(&mut dice), dice.roll())).collect();
            print(&mut figures, name, &both(&runs));
        }
    }
    verdict(figures.print())
}

/// Half of the runs in a thread of its own.
fn both(runs: &[(Shape, u64)]) -> Outcome {
    let all = |runs: &[(Shape, u64)]| {
        runs.iter().fold(Outcome::default(), |mut sum, (shape, seed)| {
            sum.add(run(*shape, *seed, OF_ONE));
            sum
        })
    };
    let (left, right) = runs.split_at(runs.len() / 2);
    thread::scope(|scope| {
        let left = scope.spawn(move || all(left));
        let mut sum = all(right);
        sum.add(left.join().expect("a run has failed, its seed is above"));
        sum
    })
}

fn print(figures: &mut Figures, name: &str, outcome: &Outcome) {
    outcome.wrong.iter().take(5).for_each(|text| println!("  {text}"));
    let what = format!("{name}: wrong ones of {} written in {} changes", outcome.written, outcome.changes);
    figures.at_most(&what, outcome.wrong.len() as f64, 0.0, "");
    figures.show("the same: largest error of a hop", format!("{:.1} ns", outcome.largest_ns));
    let not_written: u64 = outcome.not_written.values().sum();
    figures.show("the same: changes after which some were not written", not_written);
    let hidden: u64 = outcome.hidden.iter().filter(|(count, _)| **count > 0).map(|(_, times)| times).sum();
    figures.show(
        "the same: changes after which some were hidden by forks without a clock, and reported as hidden",
        hidden,
    );
    for (reason, count) in &outcome.not_written {
        println!("  {name}: not written {count} times: {reason}");
    }
}
