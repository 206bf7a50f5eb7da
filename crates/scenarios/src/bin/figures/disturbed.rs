//! Power-on to OP in virtual time with one disturbance at a random time: frames that are lost, late, doubled or
//! damaged. The longest start shows the longest time limit that one disturbance can cost; its seed is printed.

use std::process::ExitCode;
use std::time::Duration;

use ringcat::{Error, Options, SiiExtent};
use ringcat_sim::cable::CableId;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::Network;
use ringcat_sim::time::SimTime;
use scenarios::dice::Dice;
use scenarios::figures::{Figures, verdict};
use scenarios::phases::start_up;
use scenarios::segments::drives;

/// Drives, and starts with each number of them.
const STARTS: [(usize, u64); 3] = [(1, 400), (10, 400), (50, 60)];
/// Disturbances begin up to here.
const LATEST_US: u64 = 30_000;
/// A frame is late by up to this time.
const LATE_US: u64 = 5_000;

pub fn main() -> ExitCode {
    let mut figures = Figures::new("power-on to OP with one disturbance at a random time");
    for (count, starts) in STARTS {
        let mut times: Vec<(Duration, u64)> = Vec::new();
        let mut failed: Vec<(u64, Error)> = Vec::new();
        for seed in 0..starts {
            match disturbed(drives(count), seed) {
                Ok(time) => times.push((time, seed)),
                Err(error) => failed.push((seed, error)),
            }
        }
        times.sort_unstable();
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        let at = |share: usize| times.get((times.len() * share / 100).min(times.len().saturating_sub(1)));
        if let (Some((median, _)), Some((most, _)), Some((longest, seed))) = (at(50), at(95), times.last()) {
            let text = format!(
                "median {:.1} ms, 95 % within {:.1} ms, longest {:.1} ms (seed {seed}); no start: {}",
                ms(*median),
                ms(*most),
                ms(*longest),
                failed.len()
            );
            figures.show(&format!("{count} drives"), text);
        }
        for (seed, error) in failed {
            figures.show(&format!("{count} drives, seed {seed}"), error);
        }
    }
    verdict(figures.print())
}

/// Time to OP.
fn disturbed(mut network: Network, seed: u64) -> Result<Duration, Error> {
    let dice = &mut Dice::new(seed);
    let cable = CableId(dice.below(network.cables().len() as u64) as usize);
    let at = SimTime(1_000 * dice.below(LATEST_US));
    let count = 1 + dice.below(3) as u32;
    let by = Duration::from_micros(100 + dice.below(LATE_US));
    let fault = match dice.below(5) {
        0 => Fault::Delay { cable, direction: None, count, by },
        1 => Fault::Duplicate { cable, direction: None, count },
        2 => Fault::Corrupt { cable, direction: None, count },
        _ => Fault::Drop { cable, direction: None, count },
    };
    network.schedule(at, fault);
    let options = Options::default().with_sii_extent(SiiExtent::Operation);
    let phases = start_up(network, &options, Duration::from_millis(1))?;
    Ok(phases.last().map_or(Duration::MAX, |phase| phase.at))
}
