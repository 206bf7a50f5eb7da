//! Phases of a start-up of a few SubDevices, in virtual time: the end of each phase, the time with an idle wire, and
//! the number of sequential exchanges; the time from power-on to OP with a bar.
//!
//! The segments are those of the tests on real interfaces: 1, 10 and 50 SubDevices of the catalogue with the
//! simulator's usual timing (8 bytes of SII every 500 us, 1 ms per change of state), and lines of servo drives, which
//! have long SIIs. The EEPROM of a single SubDevice limits its start: a drive's whole SII takes more than 30 ms, what
//! operation needs of it 20 ms.

use std::process::ExitCode;
use std::time::Duration;

use ringcat::{Error, Options};
use ringcat_sim::network::Network;
use scenarios::figures::{Figures, verdict};
use scenarios::phases::{Phase, bring_up, start_up};
use scenarios::segments::{drives, plant};

/// Maximum milliseconds to OP, by number of SubDevices: with a scan before activation, and in one step.
const BARS: [(usize, [f64; 2]); 3] = [(1, [33.5, 22.5]), (10, [25.5, 19.0]), (50, [44.0, 28.0])];
/// The same for lines of drives; the goal is 25, 30, 35 and 40, which starts in one step keep, and all starts of 10
/// and more.
const DRIVES: [(usize, [f64; 2]); 4] = [(1, [44.0, 25.0]), (10, [28.5, 20.0]), (50, [32.0, 22.5]), (100, [37.0, 27.0])];
/// How a start is made, both with default options.
type Start = fn(Network, &Options, Duration) -> Result<Vec<Phase>, Error>;
const STARTS: [(Start, &str); 2] =
    [(start_up, "scan with names, then activation"), (bring_up, "in one step, names in the background")];

pub fn main() -> ExitCode {
    match measure() {
        Ok(met) => verdict(met),
        Err(error) => {
            eprintln!("phases: {error}");
            ExitCode::FAILURE
        }
    }
}

fn measure() -> Result<bool, Error> {
    let mut met = true;
    for (at, (start, text)) in STARTS.into_iter().enumerate() {
        let plants = BARS.map(|(count, bars)| (format!("{count} SubDevices"), plant(count), bars[at]));
        let drives = DRIVES.map(|(count, bars)| (format!("{count} drives"), drives(count), bars[at]));
        for (name, network, bar) in plants.into_iter().chain(drives) {
            let mut figures = Figures::new(&format!("start-up of {name}, {text}"));
            let phases = start(network, &Options::default(), Duration::from_millis(1))?;
            phases.iter().for_each(|phase| show(&mut figures, phase));
            let last = phases.last().map_or(Duration::MAX, |phase| phase.at);
            figures.at_most("power-on to OP", last.as_secs_f64() * 1e3, bar, "ms");
            met &= figures.print();
        }
    }
    Ok(met)
}

fn show(figures: &mut Figures, phase: &Phase) {
    let Phase { end, at, silent, exchanges, frames } = phase;
    let (at, silent) = (at.as_secs_f64() * 1e3, silent.as_secs_f64() * 1e3);
    let text = format!("{at:>7.2} ms, {silent:>6.2} ms of silence, {exchanges:>4} exchanges, {frames:>5} frames");
    figures.show(&end.to_string(), text);
}
