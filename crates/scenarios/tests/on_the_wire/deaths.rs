//! Deaths of the ACTIVE and of the INACTIVE, each many times, with `ringcat standby` on both sides; the time between
//! outputs is measured inside the simulated SubDevices, and stalls of the host are recorded beside it.
//!
//! `RINGCAT_FULL=1` plays 50 rounds of each kind, otherwise a few.

mod rounds;
mod stalls;
mod stopped_thread;

use std::fmt::Write as _;
use std::time::Duration;

use scenarios::figures::median;

use crate::takeover::Pair;
use rounds::{Kind, Ring, Round, Victim};

/// Rounds of each kind and role: with `RINGCAT_FULL=1`, and in CI.
const ROUNDS: [usize; 2] = [50, 20];
/// Period of the cycles.
const CYCLE: Duration = Duration::from_millis(5);
/// The guard switches the interfaces of a process off that has sent no heartbeat for this time.
const GUARD: Duration = Duration::from_millis(12);
/// Detection of a link: polled each millisecond, and the time that the kernel takes.
const LINK_DETECTION: Duration = Duration::from_millis(2);
/// Cycles that may be missing when the ACTIVE dies, of a time-out of 3.
const MOST_MISSING: u32 = 5;
/// Cycles that may be missing when the ring opens.
const MOST_AT_AN_EDGE: u32 = 2;
/// Controllers that a stall of the host may end while they begin.
const MOST_RESTARTS: usize = 10;
/// Options of both.
const OPTIONS: [&str; 6] = ["--listen", "300ms", "--timeout", "3", "--guard", "12ms"];

/// Longest time between two outputs, without stalls of the host.
fn longest_gap(kind: Kind, victim: Victim) -> Duration {
    match (kind, victim) {
        // A switchover: none is missing.
        (Kind::Ends, Victim::Active) => CYCLE * 8 / 5,
        // Its interfaces are off from one moment to the next: the edge of a cut.
        (Kind::Ends, Victim::Inactive) => CYCLE * (MOST_AT_AN_EDGE + 1),
        (_, Victim::Active) => CYCLE * (MOST_MISSING + 1),
        // A cycle, and those that are missing: guard, detection of the link, and one.
        (_, Victim::Inactive) => CYCLE + GUARD + LINK_DETECTION + CYCLE,
    }
}

fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

/// Cycles that are missing in a time between two outputs.
fn missing(gap: Duration) -> f64 {
    (gap.as_secs_f64() / CYCLE.as_secs_f64() - 1.0).max(0.0)
}

/// A line of the table; what did not hold is added to the reasons.
fn line(kind: Kind, victim: Victim, rounds: &[Round], reasons: &mut Vec<String>) -> String {
    let most = longest_gap(kind, victim);
    for (number, round) in rounds.iter().enumerate() {
        let Round { gap, stalls, changes, back, expected_changes } = *round;
        let here =
            format!("{kind:?} of the {victim:?}, round {number}: {:.3} ms, stalls {:.3} ms", ms(gap), ms(stalls));
        if gap > most + stalls {
            reasons.push(format!("{here}: at most {:.3} ms", ms(most)));
        }
        if back > 0 || changes != expected_changes {
            reasons.push(format!("{here}: {back} outputs went back, {changes} changes of the MainDevice"));
        }
    }
    let gaps: Vec<f64> = rounds.iter().map(|round| missing(round.gap)).collect();
    let worst = rounds.iter().max_by_key(|round| round.gap).expect("there are rounds");
    format!(
        "{:<11} {:<8} {:>6} {:>11.2} {:>11.2} {:>11.2} {:>11.3}\n",
        format!("{kind:?}"),
        format!("{victim:?}"),
        rounds.len(),
        median(&gaps),
        missing(worst.gap),
        missing(most),
        ms(worst.stalls),
    )
}

// covers: standby, MR-07, MR-21, REQ005, REQ012, REQ018, 9.9
#[test]
fn deaths_of_both_cost_no_more_than_their_limits_inside_the_subdevices() {
    let Some(pair) = Pair::with_role(&OPTIONS) else { return };
    let is_full = std::env::var("RINGCAT_FULL").is_ok_and(|value| value == "1");
    let rounds = ROUNDS[usize::from(!is_full)];
    let mut ring = Ring::start(&pair);
    let mut reasons = Vec::new();
    let mut table = String::new();
    for kind in Kind::ALL {
        // In turn: each death of the ACTIVE changes the role, so either controller dies as INACTIVE.
        let played: Vec<[Round; 2]> = (0..rounds).map(|_| Victim::ALL.map(|victim| ring.play(kind, victim))).collect();
        for (place, victim) in Victim::ALL.into_iter().enumerate() {
            let of_victim: Vec<Round> = played.iter().map(|both| both[place]).collect();
            table += &line(kind, victim, &of_victim, &mut reasons);
        }
    }
    let mut text = String::new();
    // Writing into a String cannot fail.
    let _ = writeln!(text, "cycle {CYCLE:?}, time-out 3 cycles, guard {GUARD:?}, blocking receive; in missing cycles:");
    let _ = writeln!(
        text,
        "{:<11} {:<8} {:>6} {:>11} {:>11} {:>11} {:>11}",
        "kind", "of the", "rounds", "median", "worst", "at most", "stalls, ms"
    );
    println!("{text}{table}");
    println!("controllers that a stall of the host has ended while they began: {}", ring.restarts);
    if ring.restarts > MOST_RESTARTS {
        reasons.push(format!("at most {MOST_RESTARTS} controllers may be ended by their guards while they begin"));
    }
    pair.bench.show_simulator_lateness();
    println!("result: {}", if reasons.is_empty() { "ok" } else { "FAILED" });
    assert!(reasons.is_empty(), "{}", reasons.join("\n"));
}
