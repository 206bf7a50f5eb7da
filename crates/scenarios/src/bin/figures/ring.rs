//! Figures of the ring, in virtual time: incomplete cycles per edge for every cable of rings of 2, 5, 16 and
//! 64 in every phase of their life, times until a break is reported and located, and until the original direction is
//! restored, and ten thousand short random runs.
//!
//! Without arguments all figures; `ring SEED` repeats one of the random runs.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;
use std::thread;
use std::time::{Duration, Instant};

use ringcat::{Event, RingState};
use ringcat_sim::cable::CableId;
use ringcat_sim::fault::Fault;
use scenarios::check::ring_events;
use scenarios::figures::{Figures, verdict};
use scenarios::ring_matrix::{Bed, Outcome, Phase, allowed};
use scenarios::segments::ring_of_16;
use scenarios::short_runs;
use scenarios::world::{CYCLE, World};

/// Lengths of rings, and the moments of the cycle at which each cable is cut.
const RINGS: [(usize, &[u32]); 4] = [(2, &[0, 40, 300, 900]), (5, &[0, 40, 300, 900]), (16, &[20, 500]), (64, &[30])];
const FAST: Duration = Duration::from_micros(10);
/// Rings with slow link detection, and their detection times in microseconds.
const LATE_RINGS: [(usize, &[u64]); 4] = [(2, &[1_700, 20_000]), (5, &[1_700, 20_000]), (16, &[1_700]), (64, &[1_700])];
const RANDOM_RUNS: u64 = 10_000;
/// Worker threads of this bench.
const THREADS: u64 = 2;

pub fn main() -> ExitCode {
    if let Some(seed) = std::env::args().nth(2).and_then(|text| text.parse().ok()) {
        short_runs::run(seed);
        println!("seed {seed} holds");
        return ExitCode::SUCCESS;
    }
    // Failures print the log of the run, with the message of the panic.
    let matrix = matrix();
    let late = late();
    let edges = edges();
    let random = random();
    verdict(matrix && late && edges && random)
}

/// A part of the matrix, or the message of a failed check.
fn part(bed: &Bed, phases: &[Phase], cables: &[usize], moments: &[u32]) -> (Vec<Outcome>, usize) {
    let (mut outcomes, mut failed) = (Vec::new(), 0);
    for (number, phase) in phases.iter().copied().enumerate() {
        for cable in cables {
            for moment in moments {
                let moment = (moment + (cable * 37 + number * 131) as u32) % 1000;
                match catch_unwind(AssertUnwindSafe(|| bed.run(*cable, phase, moment))) {
                    Ok(outcome) => outcomes.push(outcome),
                    Err(_) => failed += 1,
                }
            }
        }
    }
    (outcomes, failed)
}

/// All cables, distributed over the workers.
fn parts(bed: &Bed, phases: &[Phase], moments: &[u32]) -> (Vec<Outcome>, usize) {
    let (even, odd): (Vec<usize>, Vec<usize>) = (0..=bed.count()).partition(|cable| cable % 2 == 0);
    let (left, right) = thread::scope(|scope| {
        let other = scope.spawn(|| part(bed, phases, &odd, moments));
        (part(bed, phases, &even, moments), other.join().expect("failures are counted"))
    });
    (left.0.into_iter().chain(right.0).collect(), left.1 + right.1)
}

/// Every cable again, with slow link detection.
fn late() -> bool {
    let mut figures =
        Figures::new("every cable cut and repaired in OP and during a file transfer, 1 ms, slow link detection");
    let begin = Instant::now();
    for (count, delays) in LATE_RINGS {
        for detection in delays.iter().copied().map(Duration::from_micros) {
            let (outcomes, failed) = parts(&Bed::new(count, detection), &[Phase::Idle, Phase::Foe], &[130]);
            let name = format!("ring of {count}, after {} us", detection.as_micros());
            let worst = |at: usize| outcomes.iter().map(|outcome| outcome.incomplete[at]).max().unwrap_or_default();
            let bar = outcomes.iter().map(|outcome| outcome.allowed).min().unwrap_or_default() as f64;
            figures.at_most(&format!("{name}: runs with a failed check"), failed as f64, 0.0, "runs");
            figures.at_most(&format!("{name}: incomplete cycles at a cut"), worst(0) as f64, bar, "cycles");
            figures.at_most(&format!("{name}: incomplete cycles at a repair"), worst(1) as f64, bar, "cycles");
        }
    }
    figures.show("all of it", format!("in {:.0} s", begin.elapsed().as_secs_f64()));
    figures.print()
}

fn matrix() -> bool {
    let mut figures = Figures::new("every cable of a ring cut and repaired in every phase, 1 ms, detection 10 us");
    for (count, moments) in RINGS {
        let begin = Instant::now();
        let bed = Bed::new(count, FAST);
        let (outcomes, failed) = parts(&bed, &Phase::ALL, moments);
        let worst = |at: usize| outcomes.iter().map(|outcome| outcome.incomplete[at]).max().unwrap_or_default();
        let compared: u64 = outcomes.iter().map(|outcome| outcome.compared).sum();
        let fixed = outcomes.iter().map(|outcome| outcome.fixed_after).max().unwrap_or_default();
        let name = format!("ring of {count}");
        let seconds = begin.elapsed().as_secs_f64();
        figures.show(
            &format!("{name}: runs"),
            format!("{} in {seconds:.0} s, {compared} bytes as in the twin", outcomes.len()),
        );
        figures.at_most(&format!("{name}: runs with a failed check"), failed as f64, 0.0, "runs");
        let once = outcomes.iter().map(|outcome| outcome.taken).sum::<u64>();
        figures
            .show(&format!("{name}: outputs taken over once in a cycle"), format!("{once} times, and never otherwise"));
        let bar = allowed(FAST, Duration::ZERO) as f64;
        figures.at_most(&format!("{name}: incomplete cycles at a cut"), worst(0) as f64, bar, "cycles");
        figures.at_most(&format!("{name}: incomplete cycles at a repair"), worst(1) as f64, bar, "cycles");
        figures.show(&format!("{name}: from a repair to the event"), format!("{:.1} ms", fixed.as_secs_f64() * 1e3));
    }
    figures.print()
}

/// Time from the cycle in which the exchange saw a state to an event.
fn after(world: &World, mark: scenarios::world::Mark, seen: ringcat::Instant, wanted: impl Fn(&Event) -> bool) -> f64 {
    let found = world.events(mark).iter().find(|timed| wanted(&timed.event));
    found.map_or(f64::INFINITY, |timed| timed.at.since(seen).as_secs_f64() / CYCLE.as_secs_f64())
}

/// Injects a fault and runs until the exchange detects a state, and a little longer.
fn see(world: &mut World, fault: Fault, moment: u32, state: RingState) -> ringcat::Instant {
    world.fault_in(CYCLE * moment / 1000, fault);
    let mut seen = None;
    for _ in 0..60 {
        world.cycle();
        if seen.is_none() && world.application().ring() == state {
            seen = Some(world.application().now());
        }
    }
    seen.unwrap_or(ringcat::Instant::NEVER)
}

fn edges() -> bool {
    let mut figures = Figures::new("edges of a ring of 16, 1 ms, detection 10 us, 17 cables, 10 moments of the cycle");
    let (mut reports, mut placed, mut fixed, mut quiet, mut double) = (0.0_f64, 0.0_f64, 0.0_f64, 0, (0, 0.0_f64));
    for cable in 0..=16 {
        let mut world = World::in_op(0, ring_of_16(FAST));
        world.application_mut().links_mut().measure_flights();
        world.run_cycles(20);
        let flight = Duration::from_nanos(world.application().links().flight_ns());
        for moment in [0, 5, 20, 40, 60, 80, 250, 400, 600, 900] {
            world.run_cycles(400);
            let mark = world.mark();
            let seen = see(&mut world, Fault::Cut(CableId(cable)), moment, RingState::Open);
            reports = reports.max(after(&world, mark, seen, |event| matches!(event, Event::RingOpened { .. })));
            placed = placed.max(after(&world, mark, seen, |event| matches!(event, Event::BreakLocated { .. })));
            let healing = world.mark();
            let seen = see(&mut world, Fault::Heal(CableId(cable)), moment, RingState::Closed);
            fixed = fixed.max(after(&world, healing, seen, |event| matches!(event, Event::RingClosed { .. })));
            // If no copy is under way from the cut until both ends have detected it, nothing is lost.
            let in_flight = CYCLE * moment / 1000 < flight || CYCLE * moment / 1000 + FAST >= CYCLE;
            if !in_flight {
                quiet += world.incomplete(mark);
            }
        }
        let other = (cable + 5) % 17;
        let mark = world.mark();
        world.cut(CableId(cable));
        world.run_cycles(400);
        world.cut(CableId(other));
        world.run_cycles(400);
        world.heal(CableId(cable));
        world
            .until(Duration::from_secs(5), "all in OP", |world| world.all_in_op() && world.application().all_settled());
        world.run_cycles(400);
        let healing = world.mark();
        let seen = see(&mut world, Fault::Heal(CableId(other)), 300, RingState::Closed);
        double.1 = double.1.max(after(&world, healing, seen, |event| matches!(event, Event::RingClosed { .. })));
        double.0 = double.0.max(world.incomplete(healing));
        assert!(ring_events(world.events(mark)).len() >= 3);
    }
    figures.at_most("from the first frame that shows a break to the event", reports, 1.0, "cycles");
    figures.at_most("from there to its place", placed, 5.0, "cycles");
    figures.at_most("incomplete cycles of edges with no copy under way", f64::from(quiet as u32), 0.0, "cycles");
    figures.show("from the first frame on the original path to the event", format!("{fixed:.2} cycles"));
    figures.show("the same after the second repair of a double break", format!("{:.2} cycles", double.1));
    figures.at_most("incomplete cycles of that second repair", double.0 as f64, 1.0, "cycles");
    figures.print()
}

fn random() -> bool {
    let begin = Instant::now();
    let each = RANDOM_RUNS / THREADS;
    let failed: Vec<u64> = thread::scope(|scope| {
        let workers: Vec<_> = (0..THREADS)
            .map(|worker| scope.spawn(move || short_runs::runs(worker * each..(worker + 1) * each)))
            .collect();
        workers.into_iter().flat_map(|worker| worker.join().expect("failures are counted")).collect()
    });
    let mut figures = Figures::new("short random runs of rings of 2 to 6: cuts, repairs, losses, delays, power cycles");
    figures.show("runs", format!("{RANDOM_RUNS} in {:.0} s", begin.elapsed().as_secs_f64()));
    figures.at_most("runs that do not hold", failed.len() as f64, 0.0, "runs");
    for seed in failed.iter().take(10) {
        figures.show("  again with", format!("target/release/figures ring {seed}"));
    }
    figures.print()
}
